"""Kinds of noise estimates side by side, on one robot or many, on runs or an excitation motion."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeAlias, overload

import numpy as np

from noisemodel.errors import (
    GeometryError,
    MotionError,
    NoiseModelError,
    RobotError,
    RunError,
    UnknownKindError,
)
from noisemodel.extended import KINDS, check_motion, chunk_speeds, vibrating
from noisemodel.noise import (
    CHUNK,
    check_positive,
    check_stretches,
    decibel,
    simplified,
    sound_power,
)
from noisemodel.parallel import DIED, Jobs, in_order
from noisemodel.robot import Robot, is_name, limits_of
from noisemodel.run import Block, Run, is_robot_file, part, stretches
from noisemodel.surface import GEOMETRIES, TINY, Surface, check_surface
from noisemodel.types import Array, Real

if TYPE_CHECKING:
    import pyarrow

SIMPLIFIED = "simplified"

COMPARED = (SIMPLIFIED, "C", "paper", "mean", "rms", "normal")
"""The kinds that are compared unless others are named."""

TERMS = ("A", "B", "C")
"""The terms of the paper's mean speed."""

REFERENCES = ("normal", "mean")
"""The other kinds are compared with the first of these that is among them."""

BANDS = ((0.0, 20.0), (20.0, 100.0), (100.0, 500.0), (500.0, np.inf))
"""Parts of the spectrum for which distances are given one by one, in [Hz]."""

ENVELOPE = 0.02
"""Stretch of time whose root mean square is one value of the envelope, in [s]."""

WINDOW = 0.1024
"""Length of a spectrum's Hann window, in [s]: the paper's 1024 samples at 10 kHz."""

DYNAMICS_DB = 100.0
"""What lies further below a signal's loudest line counts as this far below, in [dB]."""

LOUDEST = 5
"""Links that are printed by name."""
GROUP = 3
"""Robots that a median is taken of at least."""
NAME = 26
"""Width of a robot's name in print."""

EXCITATION = "excitation"
SECONDS = 6.0
RATE = 4000.0
"""Sample rate of the excitation unless another is given, in [Hz]."""
NOMINAL_SPEED = {"prismatic": 0.3}
"""Speed of the slow sines in [m/s]; of joints that turn it is 1 rad/s."""
BASE_SPEED = 0.1
"""Speed of a floating base, in [m/s] and [rad/s]."""
SINES_HZ = (0.1, 0.8)
SINES = 3
RIPPLE = 0.01
"""Root mean square of the ripple, as a share of the joint's nominal speed."""
RIPPLE_HZ = 10.0
"""Lowest frequency of the ripple, which has the same power in every octave above, in [Hz]."""
USABLE = 0.9
"""Share of its range and of its speed that a joint uses at most."""
SHAKE = 0.2
"""Amplitude of a shake, in [rad/s]."""
SHAKE_HZ = (40.0, 200.0)
SHAKES = {"shake-near": (1.0, 1.8), "shake-far": (2.6, 3.4)}
JERK = (4.6, 4.8)
JERK_DECAY = 0.03
"""Time constant of the decay of the jump, in [s]."""

Source: TypeAlias = Robot | Run | Path | str
"""A robot, its listed name or the path of its URDF or MJCF; or a run, or the path of a run file."""

Motion: TypeAlias = Run | tuple[Real, Real] | str
"""A run, a pair of q and v, or the name of a built-in motion."""

Motions: TypeAlias = Motion | Sequence[Motion] | Mapping[Any, Motion]
"""One motion for all robots, one for each in their order, or one by each robot's name."""

Progress: TypeAlias = Callable[..., "Iterable[RobotComparison | LeftOut]"]
"""Takes an iterable and its length (``total``), and passes the items on, as tqdm does."""


# The results, and how they print.


@dataclass(frozen=True, eq=False)
class Comparison:
    """How kinds of noise estimates differ on one motion.

    Attributes:
        kinds: The kinds.
        names: The links.
        correlation: Of the envelopes of each two kinds, shape (kinds, kinds); nan where an
            envelope does not change.
        distance: Log-spectral distance of each two kinds: root mean square of the difference
            of their spectra over time and frequency, shape (kinds, kinds), in [dB].
        frequency: Shape (frequency,), in [Hz].
        distance_by_frequency: The same over time alone, shape (kinds, kinds, frequency).
        contrast: Mean power in the events over that of the rest, shape (kinds,), in [dB]; nan
            without events.
        shares: Share of each link in the energy, shape (kinds, links).
        terms: Share of A, B and C of each link in the energy that "paper" gives the whole robot,
            (A + B + C)² being (A + B + C) A + (A + B + C) B + (A + B + C) C, shape (links, 3).
    """

    kinds: tuple[str, ...]
    names: tuple[str, ...]
    correlation: Array
    distance: Array
    frequency: Array
    distance_by_frequency: Array
    contrast: Array
    shares: Array
    terms: Array

    @property
    def reference(self) -> int:
        """Index of the kind that the others are compared with: normal, else mean, else the last."""
        named = (self.kinds.index(kind) for kind in REFERENCES if kind in self.kinds)
        return next(named, len(self.kinds) - 1)

    @property
    def loudest(self) -> tuple[str, float]:
        """The link with the largest share in the energy of the reference, and that share."""
        shares = self.shares[self.reference]
        return self.names[shares.argmax()], float(shares.max())

    def by_band(self, kind: int, other: int) -> Array:
        """Spectral distance of two kinds in each of ``BANDS``.

        Args:
            kind: Index of a kind.
            other: Index of another.

        Returns:
            Shape (bands,), in [dB]; nan above the Nyquist frequency.
        """
        squares = self.distance_by_frequency[kind, other] ** 2
        inside = [(self.frequency >= low) & (self.frequency < high) for low, high in BANDS]
        return np.array([np.sqrt(squares[at].mean()) if at.any() else np.nan for at in inside])

    def to_arrow(self) -> "pyarrow.Table":
        """Tabulate a row for each ordered pair of kinds.

        Returns:
            A table with the columns ``kind``, ``other``, ``correlation`` of the envelopes,
            ``distance_db`` of the spectra and its parts ``distance_<band>_db`` by frequency; nan
            where a number does not exist.
        """
        import pyarrow

        numbers = range(len(self.kinds))
        return pyarrow.Table.from_pylist(
            [
                {"kind": self.kinds[kind], "other": self.kinds[other], **self.pair(kind, other)}
                for kind in numbers
                for other in numbers
            ]
        )

    def pair(self, kind: int, other: int) -> dict[str, float]:
        """Correlation and distances of two kinds, by the names of their columns in a table.

        Args:
            kind: Index of a kind.
            other: Index of another.
        """
        distances = zip(BANDS, self.by_band(kind, other).tolist(), strict=True)
        return {
            "correlation": float(self.correlation[kind, other]),
            "distance_db": float(self.distance[kind, other]),
            **{f"distance_{_column(*band)}_db": distance for band, distance in distances},
        }

    def __str__(self) -> str:
        head = "".join(f"{kind:>11}" for kind in self.kinds)
        lines = [f"{'correlation of envelopes':28}{head}"]
        lines += [_row(k, row, ".3f") for k, row in zip(self.kinds, self.correlation, strict=True)]
        lines.append(f"{'spectral distance [dB]':28}{head}")
        lines += [_row(k, row, ".1f") for k, row in zip(self.kinds, self.distance, strict=True)]
        lines.append(f"{'':28}{head}")
        if not np.isnan(self.contrast).all():
            lines.append(_row("contrast of events [dB]", self.contrast, ".1f"))
        order = np.argsort(-self.shares.max(axis=0), kind="stable")[:LOUDEST]
        lines += [_row(self.names[link], self.shares[:, link], ".1%") for link in order]
        parts = zip(TERMS, self.terms.sum(axis=0), strict=True)
        listed = ", ".join(f"{term} {share:.1%}" for term, share in parts)
        return "\n".join([*lines, f"of the energy of paper: {listed}"])


@dataclass(frozen=True, eq=False)
class RobotComparison:
    """Kinds of noise estimates compared on one robot and its motion.

    Attributes:
        name: The robot, or the run file.
        floating_base: Whether the robot's base moves freely.
        joints: How many joints the motion has.
        time: Of the samples, shape (samples,), in [s].
        rate: Samples per second, in [Hz].
        events: What should stand out: the run's blocks that are not "ok".
        comparison: How the kinds differ.
        pressure: Estimated pressure by each kind, its root mean square being 1,
            shape (kinds, samples).
        contrast: Mean square of the pressure above 10 Hz in each event, over that outside of all
            events, shape (kinds, events), in [dB].
        links_with_surface: How many links have a surface.
        remarks: What the comparison leaves out, a sentence each.
    """

    name: str
    floating_base: bool
    joints: int
    time: Array
    rate: float
    events: tuple[Block, ...]
    comparison: Comparison
    pressure: Array
    contrast: Array
    links_with_surface: int
    remarks: tuple[str, ...]

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds that were compared."""
        return self.comparison.kinds

    def by_label(self, kind: int, labels: Sequence[str]) -> Array:
        """Mean contrast of the events with each label.

        Args:
            kind: Index of the kind.
            labels: The labels.

        Returns:
            Shape (labels,), in [dB]; nan where there is no such event.
        """
        own = np.array([event.label for event in self.events])
        inside = [own == label for label in labels]
        levels = self.contrast[kind]
        return np.array([levels[at].mean() if at.any() else np.nan for at in inside])

    def rows(self, labels: Sequence[str]) -> Iterator[dict[str, str | bool | int | float]]:
        """Tabulate the numbers of each kind, by the names of their columns in a table.

        Args:
            labels: The labels of events that have a column.

        Yields:
            A row for each kind.
        """
        compared, reference = self.comparison, self.comparison.reference
        shares = zip(TERMS, compared.terms.sum(axis=0).tolist(), strict=True)
        facts = {
            "name": self.name,
            "floating_base": self.floating_base,
            "joints": self.joints,
            "links": len(compared.names),
            "links_with_surface": self.links_with_surface,
            "rate_hz": self.rate,
            **{f"share_{term}": share for term, share in shares},
        }
        for index, kind in enumerate(self.kinds):
            contrasts = zip(labels, self.by_label(index, labels).tolist(), strict=True)
            loudest = int(compared.shares[index].argmax())
            yield {
                **facts,
                "kind": kind,
                "reference": self.kinds[reference],
                **compared.pair(index, reference),
                **{f"contrast_{label}_db": contrast for label, contrast in contrasts},
                "loudest_share": float(compared.shares[index, loudest]),
                "loudest_link": compared.names[loudest],
            }

    def __str__(self) -> str:
        return f"{self.name}, {len(self.time)} samples at {self.rate:g} Hz\n{self.comparison}"


def _row(name: str, values: Array, form: str) -> str:
    return f"{name:28}" + "".join(f"{value:>11{form}}" for value in values)


def _column(low: float, high: float) -> str:
    return f"{low:.0f}_up" if np.isinf(high) else f"{low:.0f}_{high:.0f}"


@dataclass(frozen=True)
class LeftOut:
    """A robot or a run that could not be compared.

    Attributes:
        name: The robot, or the run file.
        reason: Why not, in one line.
    """

    name: str
    reason: str

    def __str__(self) -> str:
        return f"{self.name}: left out: {self.reason}"


@dataclass(frozen=True, eq=False)
class Comparisons:
    """Kinds of noise estimates compared on many robots, all on the same kinds.

    It has a length, an iterator and indices, all over ``robots``, and prints as a table.

    Attributes:
        robots: What could be compared, in the order of the robots.
        left_out: What could not, and why.
    """

    robots: tuple[RobotComparison, ...]
    left_out: tuple[LeftOut, ...] = ()

    @classmethod
    def of(cls, results: Iterable[RobotComparison | LeftOut]) -> "Comparisons":
        """Collect the results of robots."""
        found, left_out = list[RobotComparison](), list[LeftOut]()
        for result in results:
            if isinstance(result, LeftOut):
                left_out.append(result)
            else:
                found.append(result)
        return cls(tuple(found), tuple(left_out))

    def __len__(self) -> int:
        return len(self.robots)

    def __iter__(self) -> Iterator[RobotComparison]:
        return iter(self.robots)

    def __getitem__(self, index: int) -> RobotComparison:
        return self.robots[index]

    @property
    def labels(self) -> tuple[str, ...]:
        """The labels of all events, in the order in which they come."""
        return tuple(dict.fromkeys(event.label for one in self for event in one.events))

    def to_arrow(self) -> "pyarrow.Table":
        """Tabulate a row for each robot and kind.

        Returns:
            A table with the columns ``name``, ``floating_base``, ``joints``, ``links``,
            ``links_with_surface``, ``rate_hz``, ``share_A``, ``share_B`` and ``share_C`` of the
            paper's terms in its power, ``kind``, the ``reference`` that the kind is compared with,
            ``correlation``, ``distance_db`` and its parts ``distance_<band>_db`` by frequency,
            ``contrast_<label>_db`` of the events with each label, ``loudest_share`` and
            ``loudest_link``; nan where a number does not exist.

        Raises:
            NoiseModelError: If every robot was left out.
        """
        import pyarrow

        if not self.robots:
            raise NoiseModelError(f"no robot was compared; {'; '.join(map(str, self.left_out))}")
        labels = self.labels
        return pyarrow.Table.from_pylist([row for one in self for row in one.rows(labels)])

    def __str__(self) -> str:
        lines = list(_table(self)) if self.robots else []
        return "\n".join([*lines, *map(str, self.left_out)])


@dataclass(frozen=True)
class _Columns:
    """Some columns of a table.

    Attributes:
        title: What they hold.
        names: Their names.
        form: Format of a number.
        least: Width of the narrowest column.
    """

    title: str
    names: Sequence[str]
    form: str
    least: int = 5

    @property
    def head(self) -> tuple[str, str]:
        """The title over the names."""
        names = " " + "".join(
            f"{name:>{width}}" for name, width in zip(self.names, self._widths, strict=True)
        )
        return f" {self.title:^{len(names) - 1}}", names

    def row(self, values: Array) -> str:
        """Print numbers under the names; a dash where there is none."""
        return " " + "".join(
            f"{value:>{width}{self.form}}" if np.isfinite(value) else f"{'-':>{width}}"
            for value, width in zip(values, self._widths, strict=True)
        )

    @property
    def _widths(self) -> list[int]:
        return [max(self.least, len(name) + 1) for name in self.names]


_Valued: TypeAlias = tuple[_Columns, Callable[[RobotComparison], Array]]
"""Columns, and what takes their numbers from a comparison, shape (columns,)."""


def _table(found: Comparisons) -> Iterator[str]:
    """Print a row for each robot, then distance by frequency and contrast of each kind."""
    compared = found[0].comparison
    kinds, reference = compared.kinds, compared.reference
    others = [kind for kind in kinds if kind != kinds[reference]]
    columns: tuple[_Valued, ...] = (
        (_Columns("share in paper", TERMS, ".0%"), lambda one: one.comparison.terms.sum(axis=0)),
        (
            _Columns("correlation", others, ".2f", 6),
            lambda one: np.delete(one.comparison.correlation[reference], reference),
        ),
        (
            _Columns("distance [dB]", others, ".1f"),
            lambda one: np.delete(one.comparison.distance[reference], reference),
        ),
    )
    yield f"Reference {kinds[reference]!r}; F: floating base; last: the loudest link"
    yield from _robots(found, columns)
    yield ""
    yield f"Of all {len(found)}, medians" if len(found) > 1 else "By kind"
    yield from _kinds(found)
    yield from (f"{one.name}: {remark}" for one in found for remark in one.remarks)


def medians(rows: Sequence[Array]) -> Array:
    """Take the median of each column over the rows that have a number there.

    Args:
        rows: One or more, each of shape (columns,).
    """
    finite = [column[np.isfinite(column)] for column in np.array(rows).T]
    return np.array([np.median(column) if len(column) else np.nan for column in finite])


def _robots(found: Comparisons, columns: Sequence[_Valued]) -> Iterator[str]:
    for line in zip(*(shown.head for shown, _ in columns), strict=True):
        yield f"{'':{NAME + 2}}{''.join(line)}".rstrip()
    for one in found:
        cells = "".join(shown.row(values(one)) for shown, values in columns)
        link, share = one.comparison.loudest
        base = "F" if one.floating_base else " "
        yield f"{_short(one.name):{NAME}} {base}{cells}  {share:4.0%} {link}"
    for floating, word in ((False, "fixed"), (True, "floating")):
        group = [one for one in found if one.floating_base == floating]
        if len(group) >= GROUP:
            cells = "".join(
                shown.row(medians([values(one) for one in group])) for shown, values in columns
            )
            yield f"{f'median of {len(group)} {word}':{NAME}}  {cells}"


def _kinds(found: Comparisons) -> Iterator[str]:
    """Print a row for each kind."""
    labels = found.labels
    bands = _Columns("distance by frequency [dB]", [_band(*band) for band in BANDS], ".1f")
    events = _Columns("contrast of events above 10 Hz [dB]", labels, ".1f")
    for first, second in zip(bands.head, events.head, strict=True):
        yield f"{'':{NAME + 2}}{first}{second if labels else ''}".rstrip()
    reference = found[0].comparison.reference
    for index, kind in enumerate(found[0].kinds):
        apart = [one.comparison.by_band(index, reference) for one in found]
        contrast = events.row(medians([one.by_label(index, labels) for one in found]))
        yield f"{kind:{NAME}}  {bands.row(medians(apart))}{contrast}".rstrip()


def _short(name: str) -> str:
    """Keep the end of a name that is too long, by which paths differ."""
    return name if len(name) <= NAME else f"…{name[1 - NAME :]}"


def _band(low: float, high: float) -> str:
    return f"{low:.0f} Hz up" if np.isinf(high) else f"{low:.0f}-{high:.0f} Hz"


# The estimates of one motion, each evaluated once, and how they differ.


def envelopes(powers: Array, stretch: int) -> Array:
    """Take the root mean square of the pressure in one stretch of time after the other."""
    whole = powers.shape[1] // stretch * stretch
    stretches = powers[:, :whole].reshape(len(powers), -1, stretch)
    roots: Array = np.sqrt(stretches.mean(axis=2))
    return roots


def correlation(signals: Array) -> Array:
    """Correlate each signal with each."""
    centered = signals - signals.mean(axis=1, keepdims=True)
    products = centered @ centered.T
    lengths = np.sqrt(np.diag(products))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlated: Array = products / np.outer(lengths, lengths)
    return correlated


def log_spectra(signal: Array, window: int) -> Array:
    """Take the spectra of windows that overlap by half."""
    frames = np.lib.stride_tricks.sliding_window_view(signal, window)[:: window // 2]
    power = np.abs(np.fft.rfft(frames * np.hanning(window), axis=1)) ** 2
    if not power.any():
        return np.full(power.shape, -DYNAMICS_DB)
    return np.maximum(decibel(power / power.max()), -DYNAMICS_DB)


def spectral_distances(spectra: Sequence[Array]) -> Array:
    """Take the mean square over time of the difference of log spectra."""
    squares = np.zeros((len(spectra), len(spectra), spectra[0].shape[1]))
    for one, other in combinations(range(len(spectra)), 2):
        difference = spectra[one] - spectra[other]
        difference -= difference.mean()  # a factor between the two
        squares[one, other] = squares[other, one] = np.mean(difference**2, axis=0)
    return squares


def contrasts(powers: Array, events: Sequence[tuple[int, int]]) -> Array:
    """Compare the mean power in events to that of the rest."""
    inside = np.zeros(powers.shape[1], dtype=bool)
    for start, stop in events:
        inside[start:stop] = True
    if inside.all() or not inside.any():
        return np.full(len(powers), np.nan)
    with np.errstate(invalid="ignore", divide="ignore"):
        return decibel(powers[:, inside].mean(axis=1) / powers[:, ~inside].mean(axis=1))


@dataclass(frozen=True, eq=False)
class Estimates:
    """The noise of one motion by several kinds of estimates.

    Attributes:
        kinds: The kinds.
        names: The links.
        pressure: Pressure over time to some scale, shape (kinds, samples).
        power: Its square, shape (kinds, samples).
        energy: Energy of each link to some scale, shape (kinds, links).
        terms: Share of A, B and C of each link in the energy of "paper", shape (links, 3).
    """

    kinds: tuple[str, ...]
    names: tuple[str, ...]
    pressure: Array
    power: Array
    energy: Array
    terms: Array

    def compared(self, rate: float, events: Sequence[tuple[int, int]] = ()) -> Comparison:
        """How the kinds differ."""
        window = _window(rate)
        spectra = [log_spectra(np.sqrt(power), window) for power in self.power]
        squares = spectral_distances(spectra)
        return Comparison(
            kinds=self.kinds,
            names=self.names,
            correlation=correlation(envelopes(self.power, round(ENVELOPE * rate))),
            distance=np.sqrt(squares.mean(axis=2)),
            frequency=np.arange(window // 2 + 1) * rate / window,
            distance_by_frequency=np.sqrt(squares),
            contrast=contrasts(self.power, events),
            shares=self.energy / np.maximum(self.energy.sum(axis=1, keepdims=True), TINY),
            terms=self.terms,
        )


def estimates(robot: Robot, surface: Surface, q: Real, v: Real, kinds: Sequence[str]) -> Estimates:
    """Estimate the noise of one motion by several kinds."""
    pressure, power, energy = {}, {}, {}
    links = len(surface.links)
    for kind in kinds:
        pressure[kind], power[kind], energy[kind] = (
            np.empty(len(q)),
            np.empty(len(q)),
            np.zeros(links),
        )
    if SIMPLIFIED in kinds:
        pressure[SIMPLIFIED] = simplified(v)
        power[SIMPLIFIED] = pressure[SIMPLIFIED] ** 2
        energy[SIMPLIFIED] = _joint_energy(robot, surface, v)
    extended = [kind for kind in power if kind != SIMPLIFIED]
    alone = [kind for kind in extended if kind not in ("paper", *TERMS)]
    terms: Array = np.zeros((links, len(TERMS)))
    for start in range(0, len(q), CHUNK):
        rows = slice(start, start + CHUNK)
        speeds = {
            kind: chunk_speeds(robot, surface, q[rows], v[rows], kind) for kind in (*TERMS, *alone)
        }
        each = np.array([speeds[term] for term in TERMS])
        speeds["paper"] = each.sum(axis=0)  # v = A + B + C, Sec. II-A
        # (A + B + C)² = (A + B + C) A + (A + B + C) B + (A + B + C) C
        terms += np.einsum("l,ls,tls->lt", surface.area, speeds["paper"], each)
        for kind in extended:
            radiated = sound_power(speeds[kind] ** 2, surface.area[:, None]).T
            power[kind][rows] = radiated.sum(axis=1)
            energy[kind] += radiated.sum(axis=0)
    for kind in extended:
        pressure[kind] = np.sqrt(power[kind])
    return Estimates(
        kinds=tuple(kinds),
        names=surface.names,
        pressure=np.array([pressure[kind] for kind in kinds]),
        power=np.array([power[kind] for kind in kinds]),
        energy=np.array([energy[kind] for kind in kinds]),
        terms=terms / max(terms.sum(), TINY),
    )


def check_length(samples: int, rate: float) -> None:
    """Refuse a motion that is shorter than one spectrum."""
    window = _window(rate)
    if window < 4 or samples < window:
        raise NoiseModelError(
            f"{samples} samples at {rate:g} Hz, expected {WINDOW:g} s at least and 40 Hz"
        )


def _window(rate: float) -> int:
    return round(WINDOW * rate)


def _joint_energy(robot: Robot, surface: Surface, v: Real) -> Array:
    """Sum the squared velocities of each link's joint; a joint that follows one has none."""
    squares = np.einsum("sj,sj->j", v, v, dtype=np.float64)
    energy = np.zeros(len(surface.links))
    for link, index in enumerate(surface.joint):
        joint = robot.joints[index - 1]
        if joint.name not in robot.mimics:
            energy[link] = squares[joint.first_v : joint.first_v + joint.nv].sum()
    return energy


# The motion of each robot.


def excitation(robot: Robot, *, seed: int = 0, rate: float = RATE) -> Run:
    """Motion of any robot without a simulator: slow sines, ripple, two shakes, a jerk.

    Every joint follows three slow sines with a small ripple at all frequencies above, as of real
    drives. A floating base moves in the same way at a tenth of the speed. There are three events:

    - ``shake-near`` and ``shake-far``: the joint that carries most of the robot and the one at the
      end of the longest chain vibrate, one after the other, equally fast and at one frequency. The
      simplified noise does not distinguish them;
    - ``jerk``: the speed of all joints jumps within one sample, and the jump decays.

    Positions keep to the limits of the robot: the motion of a joint with a small range or speed is
    scaled down. Joints that mimic another one follow it; the base's pose stays at the origin.

    Args:
        rate: Sample rate, in [Hz]; its Nyquist frequency has to be above that of the shakes.
    """
    if not 2.0 * SHAKE_HZ[1] < rate < np.inf:
        raise NoiseModelError(
            f"the excitation at {rate:g} Hz, expected above {2.0 * SHAKE_HZ[1]:g} Hz: its shakes"
            f" have up to {SHAKE_HZ[1]:g} Hz"
        )
    if seed < 0:
        raise NoiseModelError(f"seed is {seed}, expected 0 or more")
    random = np.random.default_rng(seed)
    time = np.arange(round(SECONDS * rate)) / rate
    joints = {joint.name: joint for joint in robot.joints if joint.name in robot.joint_names}
    speed = np.array([NOMINAL_SPEED.get(joint.kind, 1.0) for joint in joints.values()])
    velocity = _motion(time, len(joints), random, rate) * speed
    limits = limits_of(robot)
    bounds = [limits[name] for name in robot.joint_names]
    ranges = np.array([each.upper - each.lower for each in bounds])
    centre = np.array([each.centre for each in bounds])
    fastest = np.array([each.velocity for each in bounds])
    position = np.cumsum(velocity, axis=0) / rate
    low, high = position.min(axis=0), position.max(axis=0)
    scale = np.minimum(1.0, USABLE * ranges / (high - low))
    scale = np.minimum(scale, USABLE * fastest / abs(velocity).max(axis=0))
    velocity = velocity * scale
    hertz = random.uniform(*SHAKE_HZ)
    blocks = [Block(*JERK, "jerk")]
    for (label, (start, stop)), joint in zip(SHAKES.items(), ends(robot), strict=False):
        column = robot.joint_names.index(joint)
        velocity[:, column] += SHAKE * _burst(time, start, stop, hertz)
        blocks.append(Block(start, stop, label))
    base = BASE_SPEED * _motion(time, 6, random, rate) if robot.floating_base else None
    return Run(
        time=time,
        velocity=velocity,
        position=centre + np.cumsum(velocity, axis=0) / rate - scale * (low + high) / 2,
        base_velocity=base,
        joint_names=robot.joint_names,
        robot=robot.name if is_name(robot.name) else str(robot.path),
        blocks=tuple(blocks),
        meta={"scenario": "excitation", "seed": seed},
    )


def ends(robot: Robot) -> tuple[str, ...]:
    """Names of the joint that carries most and the one at the end of the longest chain."""
    depth, load = np.zeros((2, len(robot.joints) + 1), dtype=int)
    for index, joint in enumerate(robot.joints, start=1):
        depth[index] = depth[joint.parent] + 1
    for index in range(len(robot.joints), 0, -1):
        load[robot.joints[index - 1].parent] += load[index] + 1
    turning = [
        index
        for index, joint in enumerate(robot.joints, start=1)
        if joint.kind in ("revolute", "continuous") and joint.name not in robot.mimics
    ]
    if not turning:
        return ()
    near = max(turning, key=lambda index: (load[index], -depth[index]))
    far = max(turning, key=lambda index: (depth[index], -load[index]))
    return tuple(dict.fromkeys(robot.joints[index - 1].name for index in (near, far)))


def _motion(time: Array, axes: int, random: "np.random.Generator", rate: float) -> Array:
    """Slow sines, ripple and jerk of each axis at a nominal speed of 1, shape (samples, axes)."""
    slow = _sines(time, axes, random)
    ripple = RIPPLE * _ripple(len(time), axes, random, rate)
    jump = 0.5 * (time >= JERK[0]) * np.exp((JERK[0] - time) / JERK_DECAY)
    velocity: Array = slow + ripple + jump[:, None] * random.choice([-1.0, 1.0], axes)
    return velocity


def _sines(time: Array, axes: int, random: "np.random.Generator") -> Array:
    """Sum slow sines, spread evenly over octaves, to a mean square of 1, shape (samples, axes)."""
    hertz = np.exp(random.uniform(np.log(SINES_HZ[0]), np.log(SINES_HZ[1]), (SINES, axes)))
    phase = random.uniform(0.0, 2.0 * np.pi, (SINES, axes))
    sines: Array = np.sin(2.0 * np.pi * time[:, None, None] * hertz + phase).sum(axis=1)
    return sines * float(np.sqrt(2.0 / SINES))


def _ripple(samples: int, axes: int, random: "np.random.Generator", rate: float) -> Array:
    """Make noise with a mean square of 1, shape (samples, axes)."""
    hertz = np.fft.rfftfreq(samples, 1.0 / rate)
    white = np.fft.rfft(random.standard_normal((samples, axes)), axis=0)
    slope = np.where(hertz < RIPPLE_HZ, 0.0, 1.0 / np.sqrt(np.maximum(hertz, RIPPLE_HZ)))
    pink: Array = np.fft.irfft(white * slope[:, None], n=samples, axis=0)
    ripple: Array = pink / np.sqrt(np.mean(pink**2, axis=0))
    return ripple


def _burst(time: Array, start: float, stop: float, hertz: float) -> Array:
    """A sine with a Hann envelope between two times, shape (samples,)."""
    place = np.clip((time - start) / (stop - start), 0.0, 1.0)
    burst: Array = np.sin(np.pi * place) ** 2 * np.sin(2.0 * np.pi * hertz * time)
    return burst


BUILT_IN: Mapping[str, Callable[..., Run]] = MappingProxyType({EXCITATION: excitation})
"""The built-in motions: each takes a robot, a seed and a rate in [Hz], and returns a run."""


@dataclass(frozen=True, eq=False)
class Moving:
    """A robot and its motion.

    Attributes:
        robot: The robot.
        joints: How many joints the motion has.
        q: Configurations, shape (samples, nq).
        v: Velocities, shape (samples, nv).
        time: Of the samples, shape (samples,), in [s].
        rate: Sample rate, in [Hz].
        events: What should stand out.
        remarks: What is left out or assumed, a sentence each.
    """

    robot: Robot
    joints: int
    q: Real
    v: Real
    time: Array
    rate: float
    events: tuple[Block, ...] = ()
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Task:
    """A robot that has not been read yet, and what moves it.

    Attributes:
        name: The robot, or the run file.
        source: The robot, or the run that names it.
        motion: Its motion; None for a run, which brings its own.
        rate: Sample rate of a pair or a built-in motion, in [Hz].
        seed: Random seed of a built-in motion.
    """

    name: str
    source: Source
    motion: Motion | None
    rate: float | None
    seed: int

    def moving(self) -> Moving:
        """Read the robot and move it."""
        source, motion = self.source, self.motion
        if isinstance(source, Run):
            motion = source
        elif motion is None:
            assert not isinstance(source, Robot)
            motion = Run.load(source)
        if isinstance(motion, Run):
            return _measured(source, motion)
        if isinstance(motion, str):
            robot, remarks = _coupled(source)
            rate = RATE if self.rate is None else self.rate
            run = BUILT_IN[motion](robot, seed=self.seed, rate=rate)
            return _of_run(robot, run, remarks)
        robot, (q, v) = _read(source), motion
        check_motion(robot, q, v)
        assert self.rate is not None
        time = np.arange(len(q)) / self.rate
        return Moving(robot, len(robot.joint_names), q, v, time, self.rate)


def tasks(
    robots: Source | Iterable[Source], motion: Motions, *, rate: float | None, seed: int
) -> list[Task]:
    """Match motions to robots; nothing is read yet."""
    sources = [robots] if isinstance(robots, Source) else list(robots)
    if not sources:
        raise NoiseModelError("no robots to compare")
    for source in sources:
        if not isinstance(source, Source):
            raise NoiseModelError(
                f"a robot is of type {type(source).__name__}, expected a Robot, a listed name, the"
                " path of a URDF, or a run"
            )
    motions = _motions(motion, [_name(source) for source in sources if not _is_run(source)])
    if rate is not None and all(isinstance(one, Run) for one in motions):
        raise NoiseModelError(f"a rate of {rate:g} Hz is given, but runs have their own")
    if rate is None and any(_is_pair(one) for one in motions):
        raise NoiseModelError("a motion of q and v needs the rate of its samples, in Hz")
    if seed < 0:
        raise NoiseModelError(f"seed is {seed}, expected 0 or more")
    rest = iter(motions)
    return [
        Task(_name(source), source, None if _is_run(source) else next(rest), rate, seed)
        for source in sources
    ]


def _motions(motion: Motions, names: Sequence[str]) -> list[Motion]:
    """List the motion of each robot."""
    motions: list[Any]
    if isinstance(motion, Mapping):
        named = {_name(key): one for key, one in motion.items()}
        if set(named) != set(names):
            raise NoiseModelError(
                f"motions are for {', '.join(named) or 'no robot'},"
                f" expected one for each of {', '.join(names)}"
            )
        motions = [named[name] for name in names]
    elif isinstance(motion, list | tuple) and not _is_pair(motion):
        motions = list(motion)
        if len(motions) != len(names):
            raise NoiseModelError(f"{len(motions)} motions for {len(names)} robots")
    else:
        motions = [motion] * len(names)
    for one in motions:
        if isinstance(one, str) and one not in BUILT_IN:
            raise NoiseModelError(
                f"no built-in motion {one!r}; there is {', '.join(BUILT_IN)};"
                " expected such a name, a Run, or a pair (q, v)"
            )
        if not isinstance(one, str | Run) and not _is_pair(one):
            raise NoiseModelError(
                f"a motion is of type {type(one).__name__}, expected a Run, a pair (q, v), or the"
                f" name of a built-in one: {', '.join(BUILT_IN)}"
            )
    return motions


def _is_pair(motion: object) -> bool:
    """Whether a motion is a pair of arrays; a sequence of motions is none."""
    return (
        isinstance(motion, list | tuple)
        and len(motion) == 2
        and all(isinstance(array, np.ndarray) for array in motion)
    )


def _is_run(source: Source) -> bool:
    """Whether a source is a run or a run file."""
    if isinstance(source, Path):
        return not is_robot_file(source.name)
    return isinstance(source, Run) or (isinstance(source, str) and source.endswith(".npz"))


def _name(source: Source) -> str:
    if isinstance(source, Robot):
        return source.name
    return source.robot or "run" if isinstance(source, Run) else str(source)


def _read(source: Source, *, floating_base: bool | None = None, mimic: bool = False) -> Robot:
    if isinstance(source, str | Path):
        return Robot.load(source, floating_base=floating_base, mimic=mimic)
    assert isinstance(source, Robot)
    return source


def _coupled(source: Source) -> tuple[Robot, tuple[str, ...]]:
    """Read a robot with its mimic joints coupled, if they can be."""
    try:
        return _read(source, mimic=True), ()
    except RobotError:
        robot = _read(source)  # a mimic joint may name one that the URDF does not have
        return robot, ("Its mimic joints cannot be coupled: they move independently.",)


def _measured(source: Source, run: Run) -> Moving:
    """Move a robot as a run did in its longest stretch without gaps."""
    if _is_run(source):
        if run.robot is None:
            raise RunError("the run names no robot; `inspector import --robot` adds one")
        source = run.robot
    if run.position is None:
        raise RunError("the run has no positions, which the extended noise needs")
    floating = run.base_pose is not None or run.base_velocity is not None
    robot = _read(source, floating_base=True if floating else None)
    remarks = []
    if not run.mask.all():
        run = _longest(run)
        remarks.append(f"The run has gaps: compared from {run.time[0]:.2f} s on.")
    missing = [joint for joint in robot.joint_names if joint not in run.joint_names]
    if missing:
        remarks.append(f"Not in the log, assumed stationary: {', '.join(missing)}.")
    return _of_run(robot, run, tuple(remarks))


def _of_run(robot: Robot, run: Run, remarks: tuple[str, ...]) -> Moving:
    q, v = robot.configuration(run)
    events = tuple(block for block in run.blocks if block.label != "ok")
    return Moving(robot, len(run.joint_names), q, v, run.time, run.rate, events, remarks)


def _longest(run: Run) -> Run:
    """Cut the longest stretch without a gap out of a run, with the blocks that lie in it."""
    parts = stretches(run.mask, len(run.time))
    longest = max(parts, key=lambda each: each.stop - each.start, default=slice(0, 1))
    time = run.time[longest]
    within = [b for b in run.blocks if b.start >= time[0] and b.stop <= time[-1]]
    return part(run, longest.start, longest.stop, blocks=tuple(within))


@overload
def compare(
    robots: Robot,
    q: Real,
    v: Real,
    kinds: Sequence[str] = ...,
    *,
    rate: float,
    surface: Surface | str | None = ...,
    events: Sequence[tuple[int, int]] = ...,
) -> Comparison: ...


@overload
def compare(
    robots: Source | Iterable[Source],
    *,
    motion: Motions | None = ...,
    kinds: Sequence[str] = ...,
    rate: float | None = ...,
    surface: Surface | str | None = ...,
    seed: int = ...,
    jobs: Jobs = ...,
    progress: Progress | None = ...,
) -> Comparisons: ...


def compare(
    robots: Source | Iterable[Source],
    q: Real | None = None,
    v: Real | None = None,
    kinds: Sequence[str] = COMPARED,
    *,
    motion: Motions | None = None,
    rate: float | None = None,
    surface: Surface | str | None = None,
    events: Sequence[tuple[int, int]] = (),
    seed: int = 0,
    jobs: Jobs = 1,
    progress: Progress | None = None,
) -> Comparison | Comparisons:
    """Comparison of kinds of noise estimates, on the motions of one robot or many.

    All estimates are compared as pressures, whose scale is arbitrary: a factor between two kinds
    changes neither their correlation nor their distance. Each kind is evaluated once. The kinds
    are those of F. Sygulla and D. Rixen, "Learning the Noise of Failure", Sec. II-A, and of
    ``surface_speed``.

    ``compare(robot, q, v, kinds, rate=rate)`` compares on one motion of one ``Robot``.
    ``compare(robots, motion=..., kinds=...)`` compares on one robot or many. It leaves out robots
    that cannot be read or have no surface, and runs that do not suffice, and lists them with the
    reason.

    Args:
        robots: One or many: a ``Robot``, a name, or the path of a URDF or an MJCF; or a
            ``Run``, or the path of a run file (a ``Path``, or text that ends in ``.npz``), for the
            robot that it names and the motion that it holds. Of a run with gaps the longest stretch
            without one is compared.
        q: Configurations as Pinocchio has them, shape (samples, nq), in [rad] and [m].
        v: Velocities as Pinocchio has them, shape (samples, nv), in [rad/s] and [m/s].
        kinds: "simplified", or kinds of ``surface_speed``.
        motion: A ``Run``, a pair ``(q, v)``, or the name of a built-in motion: "excitation", the
            default, see `excitation`. One for all robots, a list with one for each, or
            a mapping from each robot's name to its motion. Robots that are named are read as
            ``Robot.load(name)`` does; for built-in motions their mimic joints are coupled.
        rate: Sample rate of ``q`` and ``v``, or of built-in motions, where it is 4000 Hz unless
            given, in [Hz]. A run has its own.
        surface: The surface of the robot, or the geometry that surfaces are taken from: "visual",
            "collision", "hull" or "auto". Unless given, "visual" with ``q`` and ``v``, else "auto".
        events: With ``q`` and ``v``: first sample and the one after the last of what should stand
            out. The events of a run are its blocks that are not "ok".
        seed: Random seed of built-in motions.
        jobs: How many robots to compare at once, or the address of a Dask scheduler.
        progress: Shows the progress; takes an iterable and its length ``total``, and passes the
            items on, as ``tqdm`` does.

    Returns:
        With ``q`` and ``v`` one ``Comparison``; else ``Comparisons``, in the order of the robots.

    Raises:
        UnknownKindError: If a kind does not exist.
        MotionError: If ``q`` or ``v`` are of another shape than the robot's, or not finite.
        GeometryError: If a geometry does not exist, or one surface is given for many robots; with
            ``q`` and ``v`` also if the surface cannot be read or is that of another robot.
        NoiseModelError: If fewer than two kinds are given or one repeats, the motions are not one
            for each robot, or a rate is missing or superfluous; with ``q`` and ``v`` also if the
            motion is shorter than one spectrum, 0.1024 s.
    """
    kinds = (kinds,) if isinstance(kinds, str) else tuple(kinds)
    known = (SIMPLIFIED, *KINDS)
    for kind in kinds:
        if kind not in known:
            raise UnknownKindError(kind, known)
    if rate is not None:
        check_positive("rate", rate, "Hz")
    if q is not None or v is not None:
        if not kinds:
            raise NoiseModelError(f"no kinds to compare, expected some of {', '.join(known)}")
        if q is None or v is None or rate is None or motion is not None:
            raise NoiseModelError("expected q, v and their rate, and no other motion")
        if not isinstance(robots, Robot):
            raise NoiseModelError("q and v are given; expected one Robot, or motion=(q, v)")
        check_motion(robots, q, v)
        check_stretches(events, len(q))
        check_length(len(q), rate)
        geometry = "visual" if surface is None else surface
        return estimates(robots, _of(robots, geometry), q, v, kinds).compared(rate, events)
    if len(set(kinds)) < max(2, len(kinds)):
        raise NoiseModelError(
            f"kinds to compare are {', '.join(kinds)}; expected two different ones or more"
        )
    if len(events):
        raise NoiseModelError("events are samples of q and v; those of a run are its blocks")
    if isinstance(jobs, int) and jobs < 1:
        raise NoiseModelError(f"jobs is {jobs}, expected 1 or more")
    todo = tasks(robots, EXCITATION if motion is None else motion, rate=rate, seed=seed)
    geometry = "auto" if surface is None else surface
    _check_geometry(geometry, len(todo))
    results: Iterable[RobotComparison | LeftOut]
    one = partial(_attempt, kinds=kinds, surface=geometry)
    results = in_order(one, todo, jobs=jobs, died=_died)
    return Comparisons.of(results if progress is None else progress(results, total=len(todo)))


def _check_geometry(surface: Surface | str, robots: int) -> None:
    if isinstance(surface, Surface):
        if robots > 1:
            raise GeometryError(f"one surface for {robots} robots, expected a geometry's name")
    elif surface not in GEOMETRIES:
        raise GeometryError(
            f"geometry {surface!r} is not known, expected one of {', '.join(GEOMETRIES)}"
        )


def _attempt(task: Task, kinds: Sequence[str], surface: Surface | str) -> RobotComparison | LeftOut:
    try:
        return _compare(task.name, task.moving(), kinds, surface)
    except MotionError as error:  # of a pair, which the caller made
        raise MotionError(f"{task.name}: {error}") from error
    except NoiseModelError as error:
        return LeftOut(task.name, str(error).removeprefix(f"{task.name}: "))


def _died(task: Task) -> LeftOut:
    return LeftOut(task.name, DIED)


def _compare(
    name: str, moving: Moving, kinds: Sequence[str], surface: Surface | str
) -> RobotComparison:
    robot, rate = moving.robot, moving.rate
    check_length(len(moving.q), rate)
    surface, geometry = _of(robot, surface), surface
    if not surface.area.any():
        raise GeometryError(f"no link has a surface by geometry {geometry!r}")
    found = estimates(robot, surface, moving.q, moving.v, kinds)
    rms = np.sqrt(np.mean(found.pressure**2, axis=1, keepdims=True))
    return RobotComparison(
        name=name,
        floating_base=robot.floating_base,
        joints=moving.joints,
        time=moving.time,
        rate=rate,
        events=moving.events,
        comparison=found.compared(rate),
        pressure=found.pressure / np.where(rms > 0.0, rms, 1.0),
        contrast=_contrasts(found.pressure, moving),
        links_with_surface=len(surface.names) - len(surface.without_geometry),
        remarks=moving.remarks,
    )


def _of(robot: Robot, surface: Surface | str) -> Surface:
    if isinstance(surface, str):
        return Surface.of(robot, surface)
    check_surface(surface, robot)
    return surface


def _contrasts(pressure: Array, moving: Moving) -> Array:
    """Compare the events to the rest above 10 Hz, shape (kinds, events), in [dB]."""
    time = moving.time
    power = vibrating(pressure.T, np.ones(len(time), dtype=bool), moving.rate).T ** 2
    inside = [(time >= event.start) & (time < event.stop) for event in moving.events]
    rest = ~np.any([np.zeros(len(time), dtype=bool), *inside], axis=0)
    if not inside or not rest.any():
        return np.full((len(power), len(inside)), np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        energy = np.array([power[:, event].sum(axis=1) / event.sum() for event in inside]).T
        return decibel(energy / power[:, rest].mean(axis=1, keepdims=True))
