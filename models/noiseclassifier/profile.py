"""The profile: every setting of framing, features and estimator."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from functools import cached_property
from itertools import pairwise
from math import isfinite
from typing import Any, Literal, Self, TypeAlias, get_args

from noiseclassifier.errors import ProfileError
from noiseclassifier.signals import EFFORT, JOINTS, by_joint

CLASSES = ("ok", "impact", "highaccelerations", "oscillations")
"""NoisyTest's classes, in its order; `ok` is the first of every model."""

MOST_LEAVES = 16
"""Leaves that a tree may have: a bit for each."""

TOLERANCE = 1e-3
"""Two sample rates are the same if they differ by less than this share."""

NOMINAL = 0.02
"""Two nominal rates, such as those of jittering stamps, are the same up to this share; what is
computed of the spectrum is off by as much."""

Bands: TypeAlias = Literal["adjacent", "comb", "log"]
Kernel: TypeAlias = Literal["linear", "rbf"]
EstimatorKind: TypeAlias = Literal["svm", "networks", "trees", "detector"]
Multiclass: TypeAlias = Literal["one-vs-one", "one-vs-rest"]

_CHOICES = {"bands": Bands, "kernel": Kernel, "estimator": EstimatorKind, "multiclass": Multiclass}


_POSITIVE = (
    *("rate", "length", "hop", "window", "stride", "floor", "regularization", "gamma"),
    *("networks", "units", "epochs", "rounds", "learning_rate", "alarm"),
)


@dataclass(frozen=True)
class Resolution:
    """Window, stride and bands of a Fourier transform.

    Long windows resolve frequency, short ones resolve time.

    Attributes:
        window: Samples of the Hann window of one transform.
        stride: Samples from one transform to the next.
        edges: Edges of the bands, ascending, in [Hz]; none unless bands are spaced by logarithms.
    """

    window: int
    stride: int
    edges: tuple[float, ...]

    def transforms(self, length: int) -> int:
        """Number of transforms of so many samples."""
        return 1 + (length - self.window) // self.stride


@dataclass(frozen=True, kw_only=True)
class Profile:
    """Settings of framing, features and estimator; defaults are the paper's.

    Raises:
        ProfileError: If a setting is out of its range or two do not fit together.
    """

    name: str
    """Name of the recipe."""
    classes: tuple[str, ...] = CLASSES
    """Names of the classes, `ok` first."""
    signals: tuple[str, ...] = ("noise",)
    """Input signals, all in [rad/s]: noise estimates, norms of velocities, and after those the ones
    joint by joint (`signals.JOINTS`), of which the loudest joint counts."""
    rate: float = 10_000.0
    """Sample rate of the signal, in [Hz]."""
    length: int = 4000
    """Samples of a frame."""
    hop: int = 1000
    """Samples from the start of one frame to the start of the next."""
    window: int = 1024
    """Samples of the Hann window of one Fourier transform."""
    stride: int = 834
    """Samples from one Fourier transform to the next (the paper's s_fft)."""
    bands: Bands = "adjacent"
    """How bins become bands: three adjacent ones, NoisyTest's comb, or ``edges``."""
    edges: tuple[float, ...] = ()
    """Edges of the bands of ``log``, ascending, in [Hz]."""
    quick_window: int = 0
    """Samples of a second, shorter Hann window beside the first; 0 for none."""
    quick_stride: int = 0
    """Samples from one of its transforms to the next."""
    quick_edges: tuple[float, ...] = ()
    """Edges of its bands, ascending, in [Hz]."""
    relative: bool = False
    """Whether log-band energies are relative to the level of the frame, and differences from the
    signal before are features, too: then the shape of a spectrum counts, and how much of a noise is
    neither desired nor tracked."""
    reference: bool = False
    """Whether log-band energies and their differences from the signal before are features as they
    are, and once more relative to a reference (`noiseclassifier.reference`)."""
    floor: float = 1e-6
    """Added to an amplitude before its logarithm."""
    least_deviation: float = 0.0
    """Least standard deviation in the standardisation of features by the training set; 0 leaves
    them as they are."""
    estimator: EstimatorKind = "svm"
    """Support vector machines, small networks, boosted trees, trees that first tell failures from
    `ok` and then name them."""
    kernel: Kernel = "rbf"
    """Kernel of the support vector machine."""
    regularization: float = 1.1
    """C of the support vector machine."""
    gamma: float = 5.7e-4
    """Kernel parameter; the linear kernel has none."""
    multiclass: Multiclass = "one-vs-rest"
    """How two-class SVMs are combined for more classes."""
    networks: int = 5
    """Networks whose probabilities are averaged, each trained without one part of the groups."""
    units: int = 64
    """Units in the hidden layer of a network."""
    decay: float = 0.1
    """Penalty on the squares of a network's weights."""
    epochs: int = 30
    """Passes over the training set."""
    rounds: int = 100
    """Rounds of boosting; each adds a tree for each class."""
    leaves: int = 16
    """Leaves of a tree at most."""
    learning_rate: float = 0.15
    """Factor of the leaves of each tree."""
    penalty: float = 1.0
    """Penalty on the squares of the leaves."""
    alarm: float = 0.5
    """Alarm threshold: a probability of any failure."""
    pad_short: bool = True
    """Whether a training block shorter than a frame is padded, or else widened."""
    spread_failures: bool = False
    """Whether failures lie anywhere in training frames, rather than in their middle."""
    open_end: int = 1
    """Samples after the last one at which a block that lasts to the end stops."""
    flush_end: bool = False
    """Whether a last frame, flush with the end, covers the tail of a signal."""

    # What follows is NoisyTest's own, and off in every other profile.
    # (Its `open_end` is 0.1 s: no sample more, but a short block's middle lies elsewhere.)
    single_precision: bool = False
    """Times, samples and features are rounded to 32-bit floats."""
    drop_first_sample: bool = False
    """The first sample of a recording is lost (its reader takes that row for the header)."""
    cut_by_time: bool = False
    """A block holds each sample whose time is from its start to its stop, both included."""
    widen_extra: int = 0
    """Samples beyond one frame to which a short block of a validation set is widened."""
    pad_widened: bool = False
    """A block widened past an end of its recording is padded, where others are moved inside."""

    def __post_init__(self) -> None:
        """Check every setting once."""
        _check_types(self)
        _check_ranges(self)
        _check_signals(self)
        _check_bands(self)

    @classmethod
    def noisytest(cls, kernel: Kernel = "rbf") -> Self:
        """NoisyTest 0.0.1, decision by decision, with its quirks.

        Args:
            kernel: Kernel of the support vector machine; each has parameters of its own.
        """
        return cls(
            name="noisytest",
            bands="comb",
            multiclass="one-vs-one",
            single_precision=True,
            drop_first_sample=True,
            cut_by_time=True,
            open_end=1000,
            widen_extra=1,
            pad_widened=True,
            **_tuned(kernel),
        )

    @classmethod
    def paper(cls, kernel: Kernel = "rbf") -> Self:
        """The text of the paper, Sec. III and its table of hyper-parameters.

        Args:
            kernel: Kernel of the support vector machine; each has parameters of its own.
        """
        return cls(name="paper", **_tuned(kernel))

    @classmethod
    def of(cls, settings: Mapping[str, Any]) -> Self:
        """Profile with the settings that `as_dict` gave.

        Args:
            settings: A value for each field.

        Raises:
            ProfileError: If a field is missing, unknown or wrong.
        """
        names = {field.name for field in fields(cls)}
        if wrong := sorted(names ^ settings.keys()):
            state = "missing" if wrong[0] in names else "unknown"
            raise ProfileError(f"setting {wrong[0]!r} is {state}")
        lists = {key: tuple(each) for key, each in settings.items() if isinstance(each, list)}
        return cls(**{**settings, **lists})

    def as_dict(self) -> dict[str, Any]:
        """Value of each field, for JSON."""
        settings = asdict(self)
        return {k: list(v) if isinstance(v, tuple) else v for k, v in settings.items()}

    @cached_property
    def norms(self) -> int:
        """Number of signals that are norms."""
        return sum(not by_joint(name) for name in self.signals)

    @cached_property
    def moving(self) -> int:
        """Number of velocities among the signals that go joint by joint."""
        return sum(name in JOINTS for name in self.signals)

    @property
    def differences(self) -> bool:
        """Whether differences of a signal from the one before are features."""
        return self.relative or self.reference

    @property
    def bins(self) -> int:
        """Bins of one Fourier transform, from 0 Hz up to half the rate."""
        return self.window // 2 + 1

    @property
    def transforms(self) -> int:
        """Fourier transforms of one frame (the paper's n_t)."""
        return self.resolutions[0].transforms(self.length)

    @cached_property
    def resolutions(self) -> tuple[Resolution, ...]:
        """Resolutions of the Fourier transforms of a frame."""
        main = Resolution(self.window, self.stride, self.edges)
        quick = Resolution(self.quick_window, self.quick_stride, self.quick_edges)
        return (main, quick) if self.quick_window else (main,)

    @property
    def duration(self) -> float:
        """Duration of a frame, in [s]."""
        return self.length / self.rate


def _tuned(kernel: Kernel) -> dict[str, Any]:
    """Hyper-parameters of a kernel in the paper's table."""
    if kernel == "linear":
        return {"kernel": kernel, "stride": 401, "regularization": 1.0}
    return {"kernel": kernel, "stride": 834, "regularization": 1.1, "gamma": 5.7e-4}


def _check_types(profile: Profile) -> None:
    for field in fields(profile):
        value, kind = getattr(profile, field.name), field.type
        if field.name in _CHOICES:
            choices = get_args(_CHOICES[field.name])
            fits, wanted = value in choices, f"one of {', '.join(choices)}"
        elif kind is float:
            fits, wanted = type(value) in (int, float) and isfinite(value), "a finite number"
        elif kind in (int, bool, str):
            fits, wanted = type(value) is kind, f"a value of type {kind.__name__}"
        else:
            item = float if field.name.endswith("edges") else str
            fits = isinstance(value, tuple) and all(type(each) is item for each in value)
            wanted = f"a tuple of {item.__name__}"
        if not fits:
            raise ProfileError(f"{field.name} is {value!r}, expected {wanted}")


def _check_ranges(profile: Profile) -> None:
    for name in _POSITIVE:
        if getattr(profile, name) <= 0:
            raise ProfileError(f"{name} is {getattr(profile, name)!r}, expected more than 0")
    for name in ("open_end", "widen_extra", "least_deviation", "decay", "penalty", "quick_window"):
        if getattr(profile, name) < 0:
            raise ProfileError(f"{name} is {getattr(profile, name)!r}, expected 0 or more")
    if not 2 <= profile.leaves <= MOST_LEAVES:
        raise ProfileError(f"leaves is {profile.leaves!r}, expected 2 to {MOST_LEAVES}")
    if profile.alarm >= 1:
        raise ProfileError(f"alarm is {profile.alarm!r}, expected a probability below 1")
    if profile.quick_window and (profile.bands != "log" or profile.quick_stride <= 0):
        raise ProfileError(
            f"quick_window is {profile.quick_window} with quick_stride {profile.quick_stride} and"
            f" bands {profile.bands!r}, expected a stride of more than 0 and 'log'"
        )
    longest = max(each.window for each in profile.resolutions)
    if longest > profile.length:
        raise ProfileError(
            f"window of {longest} samples is longer than a frame of {profile.length}"
        )


def _check_signals(profile: Profile) -> None:
    if not profile.signals or len(set(profile.signals)) < len(profile.signals):
        raise ProfileError(
            f"signals are {', '.join(profile.signals) or 'none'}, expected one or more, each once"
        )
    if not profile.norms or any(map(by_joint, profile.signals[: profile.norms])):
        raise ProfileError(
            f"signals are {', '.join(profile.signals)}, expected norms, and after them those that"
            " go joint by joint"
        )
    if profile.norms < len(profile.signals) and not (
        profile.bands == "log" and profile.differences
    ):
        raise ProfileError(
            f"signals are {', '.join(profile.signals)}, with bands {profile.bands!r}, relative"
            f" {profile.relative} and reference {profile.reference}, expected 'log' and one of both"
            " for those that go joint by joint"
        )
    if EFFORT in profile.signals and (profile.signals[-1] != EFFORT or not profile.reference):
        raise ProfileError(
            f"signals are {', '.join(profile.signals)} with reference {profile.reference}, expected"
            f" {EFFORT} last, and True"
        )
    if profile.reference and (profile.bands != "log" or profile.relative):
        raise ProfileError(
            f"reference is True with bands {profile.bands!r} and relative {profile.relative},"
            " expected 'log' and False"
        )
    repeated = len(set(profile.classes)) < len(profile.classes)
    if repeated or len(profile.classes) < 2 or profile.classes[0] != "ok":
        raise ProfileError(
            f"classes are {', '.join(profile.classes) or 'none'},"
            " expected 'ok' and others, each once"
        )


def _check_bands(profile: Profile) -> None:
    if profile.bands == "log":
        for edges in (each.edges for each in profile.resolutions):
            if len(edges) < 2 or any(low >= high for low, high in pairwise(edges)):
                raise ProfileError(f"edges are {edges}, expected two or more, ascending")
            if edges[0] < 0 or edges[-1] > profile.rate / 2:
                raise ProfileError(
                    f"edges reach from {edges[0]:g} to {edges[-1]:g} Hz,"
                    f" expected 0 to half the rate, {profile.rate / 2:g} Hz"
                )
    elif profile.bins % 3:
        raise ProfileError(
            f"window of {profile.window} samples has {profile.bins} bins, expected a multiple"
            " of three (256, 1024, 4096)"
        )
