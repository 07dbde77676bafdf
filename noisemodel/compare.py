"""Kinds of noise estimates side by side, on one robot or many, on runs or an excitation motion."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations, product
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from noisemodel.noise import (
    CHUNK,
    KINDS,
    assumed,
    chunk_speeds,
    decibel,
    simplified,
    sound_power,
    vibrating,
)
from noisemodel.parallel import DIED, Jobs, in_order
from noisemodel.robot import Robot, is_name, limits_of
from noisemodel.run import Block, Run, is_robot_file, stretches
from noisemodel.surface import GEOMETRIES, TINY, Surface
from noisemodel.types import (
    Array,
    GeometryError,
    Mask,
    NoiseModelError,
    Real,
    RobotError,
    RunError,
    UnknownKindError,
)

if TYPE_CHECKING:
    import pyarrow

SIMPLIFIED = "simplified"

# The kinds that are compared unless others are named.
COMPARED = (SIMPLIFIED, "C", "paper", "mean", "rms", "normal")
TERMS = ("A", "B", "C")  # the terms of the paper's mean speed
REFERENCES = ("normal", "mean")  # the others are compared with the first of these, if it is there

# Parts of the spectrum for which distances are given one by one, in [Hz].
BANDS = {
    "0-20 Hz": (0.0, 20.0),
    "20-100 Hz": (20.0, 100.0),
    "100-500 Hz": (100.0, 500.0),
    "500 Hz up": (500.0, np.inf),
}
ENVELOPE = 0.02  # stretch of time whose root mean square is one value of the envelope, in [s]
WINDOW = 0.1024  # length of a spectrum's Hann window, in [s]: the paper's 1024 samples at 10 kHz
DYNAMICS_DB = 100.0  # what lies further below a signal's loudest line counts as this far below
GROUP = 3  # fewest robots that the table gives a median of
NAME = 26  # width of a robot's name in print
SECONDS = 6.0
RATE = 4000.0  # sample rate of the excitation, in [Hz]
NOMINAL_SPEED = {"prismatic": 0.3}  # of the slow sines, in [m/s]; of joints that turn it is 1 rad/s
BASE_SPEED = 0.1  # speed of a floating base, in [m/s] and [rad/s]
SINES, SINES_HZ = 3, (0.1, 0.8)
RIPPLE = 0.01  # root mean square of the ripple, as a share of the joint's nominal speed
RIPPLE_HZ = 10.0  # lowest frequency of the ripple, which has the same power in each octave above
USABLE = 0.9  # share of its range and of its speed that a joint uses at most
SHAKE = 0.2  # amplitude of a shake, in [rad/s]
SHAKE_HZ = (40.0, 200.0)
SHAKES = {"shake-near": (1.0, 1.8), "shake-far": (2.6, 3.4)}
JERK = (4.6, 4.8)
JERK_DECAY = 0.03  # time constant of the decay of the jump, in [s]

# A robot, its listed name or the path of its URDF or MJCF; or a run, or the path of a run file.
Source: TypeAlias = Robot | Run | Path | str
# Takes an iterable and its length (``total``), and yields its items, as tqdm does.
Progress: TypeAlias = Callable[..., "Iterable[Comparison | LeftOut]"]


# The results, and how they print.


@dataclass(frozen=True, eq=False)
class Comparison:
    """How kinds of noise estimates differ on one robot and its motion."""

    name: str  #: the robot, or the run file
    floating_base: bool
    joints: int  #: how many joints the motion has
    time: Array  #: of the samples, shape (samples,), in [s]
    rate: float  #: samples per second, in [Hz]
    events: tuple[Block, ...]  #: what should stand out: the run's blocks that are not "ok"
    kinds: tuple[str, ...]
    links: tuple[str, ...]  #: names
    links_with_surface: int
    #: Estimated by each kind, scaled to a root mean square of 1, shape (kinds, samples).
    pressure: Array
    #: Of the envelopes of each two kinds, (kinds, kinds); nan where an envelope does not change.
    correlation: Array
    #: Log-spectral distance of each two kinds: root mean square of the difference of their spectra
    #: over time and frequency, shape (kinds, kinds), in [dB].
    distance: Array
    frequency: Array  #: shape (frequency,), in [Hz]
    distance_by_frequency: Array  #: over time alone, shape (kinds, kinds, frequency)
    #: Mean square of the pressure above 10 Hz in each event, over that outside of all events,
    #: shape (kinds, events), in [dB].
    contrast: Array
    shares: Array  #: of each link in the energy, shape (kinds, links)
    #: Share of A, B and C of each link in the energy that "paper" gives the whole robot,
    #: (A + B + C)² being (A + B + C) A + (A + B + C) B + (A + B + C) C, shape (links, 3).
    terms: Array
    remarks: tuple[str, ...]  #: what the comparison leaves out, a sentence each

    @property
    def reference(self) -> int:
        """Index of the kind that the others are compared with: normal, else mean, else the last."""
        named = (self.kinds.index(kind) for kind in REFERENCES if kind in self.kinds)
        return next(named, len(self.kinds) - 1)

    @property
    def loudest(self) -> tuple[str, float]:
        """The link with the largest share in the energy of the reference, and that share.

        It is "-" of a robot that makes no noise.
        """
        shares = self.shares[self.reference]
        name = self.links[shares.argmax()] if shares.any() else "-"
        return name, float(shares.max())

    def by_band(self, kind: int) -> Array:
        """Spectral distance of a kind to the reference in each of ``BANDS``, in [dB], or nan."""
        squares = self.distance_by_frequency[kind, self.reference] ** 2
        inside = [(self.frequency >= low) & (self.frequency < high) for low, high in BANDS.values()]
        return np.sqrt(_means(squares, inside))

    def by_label(self, kind: int, labels: Sequence[str]) -> Array:
        """Mean contrast of a kind in the events with each label, in [dB]; nan without any."""
        own = np.array([event.label for event in self.events])
        return _means(self.contrast[kind], [own == label for label in labels])

    def rows(self, labels: Sequence[str]) -> Iterator[dict[str, str | bool | int | float]]:
        """Rows of ``Comparisons.to_arrow``, one for each kind; ``labels`` have a column each."""
        shares = zip(TERMS, self.terms.sum(axis=0).tolist(), strict=True)
        bands = [f"distance_{band.replace(' Hz', '')}_db" for band in BANDS]
        columns = [band.replace("-", "_").replace(" ", "_") for band in bands]
        facts = {
            "name": self.name,
            "floating_base": self.floating_base,
            "joints": self.joints,
            "links": len(self.links),
            "links_with_surface": self.links_with_surface,
            "rate_hz": self.rate,
            **{f"share_{term}": share for term, share in shares},
        }
        for index, kind in enumerate(self.kinds):
            distances = zip(columns, self.by_band(index).tolist(), strict=True)
            contrasts = zip(labels, self.by_label(index, labels).tolist(), strict=True)
            loudest = int(self.shares[index].argmax())
            yield {
                **facts,
                "kind": kind,
                "reference": self.kinds[self.reference],
                "correlation": float(self.correlation[index, self.reference]),
                "distance_db": float(self.distance[index, self.reference]),
                **dict(distances),
                **{f"contrast_{label}_db": contrast for label, contrast in contrasts},
                "loudest_share": float(self.shares[index, loudest]),
                "loudest_link": self.links[loudest],
            }

    def __str__(self) -> str:
        return str(Comparisons((self,)))


@dataclass(frozen=True)
class LeftOut:
    """A robot or a run that could not be compared."""

    name: str  #: the robot, or the run file
    reason: str  #: why not, in one line

    def __str__(self) -> str:
        return f"{self.name}: left out: {self.reason}"


@dataclass(frozen=True, eq=False)
class Comparisons:
    """Kinds of noise estimates compared on many robots; it prints as a table."""

    robots: tuple[Comparison, ...]  #: what could be compared, in the order of the robots
    left_out: tuple[LeftOut, ...] = ()  #: what could not, and why

    def __len__(self) -> int:
        return len(self.robots)

    def __iter__(self) -> Iterator[Comparison]:
        return iter(self.robots)

    def __getitem__(self, index: int) -> Comparison:
        return self.robots[index]

    @property
    def labels(self) -> tuple[str, ...]:
        """The labels of all events, in the order in which they come."""
        return tuple(dict.fromkeys(event.label for one in self for event in one.events))

    def to_arrow(self) -> "pyarrow.Table":
        """Tabulate a row for each robot and kind; nan where a number does not exist.

        Columns are named after the fields of `Comparison`, and their units. If every robot was left
        out, it is a NoiseModelError.
        """
        import pyarrow

        if not self.robots:
            raise NoiseModelError(f"no robot was compared; {'; '.join(map(str, self.left_out))}")
        labels = self.labels
        return pyarrow.Table.from_pylist([row for one in self for row in one.rows(labels)])

    def __str__(self) -> str:
        lines = [*_by_robot(self), "", *_by_kind(self)] if self.robots else []
        lines += [f"{one.name}: {remark}" for one in self for remark in one.remarks]
        return "\n".join([*lines, *map(str, self.left_out)])


def medians(rows: Sequence[Array]) -> Array:
    """Median of each column over the rows, each of shape (columns,), that have a number there."""
    finite = [column[np.isfinite(column)] for column in np.array(rows).T]
    return np.array([np.median(column) if len(column) else np.nan for column in finite])


def _means(values: Array, parts: Sequence[Mask]) -> Array:
    """Mean of some values of each part, nan without any."""
    return np.array([values[part].mean() if part.any() else np.nan for part in parts])


def _by_robot(found: Comparisons) -> Iterator[str]:
    """A line for each robot, and for the medians of fixed and floating ones."""
    kinds, reference = found[0].kinds, found[0].reference
    others = [kind for kind in kinds if kind != kinds[reference]]
    groups, names, loudest = [], [], []
    for one in found:
        short = one.name if len(one.name) <= NAME else f"…{one.name[1 - NAME :]}"  # paths end apart
        groups.append([one])
        names.append(f"{short:{NAME}} {'F' if one.floating_base else ' '}")
        loudest.append(f"  {one.loudest[1]:4.0%} {one.loudest[0]}")
    for floating, word in ((False, "fixed"), (True, "floating")):
        group = [one for one in found if one.floating_base == floating]
        if len(group) >= GROUP:
            groups.append(group)
            names.append(f"median of {len(group)} {word}")
            loudest.append("")

    def rows(numbers: Callable[[Comparison], Array]) -> list[Array]:
        return [medians([numbers(one) for one in group]) for group in groups]

    terms = rows(lambda one: one.terms.sum(axis=0))
    correlations = rows(lambda one: np.delete(one.correlation[reference], reference))
    distances = rows(lambda one: np.delete(one.distance[reference], reference))
    yield f"Reference {kinds[reference]!r}; F: floating base; last: the loudest link"
    yield from _beside(
        names,
        _columns("share in paper", TERMS, terms, ".0%"),
        _columns("correlation", others, correlations, ".2f", least=6),
        _columns("distance [dB]", others, distances, ".1f"),
        ["", "", *loudest],
    )


def _by_kind(found: Comparisons) -> Iterator[str]:
    """A line for each kind: distance by frequency and contrast of events, medians of all robots."""
    kinds, labels = found[0].kinds, found.labels
    indices = range(len(kinds))
    apart = [medians([one.by_band(index) for one in found]) for index in indices]
    contrast = [medians([one.by_label(index, labels) for one in found]) for index in indices]
    parts = [_columns("distance by frequency [dB]", tuple(BANDS), apart, ".1f")]
    if labels:
        parts.append(_columns("contrast of events above 10 Hz [dB]", labels, contrast, ".1f"))
    yield f"Of all {len(found)}, medians" if len(found) > 1 else "By kind"
    yield from _beside(kinds, *parts)


def _columns(
    title: str, names: Sequence[str], rows: Sequence[Array], form: str, *, least: int = 5
) -> list[str]:
    """Lines of some columns of a table: title, names and numbers, with a dash for none."""
    widths = [max(least, len(name) + 1) for name in names]

    def line(words: Iterable[str]) -> str:
        return " " + "".join(f"{word:>{width}}" for word, width in zip(words, widths, strict=True))

    numbers = [[f"{x:{form}}" if np.isfinite(x) else "-" for x in row] for row in rows]
    return [f" {title:^{sum(widths)}}", line(names), *map(line, numbers)]


def _beside(names: Sequence[str], *parts: Sequence[str]) -> Iterator[str]:
    """Lines of a table: parts that are as long, to the right of the rows' names."""
    for name, *cells in zip(["", "", *names], *parts, strict=True):
        yield f"{name:{NAME + 2}}{''.join(cells)}".rstrip()


# The measures.


def envelope_correlation(powers: Array, stretch: int) -> Array:
    """Correlation of each two envelopes: root mean squares of the pressure in each stretch."""
    whole = powers.shape[1] // stretch * stretch
    envelopes = np.sqrt(powers[:, :whole].reshape(len(powers), -1, stretch).mean(axis=2))
    centered = envelopes - envelopes.mean(axis=1, keepdims=True)
    products = centered @ centered.T
    lengths = np.sqrt(np.diag(products))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(products / np.outer(lengths, lengths))


def log_spectra(signal: Array, window: int) -> Array:
    """Spectra of windows that overlap by half, shape (windows, frequency), in [dB]."""
    frames = np.lib.stride_tricks.sliding_window_view(signal, window)[:: window // 2]
    power = np.abs(np.fft.rfft(frames * np.hanning(window), axis=1)) ** 2
    if not power.any():
        return np.full(power.shape, -DYNAMICS_DB)
    return np.maximum(decibel(power / power.max()), -DYNAMICS_DB)


def spectral_distances(spectra: Sequence[Array]) -> Array:
    """Mean square over time of the difference of each two log spectra."""
    squares = np.zeros((len(spectra), len(spectra), spectra[0].shape[1]))
    for one, other in combinations(range(len(spectra)), 2):
        difference = spectra[one] - spectra[other]
        difference -= difference.mean()  # a factor between the two
        squares[one, other] = squares[other, one] = np.mean(difference**2, axis=0)
    return squares


def contrasts(pressure: Array, time: Array, rate: float, events: Sequence[Block]) -> Array:
    """Compare each event to what is outside of all above 10 Hz, shape (kinds, events), in [dB]."""
    power = vibrating(pressure.T, np.ones(len(time), dtype=bool), rate).T ** 2
    inside = [(time >= event.start) & (time < event.stop) for event in events]
    rest = ~np.any([np.zeros(len(time), dtype=bool), *inside], axis=0)
    if not inside or not rest.any():
        return np.full((len(power), len(inside)), np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        energy = np.array([power[:, event].sum(axis=1) / event.sum() for event in inside]).T
        return decibel(energy / power[:, rest].mean(axis=1, keepdims=True))


# The estimates of one motion, each kind evaluated once.


def _estimates(
    robot: Robot, surface: Surface, motions: Sequence[tuple[Real, Real]], kinds: Sequence[str]
) -> tuple[Array, Array, Array]:
    """Power, shape (kinds, samples), energy, (kinds, links), and shares of terms of all motions."""
    samples, links = len(motions[0][0]), len(surface.links)
    power, energy = np.zeros((len(kinds), samples)), np.zeros((len(kinds), links))
    terms: Array = np.zeros((links, len(TERMS)))
    chunks = [slice(start, start + CHUNK) for start in range(0, samples, CHUNK)]
    for (q, v), rows in product(motions, chunks):
        motion = (robot, surface, q[rows], v[rows])
        each = np.array([chunk_speeds(*motion, term) for term in TERMS])
        known = dict(zip(TERMS, each, strict=True))
        known["paper"] = each.sum(axis=0)  # v = A + B + C, Sec. II-A
        # (A + B + C)² = (A + B + C) A + (A + B + C) B + (A + B + C) C
        terms += np.einsum("l,ls,tls->lt", surface.area, known["paper"], each)
        for place, kind in enumerate(kinds):
            if kind != SIMPLIFIED:
                speed = known[kind] if kind in known else chunk_speeds(*motion, kind)
                radiated = sound_power(speed**2, surface.area[:, None]).T
                power[place, rows] += radiated.sum(axis=1)
                energy[place] += radiated.sum(axis=0)
    if SIMPLIFIED in kinds:
        place = kinds.index(SIMPLIFIED)
        power[place] = sum(simplified(v) ** 2 for _, v in motions)
        # Squared velocities of each link's joint; a joint that follows another one has none.
        squares = sum(np.einsum("sj,sj->j", v, v, dtype=np.float64) for _, v in motions)
        for link, index in enumerate(surface.joint):
            joint = robot.joints[index - 1]
            if joint.name not in robot.mimics:
                energy[place, link] = squares[joint.first_v : joint.first_v + joint.nv].sum()
    return power, energy, terms / max(terms.sum(), TINY)


# The motion of each robot.


def excitation(robot: Robot, *, seed: int = 0) -> Run:
    """Motion of any robot without a simulator: slow sines, ripple, two shakes, a jerk.

    Every joint follows three slow sines with a small ripple at all frequencies above, as of real
    drives; a floating base at a tenth of the speed. In ``shake-near`` and ``shake-far`` the joint
    that carries most of the robot and the one at the end of the longest chain vibrate equally,
    which the simplified noise does not distinguish; in ``jerk`` all joints jump within one sample.
    Motions are scaled down to the limits of the robot; its pose stays at the origin.
    """
    random = np.random.default_rng(seed)
    time = np.arange(round(SECONDS * RATE)) / RATE
    kinds = {joint.name: joint.kind for joint in robot.joints}
    speed = np.array([NOMINAL_SPEED.get(kinds[name], 1.0) for name in robot.joint_names])
    velocity = _motion(time, len(speed), random) * speed
    limits = limits_of(robot)
    bounds = [limits[name] for name in robot.joint_names]
    ranges = np.array([each.upper - each.lower for each in bounds])
    centre = np.array([each.centre for each in bounds])
    fastest = np.array([each.velocity for each in bounds])
    position = np.cumsum(velocity, axis=0) / RATE
    low, high = position.min(axis=0), position.max(axis=0)
    scale = np.minimum(1.0, USABLE * ranges / (high - low))
    scale = np.minimum(scale, USABLE * fastest / abs(velocity).max(axis=0))
    velocity = velocity * scale
    hertz = random.uniform(*SHAKE_HZ)
    blocks = [Block(*JERK, "jerk")]
    for (label, (start, stop)), joint in zip(SHAKES.items(), ends(robot), strict=False):
        place = np.clip((time - start) / (stop - start), 0.0, 1.0)
        burst = np.sin(np.pi * place) ** 2 * np.sin(2.0 * np.pi * hertz * time)  # a Hann envelope
        velocity[:, robot.joint_names.index(joint)] += SHAKE * burst
        blocks.append(Block(start, stop, label))
    base = BASE_SPEED * _motion(time, 6, random) if robot.floating_base else None
    return Run(
        time=time,
        velocity=velocity,
        position=centre + np.cumsum(velocity, axis=0) / RATE - scale * (low + high) / 2,
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


def _motion(time: Array, axes: int, random: "np.random.Generator") -> Array:
    """Slow sines, ripple and jerk of each axis at a nominal speed of 1, shape (samples, axes)."""
    # Sines that are spread evenly over octaves, with a mean square of 1
    hertz = np.exp(random.uniform(np.log(SINES_HZ[0]), np.log(SINES_HZ[1]), (SINES, axes)))
    phase = random.uniform(0.0, 2.0 * np.pi, (SINES, axes))
    sines = np.sin(2.0 * np.pi * time[:, None, None] * hertz + phase).sum(axis=1)
    sines = sines * float(np.sqrt(2.0 / SINES))
    # Pink noise with a mean square of 1
    hertz = np.fft.rfftfreq(len(time), 1.0 / RATE)
    white = np.fft.rfft(random.standard_normal((len(time), axes)), axis=0)
    slope = np.where(hertz < RIPPLE_HZ, 0.0, 1.0 / np.sqrt(np.maximum(hertz, RIPPLE_HZ)))
    pink = np.fft.irfft(white * slope[:, None], n=len(time), axis=0)
    ripple = RIPPLE * (pink / np.sqrt(np.mean(pink**2, axis=0)))
    jump = 0.5 * (time >= JERK[0]) * np.exp((JERK[0] - time) / JERK_DECAY)
    return np.asarray(sines + ripple + jump[:, None] * random.choice([-1.0, 1.0], axes))


def moving(source: Source, seed: int = 0) -> tuple[Robot, Run, tuple[str, ...]]:
    """A robot, its motion, and what that leaves out, a sentence each."""
    remarks = []
    if not _is_run(source):
        try:
            robot = source if isinstance(source, Robot) else Robot.load(str(source), mimic=True)
        except RobotError:  # a mimic joint may name one that the URDF does not have
            robot = Robot.load(str(source))
            remarks.append("Its mimic joints cannot be coupled: they move independently.")
        return robot, excitation(robot, seed=seed), tuple(remarks)
    run = source if isinstance(source, Run) else Run.load(str(source))
    robot = Robot.of(run)
    if run.position is None:
        raise RunError("the run has no positions, which the extended noise needs")
    if not run.mask.all():
        parts = stretches(run.mask, len(run.time))
        longest = max(parts, key=lambda each: each.stop - each.start, default=slice(0, 1))
        run = run.cut(*np.append(run.time, np.inf)[[longest.start, longest.stop]].tolist())
        remarks.append(f"The run has gaps: compared from {run.time[0]:.2f} s on.")
    return robot, run, (*remarks, *assumed(run, robot))


def _is_run(source: Source) -> bool:
    """Whether a source is a run or a run file."""
    if isinstance(source, Path):
        return not is_robot_file(source.name)
    return isinstance(source, Run) or (isinstance(source, str) and source.endswith(".npz"))


def compare(
    robots: Source | Iterable[Source],
    *,
    kinds: Sequence[str] = COMPARED,
    surface: str = "auto",
    seed: int = 0,
    jobs: Jobs = 1,
    progress: Progress | None = None,
) -> Comparisons:
    """Comparison of kinds of noise estimates, on the motions of one robot or many, in their order.

    All estimates are compared as pressures, whose scale is arbitrary: a factor between two kinds
    changes neither their correlation nor their distance. F. Sygulla and D. Rixen define the
    kinds "simplified" and "paper" ("Learning the Noise of Failure", Sec. II-A); ``extended``
    defines the others. Robots that cannot be read or have no surface, and runs that do not suffice,
    are left out and listed with the reason.

    Args:
        robots: One or many: a ``Robot``, a name, or the path of a URDF or an MJCF, which move by
            the `excitation`; or a ``Run``, or the path of a run file (a ``Path``, or text that ends
            in ``.npz``), for the robot that it names and the longest stretch without a gap.
        kinds: "simplified", or kinds of ``extended``.
        surface: The geometry that surfaces are taken from: "visual", "collision" or "auto".
        seed: Random seed of the excitation.
        jobs: How many robots to compare at once, or the address of a Dask scheduler.
        progress: Takes an iterable and its length ``total``, and yields the items, as ``tqdm``.

    Raises:
        NoiseModelError: If there are no robots, or fewer than two different kinds; or one of its
            subclasses, if a kind or the geometry does not exist.
    """
    sources = [robots] if isinstance(robots, Source) else list(robots)
    kinds = (kinds,) if isinstance(kinds, str) else tuple(kinds)
    _check(sources, kinds, surface, seed)
    if isinstance(jobs, int) and jobs < 1:
        raise NoiseModelError(f"jobs is {jobs}, expected 1 or more")
    one = partial(_attempt, seed=seed, kinds=kinds, geometry=surface)
    results: Iterable[Comparison | LeftOut]
    results = in_order(one, sources, jobs=jobs, died=lambda each: LeftOut(_name(each), DIED))
    found = list(results if progress is None else progress(results, total=len(sources)))
    return Comparisons(
        tuple(each for each in found if isinstance(each, Comparison)),
        tuple(each for each in found if isinstance(each, LeftOut)),
    )


def _check(sources: Sequence[Source], kinds: Sequence[str], geometry: str, seed: int) -> None:
    """Refuse what cannot be compared before any work is done."""
    known = (SIMPLIFIED, *KINDS)
    for kind in kinds:
        if kind not in known:
            raise UnknownKindError(kind, known)
    if len(set(kinds)) < max(2, len(kinds)):
        raise NoiseModelError(
            f"kinds to compare are {', '.join(kinds)}; expected two different ones or more"
        )
    if not sources:
        raise NoiseModelError("no robots to compare")
    if strange := [type(each).__name__ for each in sources if not isinstance(each, Source)]:
        raise NoiseModelError(f"a robot is of type {strange[0]}, expected a robot or a run")
    if seed < 0:
        raise NoiseModelError(f"seed is {seed}, expected 0 or more")
    if geometry not in GEOMETRIES:
        listed = ", ".join(GEOMETRIES)
        raise GeometryError(f"geometry {geometry!r} is not known, expected one of {listed}")


def _name(source: Source) -> str:
    if isinstance(source, Robot):
        return source.name
    return source.robot or "run" if isinstance(source, Run) else str(source)


def _attempt(
    source: Source, seed: int, kinds: Sequence[str], geometry: str
) -> Comparison | LeftOut:
    name = _name(source)
    try:
        return _compare(name, *moving(source, seed), kinds, geometry)
    except NoiseModelError as error:
        return LeftOut(name, str(error).removeprefix(f"{name}: "))


def _compare(
    name: str, robot: Robot, run: Run, remarks: tuple[str, ...], kinds: Sequence[str], geometry: str
) -> Comparison:
    rate, window = run.rate, round(WINDOW * run.rate)
    if window < 4 or len(run.time) < window:
        raise NoiseModelError(
            f"{len(run.time)} samples at {rate:g} Hz, expected {WINDOW:g} s at least and 40 Hz"
        )
    surface = Surface.of(robot, geometry)
    if not surface.area.any():
        raise GeometryError(f"no link has a surface by geometry {geometry!r}")
    motions = [robot.configuration(run), *filter(None, [robot.desired(run)])]
    power, energy, terms = _estimates(robot, surface, motions, kinds)
    pressure = np.sqrt(power)
    events = tuple(block for block in run.blocks if block.label != "ok")
    squares = spectral_distances([log_spectra(np.sqrt(each), window) for each in power])
    rms = np.sqrt(np.mean(pressure**2, axis=1, keepdims=True))
    return Comparison(
        name=name,
        floating_base=robot.floating_base,
        joints=len(run.joint_names),
        time=run.time,
        rate=rate,
        events=events,
        kinds=tuple(kinds),
        links=surface.names,
        links_with_surface=len(surface.names) - len(surface.without_geometry),
        pressure=pressure / np.where(rms > 0.0, rms, 1.0),
        correlation=envelope_correlation(power, round(ENVELOPE * rate)),
        distance=np.sqrt(squares.mean(axis=2)),
        frequency=np.arange(window // 2 + 1) * rate / window,
        distance_by_frequency=np.sqrt(squares),
        contrast=contrasts(pressure, run.time, rate, events),
        shares=energy / np.maximum(energy.sum(axis=1, keepdims=True), TINY),
        terms=terms,
        remarks=remarks,
    )
