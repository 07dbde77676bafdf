"""A sample: the noise signals of a run, its blocks, and the recipe to reproduce it.

A sample file is an archive of plain arrays: ``format`` ("noise-sample/3"), ``robot``, ``rate`` in
[Hz], ``block_start``, ``block_stop`` and ``block_label`` as in a run file, ``meta`` (a JSON object:
the run's own, and the ``sha256`` of its arrays), and each signal under its name, float32, of shape
(samples,). `scenarios.signals` defines the signals. Noise cannot be decimated as velocities can:
the file also has the norms of the run decimated to 1 kHz as ``lowered_<name>``, and the velocities
of its joints at that rate as ``desired_joints`` and
``measured_joints``, float32, of shape (joints, samples).
"""

import hashlib
import json
import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from noiseclassifier.scenarios.errors import SampleError, ScenarioError
from noiseclassifier.scenarios.signals import WHOLE, Signals, joints, norms, signals, with_error
from noisemodel import Block, Run, decimated, runfile
from noisemodel.archive import DAMAGE as DAMAGED
from noisemodel.archive import names_in, read

FORMAT = "noise-sample/3"
DECIMATED = 1000.0
"""The second rate of the signals, in [Hz]."""
CLOSE = 1e-3
"""Relative difference below which rates are equal."""
PREFIX = "lowered_"
DAMAGE = (
    OSError,
    ValueError,
    KeyError,
    TypeError,
    AttributeError,
    zipfile.BadZipFile,
    RecursionError,
    *DAMAGED,
)
"""Errors that reading raises if a file is damaged or of another kind."""
RECIPE = frozenset(("scenario", "seed", "duration", "sha256"))
"""Keys of ``meta`` that are needed to reproduce the run."""
KEPT = ("desired_joints", "measured_joints")
"""The stored signals by joint: the error is their difference."""
_FACTS = ("format", "robot", "rate", "meta", "block_start", "block_stop", "block_label", *KEPT)


@dataclass(frozen=True, kw_only=True, eq=False)
class Sample:
    """The noise signals of a simulated run.

    Attributes:
        rate: Sample rate, in [Hz].
        signals: Noise signals by name, each of shape (samples,).
        joints: Desired, measured and error velocities of the decimated run, each of shape
            (joints, samples); none at another rate.
    """

    robot: str
    rate: float
    signals: Signals
    decimated: Signals
    blocks: tuple[Block, ...]
    meta: Mapping[str, Any]
    joints: Signals = field(default_factory=dict)

    @classmethod
    def of(cls, run: Run) -> Self:
        """The sample of a simulated run."""
        decimated_run = decimated(run, DECIMATED)
        return cls(
            robot=str(run.robot),
            rate=run.rate,
            signals=signals(run),
            decimated=norms(decimated_run),
            joints=joints(decimated_run),
            blocks=run.blocks,
            meta={**run.meta, "sha256": digest(run)},
        )

    @property
    def name(self) -> str:
        """Robot, scenario and seed, as in the path of its file."""
        return f"{self.robot}/{self.meta['scenario']}-{self.meta['seed']:03d}"

    @property
    def noise(self) -> NDArray[np.float32]:
        """The simplified noise, shape (samples,), in [rad/s]."""
        # p_hat = sqrt(|qd|^2 + |qd_desired|^2), Sygulla & Rixen, Sec. II-A
        return np.hypot(self.signals["measured"], self.signals["desired"])

    def at(self, rate: float) -> Self:
        """The sample at another rate.

        Args:
            rate: The rate of the sample, or ``DECIMATED``, in [Hz].
        """
        if abs(rate / self.rate - 1) < CLOSE:
            return replace(self, joints={})
        if abs(rate / DECIMATED - 1) < CLOSE:
            if lacking := {*WHOLE} & self.signals.keys() - self.decimated.keys():
                raise ScenarioError(
                    f"{self.name}: has no {', '.join(sorted(lacking))} at {DECIMATED:g} Hz"
                )
            return replace(self, rate=DECIMATED, signals=self.decimated)
        raise ScenarioError(
            f"{self.name}: keeps its noise at {self.rate:g} Hz and {DECIMATED:g} Hz and no"
            f" velocities, so that it cannot be decimated to {rate:g} Hz; scenarios.reproduce"
            " simulates its run again"
        )

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the sample atomically."""
        arrays = {
            "format": FORMAT,
            "robot": self.robot,
            "rate": self.rate,
            "meta": json.dumps(dict(self.meta), sort_keys=True),
            **_columns(self.blocks),
            **self.signals,
            **{f"{PREFIX}{name}": signal for name, signal in self.decimated.items()},
            **{name: self.joints[name] for name in KEPT if self.joints},
        }
        runfile.write(Path(path), arrays, overwrite=overwrite)

    @classmethod
    def load(cls, path: str | Path, *, only: Iterable[str] | None = None) -> Self:
        """Read a sample."""
        path = Path(path)
        if not path.is_file():
            raise SampleError(path, "there is no such file")
        if not zipfile.is_zipfile(path):
            raise SampleError(path, "not a sample, or truncated: not a complete archive")
        try:
            return cls(**_fields(path, only))
        except SampleError:
            raise
        except DAMAGE as error:
            raise SampleError(path, f"damaged ({_one_line(error)})") from error


def is_sample(path: str | Path) -> bool:
    """Whether a file is a sample, of any version."""
    if not (Path(path).is_file() and zipfile.is_zipfile(path)):
        return False
    try:
        version = read(Path(path), ["format"])["format"]
        return not version.shape and str(version).startswith("noise-sample/")
    except DAMAGE:
        return False


def digest(run: Run) -> str:
    """SHA-256 of the arrays of a run: names, shapes, every bit of every signal, and the blocks."""
    arrays = {
        "time": run.time,
        "velocity": run.velocity,
        "position": run.position,
        "velocity_desired": run.velocity_desired,
        "position_desired": run.position_desired,
        "effort": run.effort,
        "base_pose": run.base_pose,
        "base_velocity": run.base_velocity,
        **run.stages,
        **_columns(run.blocks),
    }
    hashed = hashlib.sha256(repr((run.joint_names, run.desired_joint_names)).encode())
    for name, array in arrays.items():
        if array is not None:
            hashed.update(f"{name}{array.dtype.str}{array.shape}".encode())
            hashed.update(np.ascontiguousarray(array).tobytes())
    return hashed.hexdigest()


def _columns(blocks: tuple[Block, ...]) -> dict[str, NDArray[Any]]:
    return {
        "block_start": np.array([block.start for block in blocks], dtype=np.float64),
        "block_stop": np.array([block.stop for block in blocks], dtype=np.float64),
        "block_label": np.array([block.label for block in blocks], dtype=str),
    }


def _fields(path: Path, only: Iterable[str] | None) -> dict[str, Any]:
    held = names_in(path)
    there = [name for name in held if name not in _FACTS and PREFIX not in name]
    names = there if only is None else list(only)
    archive = read(path, {*_FACTS, *names, *(f"{PREFIX}{name}" for name in names)})
    for name in ("format", "robot", "meta"):
        if name in archive and (archive[name].shape or archive[name].dtype.kind != "U"):
            raise SampleError(path, f"{name} is no text")
    version = str(archive["format"]) if "format" in archive else "none"
    if version != FORMAT:
        raise SampleError(path, f"format {version[:40]!r}, expected {FORMAT!r}")
    lacking = [name for name in (*WHOLE, *names) if name not in there]
    if lacking:
        raise SampleError(
            path, f"has no signal {', '.join(sorted(lacking))}; it has {', '.join(there)}"
        )
    whole = _equal(path, {name: archive[name] for name in names})
    low = {name: archive[f"{PREFIX}{name}"] for name in names if f"{PREFIX}{name}" in archive}
    columns = [archive[name] for name in ("block_start", "block_stop", "block_label")]
    if [column.dtype.kind for column in columns] != ["f", "f", "U"]:
        raise SampleError(path, "its blocks are no times and labels")
    meta = json.loads(str(archive["meta"]))
    if not meta.keys() >= RECIPE:
        raise SampleError(path, f"its meta lacks {', '.join(sorted(RECIPE - meta.keys()))}")
    if type(meta["seed"]) is not int or not isinstance(meta["scenario"], str):
        raise SampleError(path, "its meta has no scenario and seed")
    return {
        "robot": str(archive["robot"]),
        "rate": float(archive["rate"]),
        "signals": whole,
        "decimated": _equal(path, low),
        "joints": with_error(*(archive[name] for name in KEPT)) if KEPT[0] in archive else {},
        "blocks": tuple(
            Block(*block) for block in zip(*(column.tolist() for column in columns), strict=True)
        ),
        "meta": meta,
    }


def _equal(path: Path, signals: Signals) -> Signals:
    for name, signal in signals.items():
        if signal.dtype.kind != "f" or signal.ndim != 1 or not np.isfinite(signal).all():
            raise SampleError(path, f"{name} is no row of finite numbers")
    if len({signal.shape for signal in signals.values()}) > 1:
        shapes = ", ".join(f"{name} {signal.shape}" for name, signal in signals.items())
        raise SampleError(path, f"signals of different shapes: {shapes}")
    return signals


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
