"""Classification of a robot's noise: from a signal to labels.

    frames -> |STFT| -> bands -> log -> temporal pooling -> estimator -> class

after F. Sygulla and D. Rixen, *Learning the Noise of Failure*, Sec. III. A `Profile` holds
all settings: NoisyTest's, the paper's, or ours for any rate (`LogBands`). A `Dataset` holds
annotated frames, a `Classifier` is trained on them and labels signals, `evaluate` measures frames,
and `assess` whole recordings. A `Stream` labels a signal sample by sample. `learn_baseline` takes
good runs alone, and so does `adapt`, which adapts a general model to a robot.

This package needs no robot: its input is a signal and its rate. It needs NumPy, and scikit-learn
only to train.
"""

from models.choice import Model, load, nearest
from models.classifier import Classifier
from models.confusion import Evaluation
from models.dataset import Dataset
from models.errors import (
    AnnotationError,
    DataFileError,
    DatasetError,
    FileError,
    MissingSignalError,
    ModelFileError,
    ModelsError,
    NoFrameError,
    OutputError,
    ProfileError,
    RateError,
    RecordingError,
    SeenError,
    SignalError,
    UnknownLabelError,
)
from models.evaluation.assessment import Assessment, assess
from models.evaluation.framescore import evaluate
from models.evaluation.predictions import Unanswered
from models.examples import Examples
from models.features import features
from models.framing import frame
from models.general import Frames, General, frames_of
from models.labels import ANOMALY, UNKNOWN, Event, Labels
from models.logbands import ANY, EACH, GENERAL, SCALAR, LogBands
from models.logfile import nominal_rate, read_log
from models.novelty.adaptation import adapt
from models.novelty.frames import GoodMotion
from models.novelty.limit import Limit
from models.novelty.training import Learnt, learn_baseline
from models.profile import CLASSES, Profile
from models.recording import Block, Fault, Recording
from models.signals import NOISE, Signals
from models.splitting import check_apart, folds, group_of, held_out, leave_one_out
from models.stream import Stream

__all__ = [
    "ANOMALY",
    "ANY",
    "CLASSES",
    "EACH",
    "GENERAL",
    "NOISE",
    "SCALAR",
    "UNKNOWN",
    "AnnotationError",
    "Assessment",
    "Block",
    "Classifier",
    "DataFileError",
    "Dataset",
    "DatasetError",
    "Evaluation",
    "Event",
    "Examples",
    "Fault",
    "FileError",
    "Frames",
    "General",
    "GoodMotion",
    "Labels",
    "Learnt",
    "Limit",
    "LogBands",
    "MissingSignalError",
    "Model",
    "ModelFileError",
    "ModelsError",
    "NoFrameError",
    "OutputError",
    "Profile",
    "ProfileError",
    "RateError",
    "Recording",
    "RecordingError",
    "SeenError",
    "SignalError",
    "Signals",
    "Stream",
    "Unanswered",
    "UnknownLabelError",
    "adapt",
    "assess",
    "check_apart",
    "evaluate",
    "features",
    "folds",
    "frame",
    "frames_of",
    "group_of",
    "held_out",
    "learn_baseline",
    "leave_one_out",
    "load",
    "nearest",
    "noisytest",
    "nominal_rate",
    "read_log",
]


def __dir__() -> list[str]:
    """The public names."""
    return [*__all__]
