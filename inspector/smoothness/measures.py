"""Measures of smoothness of a motion that is sampled uniformly and has no gaps.

Conventions: `sparc` and `log_dimensionless_jerk` are dimensionless, at most 0, and higher the
smoother, as their authors have them; all others are 0 for the smoothest motion, and higher the
rougher. A measure that a signal does not define (it is too short, stands still, or its rate is too
low) is None.

Sources:
    Hogan and Sternad, "Sensitivity of smoothness measures to movement duration, amplitude, and
    arrests", Journal of Motor Behavior 41, 2009.
    Balasubramanian, Melendez-Calderon and Burdet, "A robust and sensitive metric for quantifying
    movement smoothness", IEEE Transactions on Biomedical Engineering 59, 2012.
    Balasubramanian, Melendez-Calderon, Roby-Brami and Burdet, "On the analysis of movement
    smoothness", Journal of NeuroEngineering and Rehabilitation 12, 2015.
"""

import numpy as np

from noisemodel.types import Array, Real

CUTOFF, THRESHOLD, PADDING = 10.0, 0.05, 4
"""Of SPARC: highest frequency in [Hz], least amplitude, powers of two of zero padding (2015)."""
ORDER = 4
"""Of the Butterworth high-pass, which is applied forward and backward."""
PERIODS = 3
"""Least duration of a signal, in periods of the high-pass's frequency."""
BAND = 1.2
"""Least ratio of the Nyquist frequency to that of the high-pass."""


def level_above(signal: Real, rate: float, frequency: float) -> float | None:
    """Root mean square of a signal above a frequency, summed over joints.

    Of velocities above 10 Hz it is our own measure, the noise of the joints where motion is over.
    The high-pass has the gain 1/2 at its frequency.

    Args:
        signal: Shape (samples, joints), in any unit.
        rate: Sample rate, in [Hz].
        frequency: Lowest frequency, in [Hz].

    Returns:
        Root of the sum over joints of mean squares, in the unit of the signal; None if the rate is
        below 2.4 times the frequency, or the signal shorter than three of its periods.
    """
    padding = round(PERIODS * rate / frequency)
    if rate < 2 * BAND * frequency or len(signal) <= padding:
        return None
    from scipy.signal import butter, sosfiltfilt

    sections = butter(ORDER, frequency, "highpass", fs=rate, output="sos")
    fast = sosfiltfilt(sections, np.asarray(signal, dtype=np.float64), axis=0, padlen=padding)
    return float(np.sqrt(np.square(fast).sum(axis=1).mean()))


def sparc(speed: Real, rate: float, *, cutoff: float = CUTOFF) -> float | None:
    """Spectral arc length of a speed profile (Balasubramanian et al., 2015).

    It is the negative length of the curve that the amplitude spectrum of the speed makes, from 0 to
    the last frequency below the cut-off at which it is 5 % of its largest value. Frequencies are
    divided by that last one, amplitudes by the largest one, so that neither the amplitude nor the
    duration of the motion counts. It is blind above the cut-off, and made for movements of a few
    seconds: a longer episode has a more negative one, however smooth it is.

    Args:
        speed: Not negative, shape (samples,), in any unit: the norm of a velocity.
        rate: Sample rate, in [Hz].
        cutoff: Highest frequency, in [Hz].

    Returns:
        The negative arc length; None if there are fewer than two samples, or no motion.
    """
    if len(speed) < 2 or not np.any(speed):
        return None
    size = 2 ** (int(np.ceil(np.log2(len(speed)))) + PADDING)
    amplitude = np.abs(np.fft.rfft(speed, size))
    frequency = np.fft.rfftfreq(size, 1.0 / rate)
    inside = frequency <= cutoff
    amplitude, frequency = amplitude[inside] / amplitude.max(), frequency[inside]
    last = int(np.flatnonzero(amplitude >= THRESHOLD)[-1])
    if last == 0:
        return None
    # omega_c = min(cutoff, min(omega: V(r) < threshold for all r > omega)), Eq. 8 of 2015.
    steps = np.diff(frequency[: last + 1]) / frequency[last]
    return -float(np.sqrt(steps**2 + np.diff(amplitude[: last + 1]) ** 2).sum())


def log_dimensionless_jerk(velocity: Real, rate: float) -> float | None:
    """Log dimensionless jerk of a motion (Hogan and Sternad, 2009; Balasubramanian et al., 2015).

    -ln(T³ / v_peak² ∫ |d²v/dt²|² dt), with the norms over joints. A minimum-jerk movement from rest
    to rest has -ln(204.8) = -5.32. Jerk grows with the third power of frequency: noise counts as
    far up as the rate goes, so only logs of one rate and one kind of sensor can be compared.

    Args:
        velocity: Shape (samples, joints), in any unit.
        rate: Sample rate, in [Hz].

    Returns:
        The negative logarithm; None if there are fewer than three samples, no motion, or no jerk.
    """
    if len(velocity) < 3:
        return None
    peak = np.square(velocity).sum(axis=1).max()
    jerk = np.diff(np.asarray(velocity, dtype=np.float64), n=2, axis=0) * rate**2
    mean = np.square(jerk).sum(axis=1).mean()  # times T: the integral
    if not peak or not mean:
        return None
    duration = (len(velocity) - 1) / rate
    return -float(np.log(duration**4 / peak * mean))


def squared_difference(action: Real, *, order: int = 1) -> float | None:
    """Mean square of the differences of successive actions, summed over joints.

    The first difference is the "action rate" that policies are penalised by in reinforcement
    learning; the second one passes constant rates. Both are per action, not per second.

    Args:
        action: Shape (actions, joints), in any unit.
        order: Of the difference.

    Returns:
        In the square of the unit; None if there are no more than ``order`` actions.
    """
    if len(action) <= order:
        return None
    differences = np.diff(np.asarray(action, dtype=np.float64), n=order, axis=0)
    return float(np.square(differences).sum(axis=1).mean())


def speed_of(velocity: Real) -> Array:
    """Norm of a velocity over joints.

    Args:
        velocity: Shape (samples, joints), in any unit.

    Returns:
        Shape (samples,), in the same unit.
    """
    return np.asarray(np.linalg.norm(np.asarray(velocity, dtype=np.float64), axis=1))
