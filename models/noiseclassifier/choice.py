"""The choice of a model for a signal."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import TypeAlias

from noiseclassifier import modelfile
from noiseclassifier.classifier import Classifier
from noiseclassifier.errors import MissingSignalError, RateError
from noiseclassifier.general import General
from noiseclassifier.logbands import LOWEST
from noiseclassifier.signals import NOISE

Model: TypeAlias = Classifier | General
"""A model of one rate, or of any."""


def load(path: str | Path) -> Model:
    """Read a model file; nothing in it is unpickled or run.

    Args:
        path: The file, of a model of one rate or of a general one.

    Raises:
        FileError: If the file is missing, damaged, no model file, or of another version.
    """
    manifest, arrays = modelfile.read(path)
    kind = General if "recipe" in manifest else Classifier
    return kind.of(manifest, arrays, modelfile.digest(path))


def nearest(
    models: Mapping[str, Model], rate: float, signals: Collection[str] = (NOISE,)
) -> tuple[str, Classifier]:
    """Model of the nearest rate at or below that of the signals, bound to them.

    Of models of one rate, it is the one of most signals. A general model has any rate.

    Args:
        models: Models of any rates, by name.
        rate: Sample rate of the signals, in [Hz].
        signals: Names of the signals that there are.

    Returns:
        Its name, and the model at its rate.

    Raises:
        MissingSignalError: If each model needs a signal that is missing.
        RateError: If all others are of higher rates, or there are no models.
    """
    found: dict[str, Classifier] = {}
    lacking: list[MissingSignalError] = []
    rates: list[float] = []
    for name, model in models.items():
        try:
            found[name] = model.at(rate, signals)
        except MissingSignalError as error:
            lacking.append(error)
        except RateError:
            rates.append(LOWEST if isinstance(model, General) else model.rate)
    if found:
        name = max(found, key=lambda each: (found[each].rate, len(found[each].profile.signals)))
        return name, found[name]
    if lacking and not rates:
        raise min(lacking, key=lambda error: len(error.lacking))
    raise RateError(rate, rates)
