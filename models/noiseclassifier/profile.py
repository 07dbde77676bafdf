"""Profiles: every setting of frames, features and estimator, for one rate or for any.

A `Profile` is in samples and of one rate: NoisyTest's, the paper's, or the profile that a recipe in
seconds and hertz (`LogBands`) has at that rate. Each has other bands, and by these a name and a way
of cutting frames (`noiseclassifier.dataset`).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import cached_property, lru_cache
from itertools import chain, pairwise
from math import ceil, isfinite
from typing import Any, Literal, Self, TypeAlias, get_args

import numpy as np

from noiseclassifier.errors import ProfileError
from noiseclassifier.signals import BY_JOINT, EFFORT, JOINTS, MOTION, NOISE, Index

# NoisyTest's classes, in its order; `ok` is the first of every model.
CLASSES = ("ok", "impact", "highaccelerations", "oscillations")
MOST_LEAVES = 16  # leaves that a tree may have: a bit for each
TOLERANCE = 1e-3  # two sample rates are the same if they differ by less than this share
# Two nominal rates, such as from jittering timestamps, are the same up to this share; what is
# computed of the spectrum is off by as much.
NOMINAL = 0.02
# Statistics over a frame of each log-band energy. Beside a reference, the last one adds nothing on
# robots left out, and is not computed.
STATISTICS = ("mean", "maximum", "deviation")
RELATIVE = "relative"  # what the names of features begin with that are relative to a reference
Kernel: TypeAlias = Literal["linear", "rbf"]
EstimatorKind: TypeAlias = Literal["svm", "networks", "trees", "detector"]
Multiclass: TypeAlias = Literal["one-vs-one", "one-vs-rest"]

_CHOICES = {
    "bands": ("adjacent", "comb", "log"),
    "kernel": get_args(Kernel),
    "estimator": get_args(EstimatorKind),
    "multiclass": get_args(Multiclass),
}
_ABOVE_ZERO = (
    *("rate", "length", "hop", "window", "stride", "floor", "regularization", "gamma"),
    *("rounds", "alarm"),
)
_ZERO_OR_MORE = ("least_deviation", "quick_window")


@dataclass(frozen=True)
class Resolution:
    """Window, stride and bands of a Fourier transform.

    Long windows resolve frequency, short ones resolve time.
    """

    window: int  # samples of the Hann window of one transform
    stride: int  # samples from one transform to the next
    edges: tuple[float, ...]  # of the bands, ascending, in [Hz]; none unless spaced by logarithms

    @property
    def bands(self) -> int:
        """Number of bands between the edges."""
        return len(self.edges) - 1

    def transforms(self, length: int) -> int:
        """Number of transforms of so many samples."""
        return 1 + (length - self.window) // self.stride


@dataclass(frozen=True, kw_only=True)
class Profile:
    """Settings of frames, features and estimator; defaults are the paper's.

    Raises:
        ProfileError: If a setting is out of its range, or two do not fit together.
    """

    classes: tuple[str, ...] = CLASSES  #: names of the classes, `ok` first
    #: Input signals, all in [rad/s]: noise estimates, norms of velocities, and after those the ones
    #: joint by joint (`signals.JOINTS`), of which the loudest joint counts.
    signals: tuple[str, ...] = ("noise",)
    rate: float = 10_000.0  #: sample rate of the signal, in [Hz]
    length: int = 4000  #: samples of a frame
    hop: int = 1000  #: samples from the start of one frame to the start of the next
    window: int = 1024  #: samples of the Hann window of one Fourier transform
    stride: int = 834  #: samples from one Fourier transform to the next (the paper's s_fft)
    #: How bins become bands: three adjacent ones as in the paper, NoisyTest's comb, or ``edges``.
    #: NoisyTest's profile also rounds times, samples and features to 32-bit floats, and loses the
    #: first sample of a recording (its reader takes that row for the header).
    bands: Literal["adjacent", "comb", "log"] = "adjacent"
    edges: tuple[float, ...] = ()  #: edges of the bands of ``log``, ascending, in [Hz]
    quick_window: int = 0  #: samples of a second, shorter Hann window beside the first; 0 for none
    quick_stride: int = 0  #: samples from one of its transforms to the next
    quick_edges: tuple[float, ...] = ()  #: edges of its bands, ascending, in [Hz]
    #: Whether log-band energies are relative to the level of the frame, and differences from the
    #: signal before are features, too; of models of earlier versions.
    relative: bool = False
    #: Whether log-band energies and their differences from the signal before are features as they
    #: are, and once more relative to a reference (`features.RunningReference`).
    reference: bool = False
    floor: float = 1e-6  #: added to an amplitude before its logarithm
    #: Least standard deviation by which features are standardised; 0 leaves them as they are.
    least_deviation: float = 0.0
    #: Support vector machines, or trees that first tell failures from `ok` and then name them
    #: (``detector``); networks and other trees are of model files of earlier versions.
    estimator: EstimatorKind = "svm"
    kernel: Kernel = "rbf"  #: kernel of the support vector machine
    regularization: float = 1.1  #: C of the support vector machine
    gamma: float = 5.7e-4  #: kernel parameter; the linear kernel has none
    multiclass: Multiclass = "one-vs-rest"  #: how two-class SVMs are combined for more classes
    rounds: int = 100  #: rounds of boosting; each adds a tree for each class
    leaves: int = 16  #: leaves of a tree at most
    alarm: float = 0.5  #: alarm threshold: a probability of any failure

    def __post_init__(self) -> None:
        """Check every setting once."""
        for field in fields(self):
            value, kind = getattr(self, field.name), field.type
            if choices := _CHOICES.get(field.name):
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
        for fits, problem in chain(_rules(self), _rules_of_signals(self)):
            if not fits:
                raise ProfileError(problem)

    @classmethod
    def noisytest(cls, kernel: Kernel = "rbf") -> Self:
        """NoisyTest 0.0.1, decision by decision, with its quirks."""
        return replace(cls.paper(kernel), bands="comb", multiclass="one-vs-one")

    @classmethod
    def paper(cls, kernel: Kernel = "rbf") -> Self:
        """The text of the paper, Sec. III and its table of hyper-parameters."""
        if kernel == "linear":
            return cls(kernel=kernel, stride=401, regularization=1.0)
        return cls(kernel=kernel)

    @classmethod
    def of(cls, settings: Mapping[str, Any]) -> Self:
        """Profile with the settings that `as_dict` gave.

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
        return sum(name not in BY_JOINT for name in self.signals)

    @property
    def name(self) -> str:
        """Name of the recipe."""
        return {"comb": "noisytest", "adjacent": "paper", "log": "logbands"}[self.bands]

    @cached_property
    def moving(self) -> int:
        """Number of velocities among the signals that go joint by joint."""
        return sum(name in JOINTS for name in self.signals)

    @property
    def differences(self) -> bool:
        """Whether differences of a signal from the one before are features."""
        return self.relative or self.reference

    @property
    def statistics(self) -> tuple[str, ...]:
        """Statistics of each log-band energy."""
        return STATISTICS[: len(STATISTICS) - self.reference]

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


def spectra(profile: Profile) -> tuple[str, ...]:
    """Names of the spectra of a window, in the order of `features.log_band_energies`."""
    norms, joints = profile.signals[: profile.norms], profile.signals[profile.norms :]
    if not profile.differences:
        return norms
    moving = joints[: profile.moving]
    return (
        *norms,
        *(f"{late} less {early}" for early, late in pairwise(norms)),
        *joints,
        *(f"{late} less {early}" for early, late in pairwise(moving)),
        *(f"{name} less mean" for name in joints * profile.relative),
    )


@lru_cache
def columns(profile: Profile) -> tuple[str, ...]:
    """Names of the features of log bands, in order, the same at any rate.

    They tell the spectrum, the kind of window, the statistic and the lower edge of the band, in
    [Hz]. The last one of a relative profile is the level of the frame.
    """
    plain = [
        f"{spectrum} {kind} {statistic} {edge:.4g}"
        for kind, resolution in zip(("long", "short"), profile.resolutions, strict=False)
        for spectrum in spectra(profile)
        for statistic in profile.statistics
        for edge in resolution.edges[:-1]
    ]
    if profile.reference:
        return (*plain, *(f"{RELATIVE} {name}" for name in plain))
    return (*plain, *["level"] * profile.relative)


def _rules(profile: Profile) -> Iterator[tuple[bool, str]]:
    """Whether settings fit, and what is wrong if not; each rule relies on the ones before."""
    for name in (*_ABOVE_ZERO, *_ZERO_OR_MORE):
        value, least = getattr(profile, name), "more than 0" if name in _ABOVE_ZERO else "0 or more"
        yield (
            value > 0 or (value == 0 and name in _ZERO_OR_MORE),
            f"{name} is {value!r}, expected {least}",
        )
    yield (
        2 <= profile.leaves <= MOST_LEAVES,
        f"leaves is {profile.leaves!r}, expected 2 to {MOST_LEAVES}",
    )
    yield profile.alarm < 1, f"alarm is {profile.alarm!r}, expected a probability below 1"
    yield (
        not profile.quick_window or (profile.bands == "log" and profile.quick_stride > 0),
        f"quick_window is {profile.quick_window} with quick_stride {profile.quick_stride} and"
        f" bands {profile.bands!r}, expected a stride of more than 0 and 'log'",
    )
    longest = max(each.window for each in profile.resolutions)
    yield (
        longest <= profile.length,
        f"window of {longest} samples is longer than a frame of {profile.length}",
    )


def _rules_of_signals(profile: Profile) -> Iterator[tuple[bool, str]]:
    names, norms, log = profile.signals, profile.norms, profile.bands == "log"
    signals = f"signals are {', '.join(names) or 'none'}"
    yield (
        norms > 0 and len(names) == len(set(names)) and not set(names[:norms]) & set(BY_JOINT),
        f"{signals}, expected norms, and after them those that go joint by joint, each once",
    )
    yield (
        (norms == len(names) or (log and profile.differences))
        and (EFFORT not in names or (names[-1] == EFFORT and profile.reference))
        and (not profile.reference or (log and not profile.relative)),
        f"{signals} with bands {profile.bands!r}, relative {profile.relative} and reference"
        f" {profile.reference}: joint by joint takes 'log' and one of both, {EFFORT} at the end a"
        " reference, and a reference 'log' and relative False",
    )
    classes = profile.classes
    yield (
        1 < len(classes) == len(set(classes)) and classes[0] == "ok",
        f"classes are {', '.join(classes) or 'none'}, expected 'ok' and others, each once",
    )
    yield (
        log or profile.bins % 3 == 0,
        f"window of {profile.window} samples has {profile.bins} bins, expected a multiple of three"
        " (256, 1024, 4096)",
    )
    for edges in (each.edges for each in profile.resolutions * log):
        ascending = len(edges) > 1 and all(low < high for low, high in pairwise(edges))
        yield (
            ascending and edges[0] >= 0 and edges[-1] <= profile.rate / 2,
            f"edges are {edges}, expected two or more, ascending, from 0 to half the rate,"
            f" {profile.rate / 2:g} Hz",
        )


# --- for any rate

# Rates that a general model takes, in [Hz]; faster logs are decimated.
LOWEST, HIGHEST = 80.0, 10_000.0
# Signals that a general model takes: the first of these that a log has.
INPUTS = (
    (*MOTION, *JOINTS, EFFORT),
    (*MOTION, *JOINTS),
    MOTION,
    ("measured", "measured_joints", EFFORT),
    ("measured", "measured_joints"),
    ("measured",),
    (NOISE,),
)
# Bins of a Hann window that the mean leaks into: up to here, a quick band is the speed itself.
SPEED = 1.5
WIDE = 2.0 ** (4 / 3)  # from the lower to the upper edge of a quick window's other bands
FEWEST = 2  # fewest bands that a profile has


@dataclass(frozen=True, kw_only=True)
class LogBands:
    """Recipe: energies of log-spaced bands, pooled over time and standardised, at any rate.

    Band edges do not depend on the sample rate; bands that reach beyond half the rate drop out.
    """

    #: As in `Profile`:
    classes: tuple[str, ...] = CLASSES
    signals: tuple[str, ...] = (NOISE,)
    reference: bool = False
    estimator: EstimatorKind = "svm"
    alarm: float = 0.5
    rounds: int = 100
    leaves: int = 16
    regularization: float = 10.0
    least_deviation: float = 0.5
    #: Added to the amplitude of a band, in [rad/s]: about the noise of the best encoders.
    floor: float = 3e-5
    #: In seconds and hertz:
    frame: float = 0.4  #: duration of a frame, in [s]
    hop: float = 0.1  #: time from the start of one frame to the start of the next, in [s]
    window: float = 0.1  #: duration of the window of one Fourier transform, in [s]
    stride: float = 0.025  #: time from one Fourier transform to the next, in [s]
    #: Lower edge of the first band: below, the mean leaks through a Hann window, in [Hz].
    lowest: float = 15.0
    highest: float = 5000.0  #: no band reaches beyond, in [Hz]
    #: Bands in an octave, where they are wider than what the window resolves.
    per_octave: float = 4.0
    #: Duration of a second, shorter window, in [s]; 0 for none. Its bands are few and wide: it
    #: resolves time rather than frequency.
    quick: float = 0.0
    quick_stride: float = 0.01  #: time from one of its transforms to the next, in [s]
    speed: bool = False  #: whether the first quick band, below all others, is the speed itself
    #: Kernel parameter times the number of features: below 1, frames out of distribution still get
    #: the class of the nearest training frames.
    softness: float = 0.5

    def at(self, rate: float, signals: Sequence[str] = ()) -> Profile:
        """Profile for a sample rate, in [Hz], durations rounded to the nearest sample, windows up.

        Args:
            signals: Those to take, in place of the recipe's.

        Raises:
            ProfileError: If fewer than ``FEWEST`` bands lie below half the rate.
        """
        nyquist = rate / 2
        highest, edges, quick = min(self.highest, nyquist), [self.lowest], []
        # A band is as wide as the window resolves, or wider.
        ratio: float = 2.0 ** (1.0 / self.per_octave)
        while len(edges) <= FEWEST or edges[-1] <= highest:
            edges.append(max(edges[-1] + 1.0 / self.window, edges[-1] * ratio))
        least = edges[FEWEST]
        edges = edges[:1] + [edge for edge in edges[1:] if edge <= highest]
        if self.quick and nyquist * self.quick >= SPEED:  # else its first band does not fit
            quick = [0.0, SPEED / self.quick] if self.speed else [SPEED / self.quick]
            while (upper := quick[-1] * WIDE) <= highest:
                quick.append(upper)
        if len(quick) < 2:  # no band fits
            quick = []
        if len(edges) <= FEWEST:
            raise ProfileError(
                f"a rate of {rate:g} Hz leaves {len(edges) - 1} bands up to {nyquist:g} Hz,"
                f" expected {FEWEST} or more: take a rate of {ceil(2 * least)} Hz at least"
            )
        shared = {field.name for field in fields(Profile)} & {field.name for field in fields(self)}
        shared -= {
            "signals",
            "hop",
            "window",
            "stride",
            "quick_stride",
        }  # in samples there, in seconds here
        return Profile(
            **{name: getattr(self, name) for name in shared},
            signals=tuple(signals) or self.signals,
            rate=rate,
            length=round(self.frame * rate),
            hop=round(self.hop * rate),
            # A window that is shorter by a fraction lets the speed leak into the first band.
            window=ceil(self.window * rate - 1e-6),
            stride=round(self.stride * rate),
            bands="log",
            edges=tuple(edges),
            quick_window=round(self.quick * rate) if quick else 0,
            quick_stride=round(self.quick_stride * rate) if quick else 0,
            quick_edges=tuple(quick),
            kernel="rbf",
            # Two frames' n standardised features differ by 2 n in squares, whatever the rate.
            gamma=self.softness / (len(STATISTICS) * (len(edges) - 1)),
            multiclass="one-vs-one",
        )

    @classmethod
    def of(cls, settings: Mapping[str, Any]) -> Self:
        """Recipe with the settings of a model file.

        Raises:
            ProfileError: If a field is missing, unknown or wrong.
        """
        names = {field.name for field in fields(cls)}
        if not isinstance(settings, Mapping) or names != settings.keys():
            raise ProfileError(f"a recipe has {', '.join(sorted(names))}, and nothing else")
        for field in fields(cls):
            value = settings[field.name]
            # Bands of no width, or from minus infinity, would be without end.
            if field.type is float and not (type(value) in (int, float) and 0 <= value <= HIGHEST):
                raise ProfileError(
                    f"{field.name} is {value!r}, expected a number from 0 to {HIGHEST:g}"
                )
        lists = {key: tuple(each) for key, each in settings.items() if isinstance(each, list)}
        try:
            recipe = cls(**{**settings, **lists})
            for rate in (LOWEST, HIGHEST):
                recipe.at(rate, INPUTS[0])
        except (TypeError, ValueError, ArithmeticError) as error:
            raise ProfileError(f"a setting of the recipe is wrong ({error})") from error
        return recipe

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """Names of all features of a general model, of all inputs at the highest rate."""
        every = (columns(self.at(HIGHEST, names)) for names in INPUTS)
        return tuple(dict.fromkeys(name for names in every for name in names))

    def places(self, profile: Profile) -> Index:
        """Indices among all features of those that a profile has, ascending, shape (features,)."""
        number = {name: place for place, name in enumerate(self.columns)}
        return np.array([number[name] for name in columns(profile)])

    @cached_property
    def rising(self) -> Index:
        """1 for each feature that rises with the level of a fault, else 0, shape (features,).

        These are the energies of what is measured and of its error, but for the speed itself.
        """
        plain = [name.removeprefix(f"{RELATIVE} ") for name in self.columns]
        fixed = ("desired", "error less", "error_joints less")
        return np.array(
            [not name.startswith(fixed) and not name.endswith(" 0") for name in plain],
            dtype=np.intp,
        )


# For any rate and whatever signals there are; features relative to a reference beside.
ANY = LogBands(
    reference=True,
    floor=1e-3,
    estimator="detector",
    quick=0.02,
    speed=True,
    rounds=300,
    leaves=16,
    alarm=0.77,
)
