"""Our own profiles, in seconds and hertz, for any sample rate."""

from dataclasses import dataclass, replace

from models.errors import ProfileError
from models.pooling import POOLED
from models.profile import CLASSES, EstimatorKind, Profile
from models.signals import JOINTS, MOTION, NOISE

SPEED = 1.5
"""Bins of a Hann window that the mean leaks into: up to here, a quick band is the speed itself."""
WIDE = 2.0 ** (4 / 3)
"""From the lower to the upper edge of a quick window's other bands."""


@dataclass(frozen=True, kw_only=True)
class LogBands:
    """Levels of log-spaced bands, pooled over time and standardised.

    Band edges do not depend on the sample rate; bands that reach beyond half the rate drop out.
    """

    classes: tuple[str, ...] = CLASSES
    """What a frame can be called, `ok` first."""
    signals: tuple[str, ...] = (NOISE,)
    """What is listened to."""
    relative: bool = False
    """Whether levels are told from the whole frame's, and from those of the signal before."""
    estimator: EstimatorKind = "svm"
    """What decides."""
    alarm: float = 0.5
    """Probability of any failure from which a frame is sure enough of it to raise an alarm."""
    frame: float = 0.4
    """Duration of a frame, in [s]."""
    hop: float = 0.1
    """Time from the start of one frame to the start of the next, in [s]."""
    window: float = 0.1
    """Duration of the window of one Fourier transform, in [s]."""
    stride: float = 0.025
    """Time from one Fourier transform to the next, in [s]."""
    lowest: float = 15.0
    """Lower edge of the first band: below, a Hann window sees the mean, in [Hz]."""
    highest: float = 5000.0
    """No band reaches beyond, in [Hz]."""
    per_octave: float = 4.0
    """Bands in an octave, where they are wider than what the window resolves."""
    quick: float = 0.0
    """Duration of a second, shorter window beside the first, in [s]; 0 for none. Its bands are few
    and wide, since they tell when rather than what."""
    quick_stride: float = 0.01
    """Time from one of its transforms to the next, in [s]."""
    speed: bool = False
    """Whether the speed itself is a quick band, too: the first one, below all others."""
    floor: float = 3e-5
    """Added to a band's amplitude: what is quieter than the best encoders is all the same."""
    regularization: float = 10.0
    """The machine's C."""
    softness: float = 0.5
    """Kernel parameter times the number of features: below 1, frames unlike any known still
    fall on the side of those that they resemble most."""
    least_deviation: float = 0.5
    """Deviation of a level that is chance: what changes less is not scaled up, in [Np]."""

    def at(self, rate: float) -> Profile:
        """Make the profile for a sample rate, each duration rounded to the nearest sample.

        Args:
            rate: Sample rate of the signal, in [Hz].

        Returns:
            The profile: at 1 kHz a frame is 400 samples, every 100.

        Raises:
            ProfileError: If fewer than three bands lie below half the rate.
        """
        edges = self._edges(rate / 2)
        if len(edges) < 4:
            raise ProfileError(
                f"a rate of {rate:g} Hz leaves {max(len(edges) - 1, 0)} bands up to"
                f" {rate / 2:g} Hz, expected three or more: take a rate of 100 Hz at least"
            )
        quick = self._quick_edges(rate / 2)
        return Profile(
            name="logbands",
            classes=self.classes,
            signals=self.signals,
            rate=rate,
            length=round(self.frame * rate),
            hop=round(self.hop * rate),
            window=round(self.window * rate),
            stride=round(self.stride * rate),
            bands="log",
            edges=edges,
            quick_window=round(self.quick * rate) if quick else 0,
            quick_stride=round(self.quick_stride * rate) if quick else 0,
            quick_edges=quick,
            relative=self.relative,
            floor=self.floor,
            least_deviation=self.least_deviation,
            estimator=self.estimator,
            alarm=self.alarm,
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

    def _edges(self, nyquist: float) -> tuple[float, ...]:
        """List the edges up to half the rate, each band as wide as the window resolves or wider."""
        edges, ratio, resolution = [self.lowest], 2.0 ** (1.0 / self.per_octave), 1.0 / self.window
        while (upper := max(edges[-1] + resolution, edges[-1] * ratio)) <= min(
            self.highest, nyquist
        ):
            edges.append(upper)
        return tuple(edges)

    def _quick_edges(self, nyquist: float) -> tuple[float, ...]:
        """List the edges of the quick window's bands, none if not even the first one fits."""
        if not self.quick or nyquist * self.quick < SPEED:
            return ()
        edges = [0.0, SPEED / self.quick] if self.speed else [SPEED / self.quick]
        while (upper := edges[-1] * WIDE) <= min(self.highest, nyquist):
            edges.append(upper)
        return tuple(edges) if len(edges) > 1 else ()


SCALAR = LogBands(relative=True, floor=1e-3, estimator="networks", alarm=0.85, quick=0.02)
"""For the noise alone. Failures are louder than 0.03 rad/s; what lies far below is the business of
encoders, and differs from robot to robot and from simulator to simulator."""
GENERAL = replace(SCALAR, signals=MOTION, estimator="trees", alarm=0.7, speed=True)
"""For runs with measured and desired motion; good motion startles it less. The noise alone cannot
tell a fast motion without sensor noise from a failure by its speed. Trees find more of what is like
what they have learnt from; networks, of what is not: of a rattle on a motion without any other
noise, say, which the noise alone cannot tell by its error."""

EACH = replace(GENERAL, signals=(*MOTION, *JOINTS), alarm=0.75)
"""For runs that name their joints: what a single one does drowns in the norm of all."""
