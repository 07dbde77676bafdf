"""The choice of a model for a signal."""

from collections.abc import Collection, Iterable

from models.classifier import Classifier
from models.errors import MissingSignalError, RateError
from models.profile import TOLERANCE
from models.signals import NOISE, feeds


def nearest(
    models: Iterable[Classifier], rate: float, signals: Collection[str] = (NOISE,)
) -> Classifier:
    """Model of the nearest rate at or below that of the signals.

    Of models of one rate, it is the one of most signals.

    Args:
        models: Models of any rates.
        rate: Sample rate of the signals, in [Hz].
        signals: Names of the signals that there are.

    Raises:
        MissingSignalError: If each model needs a signal that is missing.
        RateError: If all others are of higher rates, or there are no models.
    """
    models = list(models)
    fed = [model for model in models if feeds(signals, model.profile.signals)]
    if models and not fed:
        wanted = min((model.profile.signals for model in models), key=len)
        raise MissingSignalError([name for name in wanted if name not in signals], signals)
    below = [model for model in fed if model.rate <= rate * (1.0 + TOLERANCE)]
    if not below:
        raise RateError(rate, [model.rate for model in fed], "too low for any; log faster")
    return max(below, key=lambda model: (model.rate, len(model.profile.signals)))
