"""Our own profiles, in seconds and hertz, for any sample rate."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from math import ceil
from typing import Any, Self

import numpy as np

from noiseclassifier.errors import ProfileError
from noiseclassifier.pooling import POOLED, RELATIVE, columns
from noiseclassifier.profile import CLASSES, EstimatorKind, Profile
from noiseclassifier.signals import EFFORT, JOINTS, MOTION, NOISE
from noiseclassifier.types import Index

LOWEST, HIGHEST = 80.0, 10_000.0
"""Rates that a general model takes, in [Hz]; faster logs are decimated."""
INPUTS = (
    (*MOTION, *JOINTS, EFFORT),
    (*MOTION, *JOINTS),
    MOTION,
    ("measured", "measured_joints", EFFORT),
    ("measured", "measured_joints"),
    ("measured",),
    (NOISE,),
)
"""Signals that a general model takes: the first of these that a log has."""

SPEED = 1.5
"""Bins of a Hann window that the mean leaks into: up to here, a quick band is the speed itself."""
WIDE = 2.0 ** (4 / 3)
"""From the lower to the upper edge of a quick window's other bands."""


FEWEST = 2
"""Fewest bands that a profile has."""


@dataclass(frozen=True, kw_only=True)
class LogBands:
    """Energies of log-spaced bands, pooled over time and standardised.

    Band edges do not depend on the sample rate; bands that reach beyond half the rate drop out.
    """

    classes: tuple[str, ...] = CLASSES
    """Names of the classes, `ok` first."""
    signals: tuple[str, ...] = (NOISE,)
    """Input signals."""
    relative: bool = False
    """Whether energies are relative to the level of the frame, and to the signal before."""
    reference: bool = False
    """Whether features are taken relative to a reference, too (`noiseclassifier.reference`)."""
    estimator: EstimatorKind = "svm"
    """Name of the estimator."""
    alarm: float = 0.5
    """Alarm threshold: a probability of any failure."""
    rounds: int = 100
    """Rounds of boosting of trees."""
    leaves: int = 16
    """Leaves of a tree at most."""
    frame: float = 0.4
    """Duration of a frame, in [s]."""
    hop: float = 0.1
    """Time from the start of one frame to the start of the next, in [s]."""
    window: float = 0.1
    """Duration of the window of one Fourier transform, in [s]."""
    stride: float = 0.025
    """Time from one Fourier transform to the next, in [s]."""
    lowest: float = 15.0
    """Lower edge of the first band: below, the mean leaks through a Hann window, in [Hz]."""
    highest: float = 5000.0
    """No band reaches beyond, in [Hz]."""
    per_octave: float = 4.0
    """Bands in an octave, where they are wider than what the window resolves."""
    quick: float = 0.0
    """Duration of a second, shorter window, in [s]; 0 for none. Its bands are few and wide: it
    resolves time rather than frequency."""
    quick_stride: float = 0.01
    """Time from one of its transforms to the next, in [s]."""
    speed: bool = False
    """Whether the first quick band, below all others, is the speed itself."""
    floor: float = 3e-5
    """Added to the amplitude of a band, in [rad/s]: about the noise of the best encoders."""
    regularization: float = 10.0
    """C of the support vector machine."""
    softness: float = 0.5
    """Kernel parameter times the number of features: below 1, frames out of distribution still get
    the class of the nearest training frames."""
    least_deviation: float = 0.5
    """Least standard deviation of a feature in the standardisation, in [Np]."""

    def at(self, rate: float) -> Profile:
        """Profile for a sample rate, each duration rounded to the nearest sample, windows up.

        Args:
            rate: Sample rate of the signal, in [Hz].

        Returns:
            The profile: at 1 kHz a frame is 400 samples, every 100.

        Raises:
            ProfileError: If fewer than ``FEWEST`` bands lie below half the rate.
        """
        edges = self._edges(rate / 2)
        if len(edges) <= FEWEST:
            least = self.lowest
            for _ in range(FEWEST):
                least = self._upper(least)
            raise ProfileError(
                f"a rate of {rate:g} Hz leaves {len(edges) - 1} bands up to {rate / 2:g} Hz,"
                f" expected {FEWEST} or more: take a rate of {ceil(2 * least)} Hz at least"
            )
        quick = self._quick_edges(rate / 2)
        return Profile(
            name="logbands",
            classes=self.classes,
            signals=self.signals,
            rate=rate,
            length=round(self.frame * rate),
            hop=round(self.hop * rate),
            # A window that is shorter by a fraction lets the speed leak into the first band.
            window=ceil(self.window * rate - 1e-6),
            stride=round(self.stride * rate),
            bands="log",
            edges=edges,
            quick_window=round(self.quick * rate) if quick else 0,
            quick_stride=round(self.quick_stride * rate) if quick else 0,
            quick_edges=quick,
            relative=self.relative,
            reference=self.reference,
            floor=self.floor,
            least_deviation=self.least_deviation,
            estimator=self.estimator,
            alarm=self.alarm,
            rounds=self.rounds,
            leaves=self.leaves,
            kernel="rbf",
            regularization=self.regularization,
            # Two frames' n standardised features differ by 2 n in squares, whatever the rate.
            gamma=self.softness / (POOLED * (len(edges) - 1)),
            multiclass="one-vs-one",
            # Padding would make a train of impacts of one; frames to classify have none.
            pad_short=False,
            spread_failures=True,
            flush_end=True,
        )

    @classmethod
    def of(cls, settings: Mapping[str, Any]) -> Self:
        """Recipe with the settings of a model file.

        Args:
            settings: A value for each field.

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
                recipe.bound(rate)
        except (TypeError, ValueError, ArithmeticError) as error:
            raise ProfileError(f"a setting of the recipe is wrong ({error})") from error
        return recipe

    def bound(self, rate: float, signals: Sequence[str] = INPUTS[0]) -> Profile:
        """Profile for a sample rate and signals."""
        return replace(self, signals=tuple(signals)).at(rate)

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """Names of all features of a general model, of all inputs at the highest rate."""
        every = (columns(self.bound(HIGHEST, names)) for names in INPUTS)
        return tuple(dict.fromkeys(name for names in every for name in names))

    @cached_property
    def without_unit(self) -> Index:
        """Indices of the features as they are of efforts, whose unit is not known."""
        return np.array([n for n, name in enumerate(self.columns) if name.startswith(EFFORT)])

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

    def places(self, profile: Profile) -> Index:
        """Indices among all features of those that a profile has, ascending, shape (features,)."""
        number = {name: place for place, name in enumerate(self.columns)}
        return np.array([number[name] for name in columns(profile)])

    def _edges(self, nyquist: float) -> tuple[float, ...]:
        """Edges up to the Nyquist frequency, each band as wide as the window resolves or wider."""
        edges = [self.lowest]
        while (upper := self._upper(edges[-1])) <= min(self.highest, nyquist):
            edges.append(upper)
        return tuple(edges)

    def _upper(self, edge: float) -> float:
        """Upper edge of the band from an edge on."""
        ratio: float = 2.0 ** (1.0 / self.per_octave)
        return max(edge + 1.0 / self.window, edge * ratio)

    def _quick_edges(self, nyquist: float) -> tuple[float, ...]:
        """Edges of the bands of the quick window, none if not even the first one fits."""
        if not self.quick or nyquist * self.quick < SPEED:
            return ()
        edges = [0.0, SPEED / self.quick] if self.speed else [SPEED / self.quick]
        while (upper := edges[-1] * WIDE) <= min(self.highest, nyquist):
            edges.append(upper)
        return tuple(edges) if len(edges) > 1 else ()


SCALAR = LogBands(relative=True, floor=1e-3, estimator="networks", alarm=0.5, quick=0.02)
"""For the noise alone. Failures are louder than 0.03 rad/s; amplitudes far below depend on encoders
and simulators."""
GENERAL = replace(SCALAR, signals=MOTION, estimator="trees", alarm=0.6, leaves=4, speed=True)
"""For runs with measured and desired motion; with fewer false positives in good motion. The noise
alone does not separate a fast motion without sensor noise from a failure. Trees find more failures
that resemble the training set; networks more that do not, say a rattle on a motion without any
other noise, which the noise alone does not show as an error."""

ANY = LogBands(
    reference=True,
    floor=1e-3,
    estimator="detector",
    quick=0.02,
    speed=True,
    rounds=300,
    leaves=16,
    alarm=0.83,
)
"""For any rate and whatever signals there are; features relative to a reference beside."""

EACH = replace(GENERAL, signals=(*MOTION, *JOINTS), alarm=0.6, rounds=40)
"""For runs that name their joints: the norm of all masks a single one."""
