"""How loud a run is, when, and which joints make it so."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from noisemodel import Run, simplified
from noisemodel.atomic import replacing
from noisemodel.types import Array


@dataclass(frozen=True)
class Loudness:
    """A run's simplified noise in numbers.

    Attributes:
        rate: Samples per second, in [Hz].
        duration: In [s].
        rms: Root mean square of the noise, in [rad/s].
        peak: Its largest value, in [rad/s].
        peak_time: When that is, in [s].
        shares: Share of each signal in the power, largest first: they add up to 1, since the
            power of the estimate is a sum over joints.
    """

    rate: float
    duration: float
    rms: float
    peak: float
    peak_time: float
    shares: tuple[tuple[str, float], ...]

    def __str__(self) -> str:
        """Say it in lines."""
        rows = [f"  {share:6.1%}  {name}" for name, share in self.shares if share >= 0.001]
        return "\n".join(
            [
                f"{self.duration:.2f} s at {self.rate:g} Hz",
                f"simplified noise: {self.rms:.4g} rad/s rms,"
                f" peak {self.peak:.4g} rad/s at {self.peak_time:.3f} s",
                "share of the power:",
                *rows,
            ]
        )


def loudness(run: Run) -> Loudness:
    """Measure a run's simplified noise.

    Args:
        run: The run; gaps do not count.

    Returns:
        The measures.
    """
    noise = simplified(run.motion, run.velocity_desired)
    loudest = int(np.argmax(noise))
    return Loudness(
        rate=run.rate,
        duration=run.duration,
        rms=float(np.sqrt(np.mean(noise[run.mask] ** 2))),
        peak=float(noise[loudest]),
        peak_time=float(run.time[loudest]),
        shares=_shares(run),
    )


def _shares(run: Run) -> tuple[tuple[str, float], ...]:
    def power(signal: np.ndarray) -> Array:
        energy: Array = np.square(signal[run.mask].astype(np.float64)).sum(axis=0)
        return energy

    named = list(zip(run.joint_names, power(run.velocity), strict=True))
    if run.velocity_desired is not None:
        desired = zip(run.desired_joint_names, power(run.velocity_desired), strict=True)
        named += [(f"{name}, desired", value) for name, value in desired]
    if run.base_velocity is not None:
        named.append(("base", power(run.base_velocity).sum()))
    total = sum(value for _, value in named) or 1.0
    shares = [(name, float(value / total)) for name, value in named]
    return tuple(sorted(shares, key=lambda pair: -pair[1]))


def write_csv(run: Run, path: Path, *, overwrite: bool = False) -> None:
    """Write time and simplified noise as CSV.

    Args:
        run: The run.
        path: The file to write.
        overwrite: Whether a file that exists may be replaced.

    Raises:
        OutputError: If the file exists or cannot be written.
    """
    noise = simplified(run.motion, run.velocity_desired)
    columns = np.column_stack((run.time, noise))[run.mask]
    with replacing(path, overwrite=overwrite) as temporary:
        header = "time [s],simplified [rad/s]"
        np.savetxt(temporary, columns, fmt="%.9g", delimiter=",", header=header, comments="")
