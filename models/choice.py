"""The choice of a model for a signal."""

from collections.abc import Iterable

from models.classifier import Classifier
from models.errors import RateError
from models.profile import TOLERANCE


def nearest(models: Iterable[Classifier], rate: float) -> Classifier:
    """Find the model of the nearest rate at or below a signal's own: down, never up.

    Args:
        models: Models of any rates.
        rate: Sample rate of the signal, in [Hz].

    Raises:
        RateError: If all models are of higher rates, or there are none.
    """
    models = list(models)
    below = [model for model in models if model.rate <= rate * (1.0 + TOLERANCE)]
    if not below:
        raise RateError(rate, [model.rate for model in models], "too low for any; log faster")
    return max(below, key=lambda model: model.rate)
