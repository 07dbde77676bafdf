"""Errors of signals, data sets and models: one base error; subclasses are those that are caught."""

from collections.abc import Iterable
from pathlib import Path


class ModelsError(ValueError):
    """The base of every error that `noiseclassifier` expects."""


class SignalError(ModelsError):
    """A signal, or frames of one, that cannot be classified."""


class MissingSignalError(SignalError):
    """Signals that a model needs and that are missing, beside those that there are."""

    def __init__(self, lacking: Iterable[str], there: Iterable[str]) -> None:
        self.lacking, self.there = tuple(lacking), tuple(there)
        super().__init__(f"no signal {', '.join(self.lacking)}; there is {', '.join(self.there)}")


class ProfileError(ModelsError):
    """Settings of a profile that do not fit together."""


class RecordingError(ModelsError):
    """A recording whose samples or annotations are wrong; the problem is one line."""

    def __init__(self, name: str, problem: str) -> None:
        self.name, self.problem = name, problem
        super().__init__(f"{name}: {problem}")


class RateError(ModelsError):
    """A sample rate in [Hz] that no model takes; advice is empty if it is too low for all."""

    def __init__(self, rate: float, known: Iterable[float], advice: str = "") -> None:
        self.rate, self.known = rate, tuple(sorted(set(known)))
        there = ", ".join(f"{each:g}" for each in self.known) or "none"
        message = f"logged at {rate:g} Hz, the model needs {there.partition(',')[0]} Hz or more"
        if advice or not self.known:
            advice = advice or "there is no model"
            message = f"rate of {rate:g} Hz; the models' rates are {there} Hz: {advice}"
        super().__init__(message)


class FileError(ModelsError):
    """A model file, or a file of a data set, that cannot be read or holds wrong values."""

    def __init__(self, path: str | Path, problem: str) -> None:
        self.path, self.problem = Path(path), problem
        super().__init__(f"{path}: {problem}")


class OutputError(FileError):
    """An output that exists already or cannot be written."""


class AnnotationError(ModelsError):
    """Annotations that cannot be understood, and the place, say "chunk 3"; it may be empty."""

    def __init__(self, problem: str, where: str = "") -> None:
        self.problem, self.where = problem, where
        super().__init__(f"{where}: {problem}" if where else problem)


class DatasetError(ModelsError):
    """A data set that cannot be built, or that no classifier can be trained or tested on."""


class NoFrameError(DatasetError):
    """Recordings without a single frame that is annotated and whole."""

    def __init__(self, count: int, classes: Iterable[str]) -> None:
        self.count, self.classes = count, tuple(classes)
        super().__init__(
            f"no annotated frame in {count} recordings; annotate blocks of"
            f" {', '.join(self.classes)}"
        )
