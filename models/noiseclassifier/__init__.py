"""Classification of a robot's noise: from a signal to labels.

    frames -> STFT -> bands -> log -> temporal pooling -> estimator -> class

after F. Sygulla and D. Rixen, *Learning the Noise of Failure*, Sec. III. A `Profile` holds
all settings: NoisyTest's, the paper's, or ours for any rate (`LogBands`). A `Dataset` holds
annotated frames by their features, a `Classifier` is trained on them and labels signals, and
`assess` measures it on whole recordings. A `Stream` labels a signal sample by sample.

This package needs no robot: its input is a signal and its rate. It needs NumPy, and scikit-learn
only to train.
"""

from noiseclassifier.assessment import Assessment, assess
from noiseclassifier.bursts import Bursts
from noiseclassifier.classifier import (
    Classifier,
    General,
    Model,
    Stream,
    frames_of,
    load,
    nearest,
)
from noiseclassifier.dataset import Dataset
from noiseclassifier.errors import (
    AnnotationError,
    DatasetError,
    FileError,
    MissingSignalError,
    ModelsError,
    NoFrameError,
    OutputError,
    ProfileError,
    RateError,
    RecordingError,
    SignalError,
)
from noiseclassifier.features import features, frame
from noiseclassifier.labels import UNKNOWN, Event, Labels
from noiseclassifier.lasting import Lasting, merged
from noiseclassifier.matching import Unanswered, match
from noiseclassifier.measures import Evaluation
from noiseclassifier.noisytest import nominal_rate, read_log
from noiseclassifier.profile import ANY, CLASSES, LogBands, Profile
from noiseclassifier.recording import (
    Block,
    Fault,
    Recording,
    check_apart,
    folds,
    group_of,
    held_out,
)
from noiseclassifier.signals import NOISE, Signals

__all__ = [
    "ANY",
    "CLASSES",
    "NOISE",
    "UNKNOWN",
    "AnnotationError",
    "Assessment",
    "Block",
    "Bursts",
    "Classifier",
    "Dataset",
    "DatasetError",
    "Evaluation",
    "Event",
    "Fault",
    "FileError",
    "General",
    "Labels",
    "Lasting",
    "LogBands",
    "MissingSignalError",
    "Model",
    "ModelsError",
    "NoFrameError",
    "OutputError",
    "Profile",
    "ProfileError",
    "RateError",
    "Recording",
    "RecordingError",
    "SignalError",
    "Signals",
    "Stream",
    "Unanswered",
    "assess",
    "check_apart",
    "features",
    "folds",
    "frame",
    "frames_of",
    "group_of",
    "held_out",
    "load",
    "match",
    "merged",
    "nearest",
    "noisytest",
    "nominal_rate",
    "read_log",
]
