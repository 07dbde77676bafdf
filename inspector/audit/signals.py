"""What signals of a log tell about how they were made: rates, filters, steps, units, copies."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from inspector.logs.motion import LARGEST, NORMALISED, TURN, contradictions
from noiseclassifier import LogBands
from noisemodel import Run
from noisemodel.hold import FEWEST, hold_length
from noisemodel.noise import in_both
from noisemodel.run import ORDER, WINDOW, derived, stretches
from noisemodel.runfile import pieces
from noisemodel.types import Array, Mask, Real


def valid(run: Run, signal: Real) -> Real:
    """The samples of a signal of a run that lie in no gap; a view if there are no gaps."""
    return signal if run.mask.all() else signal[run.mask]


def ends(signal: Real) -> tuple[Real, Real]:
    """Least and largest value of each column."""
    rows = np.ascontiguousarray(np.asarray(signal).T)  # long rows are faster
    return rows.min(axis=1), rows.max(axis=1)


# Spectrum

SEGMENT = 0.4  # shortest that is transformed: the paper's frame (Sec. III-A), in [s]
FEWEST_SAMPLES = 128  # fewest samples of a segment, so that slow logs have a spectrum too
MOST = 256  # most segments that are averaged, evenly spread, which limits the cost of long logs
BATCH = 16  # segments that are transformed at once, which bounds the memory that they take
PER_OCTAVE = 4  # bands of a smoothed spectrum in an octave


@dataclass(frozen=True, eq=False)
class Spectrum:
    """A one-sided power spectral density, the sum of all joints, as the noise counts them."""

    frequency: Array  # above 0, rising, shape (frequency,), in [Hz]
    total: Array  # shape (frequency,), in [(rad/s)²/Hz]


def spectrum(velocity: Real, rate: float, valid: Mask) -> Spectrum | None:
    """Spectrum of velocities, (samples, joints), by Welch's method; None if gaps leave too few."""
    length = max(FEWEST_SAMPLES, round(SEGMENT * rate))
    every = stretches(valid, len(valid))
    starts = [at for each in every for at in range(each.start, each.stop - length + 1, length // 2)]
    if not starts:
        return None
    chosen = np.unique(np.linspace(0, len(starts) - 1, min(MOST, len(starts))).round().astype(int))
    window = np.hanning(length + 1)[:-1]
    ramp = np.linspace(-1.0, 1.0, length)
    signal = np.ascontiguousarray(velocity.T, dtype=np.float64)
    segments = sliding_window_view(signal, length, axis=1)
    power = np.zeros((len(signal), length // 2 + 1))
    for few in np.split(np.array(starts)[chosen], range(BATCH, len(chosen), BATCH)):
        some = segments[:, few]
        # Less its least-squares line, slow motion does not leak to higher frequencies.
        slope = some @ ramp / np.square(ramp).sum()
        some -= some.mean(axis=2)[..., None]
        some -= slope[..., None] * ramp
        some *= window
        waves = np.fft.rfft(some)
        power += (np.square(waves.real) + np.square(waves.imag)).sum(axis=1)
    # P. Welch, IEEE Trans. Audio Electroacoust. 15 (1967): one-sided, per hertz
    density: Array = 2.0 * power / (len(chosen) * rate * np.square(window).sum())
    frequency = np.arange(1.0, length // 2 + 1.0) * (rate / length)
    return Spectrum(np.asarray(frequency, dtype=np.float64), density.T[1:].sum(axis=1))


def smoothed(
    frequency: Array, density: Array, middle: Callable[[Array], float]
) -> tuple[Array, Array]:
    """Middle of each quarter of an octave that has a value, in [Hz], and its level, in [dB]."""
    steps = np.round(np.log2(frequency / frequency[-1]) * PER_OCTAVE)
    places = np.unique(steps)
    level = [10.0 * np.log10(middle(density[steps == step]) + 1e-300) for step in places]
    return frequency[-1] * 2.0 ** (places / PER_OCTAVE), np.array(level)


# Velocities that were differentiated

EXACT = 1e-12  # largest deviation of a difference of positions, as a share of the largest velocity
COMPARED = 1000  # samples that are compared, evenly spread, or a few more
COARSE = 1e-4  # largest share of floating-point rounding in a velocity that is compared


@dataclass(frozen=True)
class Differentiator:
    """Method by which velocities were computed from positions."""

    name: str
    weights: tuple[float, ...]  # of positions evenly about the middle, times the rate; (taps,)

    def response(self, frequency: Array, rate: float) -> Array:
        """Amplitude of the velocity divided by the position's, at some frequencies, in [1/s]."""
        taps = np.arange(len(self.weights)) - (len(self.weights) - 1) / 2
        turns = np.exp(2j * np.pi * np.outer(frequency, taps) / rate)
        return np.asarray(rate * np.abs(turns @ np.array(self.weights)))

    def corner(self, rate: float) -> float:
        """-3 dB frequency of the method, in [Hz]."""
        frequency = np.linspace(0.0, rate / 2, 1001)[1:]
        kept = self.response(frequency, rate) / (2 * np.pi * frequency)
        lost = kept < np.sqrt(0.5)
        return float(frequency[np.argmax(lost)] if lost.any() else rate / 2)


BACKWARD = Differentiator("difference to the sample before", (-1.0, 1.0))
FORWARD = Differentiator("difference to the sample after", (-1.0, 1.0))
CENTRAL = Differentiator("difference of the samples before and after", (-0.5, 0.0, 0.5))
# The polynomial's slope in the middle of a window, as `noisemodel.run` takes it.
_FIT = np.linalg.pinv(np.vander(np.arange(WINDOW) - WINDOW // 2, ORDER + 1, increasing=True) * 1.0)
SMOOTH = Differentiator(f"Savitzky-Golay, window {WINDOW}, order {ORDER}", tuple(_FIT[1].tolist()))


def differentiator_of(run: Run) -> Differentiator | None:
    """Method by which a run's velocities were differentiated from its positions; None if measured.

    It is known by the run's ``meta``, or as a difference that holds in 99 of 100 samples.
    """
    if derived(run, "velocity"):
        return SMOOTH
    if run.position is None or len(run.time) < 3:
        return None
    inner = np.flatnonzero(run.mask[:-2] & run.mask[1:-1] & run.mask[2:]) + 1
    inner = inner[:: max(1, len(inner) // COMPARED)]
    low, high = ends(valid(run, run.velocity))
    moves = high > low
    if not (len(inner) and moves.any()):
        return None
    before, here, after = (
        run.position[inner + step][:, moves].astype(np.float64) for step in (-1, 0, 1)
    )
    velocity = run.velocity[inner][:, moves].astype(np.float64)
    grain = max(np.finfo(run.position.dtype).eps, np.finfo(run.velocity.dtype).eps)
    fastest, farthest = np.abs(velocity).max(), np.abs(ends(run.position)).max()
    tolerance = 4.0 * grain * max(farthest * run.rate, fastest) + EXACT * fastest
    if tolerance > COARSE * np.sqrt(np.mean(np.square(velocity))):
        return None
    ways = {BACKWARD: here - before, FORWARD: after - here, CENTRAL: (after - before) / 2}
    off = {method: np.abs(way * run.rate - velocity) for method, way in ways.items()}
    method = next((m for m, each in off.items() if np.mean(each <= tolerance) >= 0.99), None)
    if method not in (BACKWARD, FORWARD) or grain > np.finfo(np.float64).eps:
        return method
    # A simulator makes positions of velocities: their difference is these but for its rounding.
    way, first = ways[method], inner - (method is BACKWARD)
    step = (run.time[first + 1] - run.time[first])[:, None]
    slopes = way * run.rate, way / step, way * (1 / step)
    exact = max(np.mean(slope == velocity) for slope in slopes)
    integrated = exact < 0.5 and off[method].max() <= 4.0 * grain * farthest * run.rate
    return None if integrated else method


# Quantisation

MOST_SAMPLES = 20_000  # most samples of a signal that are used, evenly spread
LEVELS = 8  # fewest different values of a signal that have a step
WHOLE = 0.02  # largest deviation of the distance of two values from a whole number of steps


def step_of(values: Real) -> float:
    """Quantisation step of a signal."""
    ordered = np.sort(values[:: max(1, len(values) // MOST_SAMPLES)]).astype(np.float64)
    distances = np.diff(ordered)
    least = 1e-12 * np.abs(ordered[[0, -1]]).max()  # below: equal, but for a sum's rounding
    distances = distances[distances > least]
    if len(distances) < LEVELS - 1:
        return 0.0
    steps = distances / distances.min()
    fits = np.mean(np.abs(steps - np.rint(steps)) <= WHOLE) >= 0.99
    return float(distances.min()) if fits else 0.0


def floor_frequency(spectrum: Spectrum, floor: Array) -> float | None:
    """Frequency above which a spectrum has less than twice its noise floor's amplitude, if any."""
    frequency, level = smoothed(spectrum.frequency, spectrum.total, np.mean)
    _, lowest = smoothed(spectrum.frequency, floor, np.mean)
    above = np.flatnonzero(level > lowest + 6.0)
    # The last band is left out: anti-aliasing filters end there.
    above = above[above < len(level) - 1]
    first = int(above[-1]) + 1 if len(above) else 0
    return float(frequency[first]) if first < len(level) - 1 else None


# Bandwidth

ENCODER_NOISE = LogBands().floor  # amplitude in a window that any encoder exceeds, in [rad/s]
RESOLUTION = 1.0 / LogBands().window  # frequency resolution of one window of those models, in [Hz]


@dataclass(frozen=True)
class Bandwidth:
    """The frequencies that a log holds."""

    nyquist: float  # half the sample rate, in [Hz]
    hold: float = 1.0  # length of the zero-order hold of measured values, in samples; 1 without one
    differentiator: Differentiator | None = None  # of positions; None of measured velocities
    corner: float | None = None  # -3 dB frequency of a filter, in [Hz]; None without a sign of one
    step: float = 0.0  # largest quantisation step, in [rad/s], or [rad] of differentiated positions
    # Frequency from which on the spectrum is at the quantisation floor, in [Hz]; None if never.
    floor_from: float | None = None
    floor_amplitude: float = 0.0  # largest oscillation that is masked there, in [rad/s]
    quiet_from: float | None = None  # from where on any encoder has more noise, in [Hz]; or None

    @cached_property
    def limits(self) -> dict[str, float]:
        """Upper limits of the bandwidth by their cause, in [Hz]."""
        rate = 2 * self.nyquist
        limits = {f"half the rate of {rate:g} Hz": self.nyquist}
        if self.hold > 1:
            limits[f"zero-order hold of {self.hold:.3g} samples"] = self.nyquist / self.hold
        if self.differentiator:
            limits["velocities were differentiated"] = self.differentiator.corner(rate / self.hold)
        if self.corner:
            limits["the log looks filtered"] = self.corner
        return limits

    @property
    def usable(self) -> float:
        """Lowest of the limits, in [Hz]."""
        return min(self.limits.values())

    @property
    def limit(self) -> str:
        """Cause of the lowest limit."""
        return min(self.limits, key=lambda name: self.limits[name])


def bandwidth(run: Run) -> Bandwidth:
    """Measure the bandwidth of a run."""
    differentiator, hold = differentiator_of(run), hold_length(run.velocity, run.mask)
    signal = run.velocity
    if run.position is not None and differentiator:  # [rad], the velocities came from these
        signal, hold = run.position, max(hold, hold_length(run.position, run.mask))
    plain = Bandwidth(run.rate / 2, hold, differentiator)
    found = spectrum(run.velocity, run.rate, run.mask)
    if found is None or not found.total.any():
        return plain
    steps = np.array([step_of(values) for values in np.ascontiguousarray(valid(run, signal).T)])
    # B. Widrow, IRE Trans. Circuit Theory 3 (1956): white noise of power step² / 12, here of all
    # joints together.
    noise = np.full(len(found.total), float(np.square(steps).sum()) / 12.0 / (run.rate / 2))
    if differentiator:
        noise = noise * np.square(differentiator.response(found.frequency, run.rate))
    # A sine of amplitude a in a band of width b has the mean density a² / 2b.
    encoders = np.full(len(noise), ENCODER_NOISE**2 / (2 * RESOLUTION))
    floor, amplitude = floor_frequency(found, noise), 0.0
    if floor is not None:
        place = min(int(np.searchsorted(found.frequency, floor)), len(noise) - 1)
        amplitude = float(np.sqrt(2 * RESOLUTION * noise[place]))
    # Hold and differentiation attenuate high frequencies too, without a filter.
    attenuated = hold > 1 or differentiator is not None
    return replace(
        plain,
        corner=None if attenuated else corner(found, np.maximum(noise, encoders)),
        step=float(steps.max()),
        floor_from=floor,
        floor_amplitude=amplitude,
        quiet_from=floor_frequency(found, encoders),
    )


FLAT = 4.5  # most variation in a flat octave, less than the 6 of a first-order filter, in [dB]
STEEP = 9.0  # least slope of a filter, in [dB] an octave: second order has 12, encoders have 6
DROP = 15.0  # least attenuation of one in two octaves or up to the Nyquist frequency, in [dB]
LOUD = 0.03  # RMS of an octave that is vibration, which no filter ends, as in labels, in [rad/s]


def corner(spectrum: Spectrum, floor: Array) -> float | None:
    """Find the -3 dB frequency of a filter, in [Hz]; None without a sign of one.

    A robot's spectrum falls from its motion to the noise of sensors and drives, which is flat or
    falls gently. A filter shows as an octave of that noise that is flat, and a fall that is steep
    and extends to the Nyquist frequency or into the ``floor``. A vibration in one band falls
    steeply too, but is louder, or ends on noise.
    """
    frequency, level = smoothed(spectrum.frequency, spectrum.total, _median)
    _, lowest = smoothed(spectrum.frequency, floor, _median)
    above = level > lowest + 3.0
    for place in range(len(frequency) - 2, PER_OCTAVE - 1, -1):
        flat = level[place - PER_OCTAVE : place + 1]
        end = min(place + 2 * PER_OCTAVE, len(frequency) - 1)
        drop = level[place] - level[end]
        octaves = np.log2(frequency[end] / frequency[place])
        if not above[place] or np.ptp(flat) > FLAT or drop < max(DROP, STEEP * octaves):
            continue
        # What follows has to fall, octave by octave, into the floor or up to the end.
        stop = place + int(np.argmin(np.append(above[place:-1], False)))
        starts = np.arange(place + 1, stop - PER_OCTAVE + 1)
        steep = (level[starts] - level[starts + PER_OCTAVE] >= STEEP).all()
        plateau = _median(flat)
        if steep and 10.0 ** (plateau / 10.0) * frequency[place] / 2 < LOUD**2:
            return float(frequency[np.flatnonzero(level[: place + 1] >= plateau - 3.0)[-1]])
    return None


def _median(values: Array) -> float:
    ordered = np.sort(values)  # for the few values of a band, `np.median` takes six times as long
    return float(ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2]) / 2


# Copies, units, and placeholders

FARTHEST = 10  # largest lag of a copy, before or after, in samples
EXAMINED = 1000  # samples in motion that are compared, evenly spread, or a few more
SAME = 0.99  # least share of equal samples, bit for bit, among those in motion
PROBED, LIKELY = 50, 0.9  # samples at which a lag is tried first, and least share of equal ones


@dataclass(frozen=True)
class Copy:
    """A measured signal that equals the desired one."""

    signal: str  # "position" or "velocity"
    joints: tuple[str, ...]
    lag: int  # samples by which the measured signal comes after the desired one


def copies(run: Run) -> tuple[Copy, ...]:
    """Find desired signals that equal measured ones, perhaps some samples apart."""
    found = []
    for signal in ("position", "velocity"):
        measured, desired = getattr(run, signal), getattr(run, f"{signal}_desired")
        if measured is None or desired is None or derived(run, signal):
            continue
        actual, wanted = (np.ascontiguousarray(valid(run, each).T) for each in (measured, desired))
        lags = {}
        for own, other in zip(*in_both(run), strict=True):
            if (lag := _lag(actual[own], wanted[other])) is not None:
                lags[run.joint_names[own]] = lag
        if lags:
            found.append(Copy(signal, tuple(lags), min(lags.values(), key=abs)))
    return tuple(found)


def _lag(measured: Real, desired: Real) -> int | None:
    """Find the shift at which two signals are equal, None if there is none."""
    changes = np.flatnonzero(desired[1:] != desired[:-1])
    ends = np.searchsorted(changes, (FARTHEST, len(measured) - FARTHEST - 1))
    moving = changes[slice(*ends)]
    moving = moving[:: max(1, len(moving) // EXAMINED)]
    if len(moving) < FARTHEST:
        return None
    few = moving[:: max(1, len(moving) // PROBED)]
    lags = np.array(sorted(range(-FARTHEST, FARTHEST + 1), key=abs))
    alike = (measured[few[:, None] + lags] == desired[few][:, None]).mean(axis=0)
    for lag in lags[alike >= LIKELY].tolist():
        if np.mean(measured[moving + lag] == desired[moving]) >= SAME:
            return int(lag)
    return None


def unit_warnings(run: Run) -> Iterator[str]:
    """Warnings about values that look like another unit, a clause each."""
    if not run.joint_names:
        return
    yield from contradictions(run)
    low, high = ends(valid(run, run.velocity))
    speeds = np.maximum(high, -low)
    if run.position is not None:
        farthest = np.abs(ends(valid(run, run.position))).max(axis=0)
        moving = high > low
        far = (farthest > TURN) & moving
        enough = far.sum() > 1 or (farthest[far] > LARGEST["position"]).any()
        if enough and 2 * far.sum() >= moving.sum():
            joint, largest = run.joint_names[int(np.argmax(farthest))], float(farthest.max())
            other = " or normalised" if largest <= NORMALISED else ""
            yield f"positions look like degrees{other} ({joint} reaches {largest:.4g})"
    fast = int(np.argmax(speeds))
    if speeds[fast] > LARGEST["velocity"]:
        reached = f"{run.joint_names[fast]} reaches {speeds[fast]:.4g}"
        yield f"velocities look like degrees or turns per minute ({reached})"


MOVES = 0.1  # least speed of a moving joint, in SI units: pushes on a standing arm peak below
MOVING_TIME = 2.0  # stretch of time in which it has to move, in [s]
MOVING_SHARE = 0.75  # share of that time: a motion reverses now and then, a push is over sooner
CHANGE = 1e-6  # least change of a desired position, and least desired speed, in SI units
PULSE = 2  # most samples of a pulse, of a central difference; each second one is chatter
FAINTEST = 0.05  # most quantisation noise of a velocity, RMS in [rad/s]: faults begin there


def placeholder(run: Run) -> str:
    """Say why the desired velocity is not the desired motion, in a clause; empty if it is, or none.

    Controllers that take position targets write zeros in its place. They are a placeholder if the
    desired position changes meanwhile, or if some joint is faster than 0.1 rad/s for three quarters
    of any two seconds. The zeros of a robot that has to stand remain, also when it is pushed.
    So are pulses, what a difference makes of held targets. A velocity that was differentiated here
    is none if the quantisation of the desired positions makes more than 0.05 rad/s of it.
    """
    desired, target = run.velocity_desired, run.position_desired
    if desired is None or not desired.size:
        return ""
    if any(np.any(desired[rows]) for rows in pieces(desired)):
        return _pulses(run) or _coarse(run)
    zero = "the desired velocity is zero throughout while"
    if target is not None:
        parts = (target[rows][run.mask[rows]] for rows in pieces(target))
        found = [(p.min(axis=0, initial=np.inf), p.max(axis=0, initial=-np.inf)) for p in parts]
        low, high = np.min([low for low, _ in found], 0), np.max([high for _, high in found], 0)
        if (high - low).max() > CHANGE:
            return f"{zero} the desired position changes"
    return f"{zero} joints move at more than {MOVES:g} rad/s for seconds" if _moves(run) else ""


def without_placeholder(run: Run) -> tuple[Run, str]:
    """Leave a desired velocity out that is a placeholder, and say so in a sentence."""
    if not (clause := placeholder(run)):
        return run, ""
    said = f"{clause[0].upper()}{clause[1:]}: it was left out."
    return replace(run, velocity_desired=None), said


def _pulses(run: Run) -> str:
    """Say that a desired velocity is zero between the steps of its targets; empty if not."""
    desired = run.velocity_desired
    assert desired is not None
    moves = [(np.abs(desired[rows]) > CHANGE).any(axis=1) for rows in pieces(desired)]
    moving = np.concatenate(moves) & run.mask
    edges = np.flatnonzero(np.diff(moving, prepend=False, append=False)).reshape(-1, 2)
    if len(edges) < FEWEST or np.median(np.ptp(edges, axis=1)) > PULSE:
        return ""
    rate = run.rate / float(np.median(np.diff(edges[:, 0])))
    if PULSE * rate >= run.rate:
        return ""
    return f"the desired velocity is zero between the steps of targets of about {rate:.3g} Hz"


def _coarse(run: Run) -> str:
    """Say that desired positions have steps too large to be differentiated; empty if not."""
    if not derived(run, "velocity_desired") or run.position_desired is None:
        return ""
    valid = np.flatnonzero(run.mask)
    thinned = valid[:: max(1, len(valid) // MOST_SAMPLES)]
    step = max(step_of(position) for position in run.position_desired[thinned].T)
    # B. Widrow, IRE Trans. Circuit Theory 3 (1956): white noise of power step² / 12.
    rate = run.rate / hold_length(run.position_desired, run.mask)
    noise = step / 12**0.5 * rate * float(np.linalg.norm(SMOOTH.weights))
    if noise <= FAINTEST:
        return ""
    steps = f"positions in steps of {step:.2g} rad"
    return f"the desired velocity, differentiated from {steps}, has {noise:.2g} rad/s of noise"


def _moves(run: Run) -> bool:
    """Whether some joint is faster than ``MOVES`` for most of some ``MOVING_TIME``."""
    size = round(MOVING_TIME * run.rate)
    if len(run.time) < size or not run.joint_names:
        return False
    fast = run.mask.copy()
    for rows in pieces(run.velocity):
        fast[rows] &= np.abs(run.velocity[rows]).max(axis=1) > MOVES
    count = np.cumsum(np.append(False, fast), dtype=np.int32)
    return bool((count[size:] - count[:-size]).max() >= MOVING_SHARE * size)
