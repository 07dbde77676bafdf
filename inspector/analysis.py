"""The analysis of a run: labels, findings, audit, status, and how loud it is.

`classify`, `view`, `report`, comparisons of two runs, `export` and the summary of
`live` print what an `Analysis` says; none of them decides again.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

import noiseclassifier as nc
import noisemodel as nm
from inspector.audit import Audit, audit, shortcomings, summary
from inspector.audit.signals import without_placeholder
from inspector.errors import IGNORED, InspectorError, Status, Unknown
from inspector.levels import FLOOR_DB, STEP, velocity_levels
from inspector.library import CannotTellError, Library, label_run, load_library
from inspector.localisation import Localisation, extent, line_extent, localise
from inspector.localisation.order import Order, order
from inspector.logs.clocks import without_hold
from inspector.logs.read import Opened, open_run
from inspector.text import counted, printable
from noiseclassifier import Event
from noiseclassifier.lasting import joined
from noisemodel import Block, Run
from noisemodel.files import replacing
from noisemodel.noise import LinkNoise, assumed, link_noise, vibrating
from noisemodel.robot import is_name
from noisemodel.run import is_robot_file
from noisemodel.runfile import pieces
from noisemodel.types import Array

LEAST_LABELLED = 0.5  # share of a run that has labels in a verdict of `ok`


@dataclass(frozen=True, eq=False, kw_only=True)
class Analysis:
    """A run with what was found in it; texts are empty where there is none."""

    name: str  #: of the run
    status: Status  #: `ok`, `findings` or `cannot-tell`
    run: nm.Run  #: as it was analysed
    audit: Audit  #: what the run can show
    reason: str = ""  #: why there is no verdict, in a sentence or two
    labels: nc.Labels | None = None  #: one per frame; None where no model fits
    model: str = ""  #: name of the model that labelled
    model_sha256: str = ""  #: of its file
    #: The events of the labels, from the start of the first frame of each to the end of its last.
    spans: tuple[Event, ...] = ()
    findings: tuple[Event, ...] = ()  #: the same events, from their estimated onset to their end
    notes: tuple[str, ...] = ()  #: what was done to the run before it was labelled, sentences
    unknown: Unknown = Unknown.FINDING  #: what becomes of `unknown` frames
    sha256: str = ""  #: of the file that the run came from
    links: LinkNoise | None = None  #: None unless it was asked for and the run has a robot
    missing: tuple[str, ...] = ()  #: what the run lacks to show the robot, and why, sentences
    assumed: str = ""  #: when its log was read, in a line
    alarm: float | None = None  #: threshold of the model, a probability; None without one

    @cached_property
    def noise(self) -> Array:
        """Simplified noise of the run, shape (samples,), in [rad/s]."""
        return nm.simplified(self.run.motion, self.run.velocity_desired)

    @cached_property
    def vibration_level(self) -> tuple[Array, Array]:
        """Level of the measured motion above 10 Hz, see `inspector.levels.velocity_levels`."""
        run = self.run
        start = float(run.time[0])
        return velocity_levels(run.motion, run.mask, run.rate, start=start, together=True)

    @cached_property
    def joint_levels(self) -> tuple[Array, Array]:
        """Level of each joint above 10 Hz, see `inspector.levels.velocity_levels`."""
        run = self.run
        return velocity_levels(run.velocity, run.mask, run.rate, start=float(run.time[0]))

    @cached_property
    def _values(self) -> nm.Run:
        """The run at the rate of its values: of held ones, more was made by the hold."""
        return without_hold(self.run)

    @cached_property
    def localisations(self) -> dict[Event | nm.Block, Localisation]:
        """The localisation of each finding, and of each annotated failure."""
        frame = 0.0 if self.labels is None else float(self.labels.stop[0] - self.labels.start[0])
        found = localise(self._values, self.spans, frame=frame)
        events = zip(self.spans, self.findings, strict=True)
        named: dict[Event | nm.Block, Event] = dict(events)
        return {named.get(failure, failure): each for failure, each in found.items()}

    @cached_property
    def orders(self) -> dict[Event, Order]:
        """Findings whose vibration goes with the speed of a joint."""
        found = ((event, order(self._values, event)) for event in self.findings)
        return {event: known for event, known in found if known is not None}

    @cached_property
    def lane(self) -> tuple[tuple[float, float, str], ...]:
        """The class over time: start and stop in [s] and class, in order, not overlapping.

        Findings last from onset to end, and the later one counts where two overlap. `unknown`
        frames that are no finding take the time around their middle; the rest of what is covered
        by frames is `ok`.
        """
        labels = self.labels
        if labels is None:
            return ()
        groups = np.split(np.arange(len(labels)), np.flatnonzero(labels.apart) + 1)
        layers = [(float(labels.start[g[0]]), float(labels.stop[g[-1]]), "ok") for g in groups]
        alone = np.flatnonzero((labels.label == nc.UNKNOWN) & ~labels.flagged)
        middle = (labels.start[alone] + labels.stop[alone]) / 2
        half = labels.step / 2
        layers += [(t - half, t + half, nc.UNKNOWN) for t in middle.tolist()]
        layers += [(event.start, event.stop, event.label) for event in self.findings]
        edges = np.unique([time for start, stop, _ in layers for time in (start, stop)])
        names = np.full(len(edges) - 1, "", dtype=object)
        for start, stop, name in layers:
            names[np.searchsorted(edges, start) : np.searchsorted(edges, stop)] = name
        firsts = np.flatnonzero(np.append(True, names[1:] != names[:-1]))
        starts, stops = edges[firsts].tolist(), edges[[*firsts[1:], len(names)]].tolist()
        stretches = zip(starts, stops, names[firsts].tolist(), strict=True)
        return tuple(stretch for stretch in stretches if stretch[2])

    @property
    def headline(self) -> str:
        """The status and what it consists of, in a line."""
        line = headline(self.status, self.findings, self.reason)
        return f"{line}; {IGNORED}" if self.unknown is Unknown.IGNORE else line

    @property
    def message(self) -> str:
        """What `classify` says beside the findings, in a line; may be empty."""
        ignored = [f"{IGNORED[0].upper()}{IGNORED[1:]}."] if self.unknown is Unknown.IGNORE else []
        notes = [*ignored, *self.notes]
        if self.status is Status.CANNOT_TELL:
            return " ".join([f"{self.reason.rstrip('.')}.", *notes]) if notes else self.reason
        if self.status is Status.OK:
            desired = self.run.velocity_desired is not None
            without = "" if desired else " No desired velocity: tracking errors were not judged."
            notes.insert(0, f"Nothing stands out, within the run or for any robot.{without}")
        return " ".join([*notes, *shortcomings(self.audit)])

    @property
    def remarks(self) -> tuple[str, ...]:
        """What is missing or uncertain and why, a sentence each."""
        reason = (f"No labels: {self.reason}.",) if self.labels is None else ()
        seen = summary(self.audit, classes=not reason or bool(self.audit.observable))
        links = () if self.links is None else self.links.remarks
        read = (f"{self.assumed[0].upper()}{self.assumed[1:]}.",) if self.assumed else ()
        return (*read, *self.missing, *self.notes, *reason, *seen, *links)


def headline(status: Status, findings: Sequence[Event], reason: str = "") -> str:
    """Write a status and what it consists of in a line."""
    if status is Status.CANNOT_TELL:
        return f"{status}: {reason}"
    counts = Counter(event.label for event in findings)
    kinds = ", ".join(f"{count} {label}" for label, count in sorted(counts.items()))
    novel = sum(event.novel for event in findings)
    parts = [f"{status}: {kinds}" if kinds else str(status)]
    return "; ".join([*parts, f"{novel} out of distribution"] if novel else parts)


def analyse(
    run: nm.Run | str | Path,
    library: Library | None = None,
    *,
    name: str = "",
    sha256: str = "",
    unknown: Unknown = Unknown.FINDING,
) -> Analysis:
    """Label a run, and audit it; a log is opened first.

    Arrays are read when they are needed, piece by piece where they stay in their file
    (`noisemodel.Run.load`, ``on_demand``). A run that no model can label is no error: its status is
    `cannot-tell`.

    Args:
        library: Models to choose from, see `inspector.load_library`; those that ship unless given.
        name: Name of the run; by default the file's name.
        unknown: Whether out-of-distribution frames below the alarm threshold are findings.

    Raises:
        RunFileError: If the file is damaged, or holds a run that is wrong.
        InspectorError: If it is a log that cannot be read.
        UnknownJointError: If the run names a joint that its robot lacks.
    """
    assumed = ""
    if isinstance(run, (str, Path)):
        opened, name = open_run(run), name or Path(run).stem
        run, assumed = opened.run, opened.assumed
    library = load_library() if library is None else library
    run, left_out = without_placeholder(run)
    slower = without_hold(run)
    found = Analysis(
        name=(name or "run").encode(errors="backslashreplace").decode(),  # a file's may be no UTF-8
        status=Status.CANNOT_TELL,
        run=run,
        audit=audit(run, library, slower=slower),
        notes=(*_of_log(run), *filter(None, [left_out])),
        unknown=unknown,
        sha256=sha256,
        assumed=assumed,
    )
    try:
        labelled = label_run(run, library, slower=slower)
        labels = replace(labelled.labels, unknown_is_finding=unknown is Unknown.FINDING)
        spans, findings = extents(slower, labels, labelled.lasting, labelled.bursts)
    except (CannotTellError, nc.SignalError, nm.RunError) as error:
        return replace(found, reason=str(error))
    status, reason = _status(run, found.audit, labels, findings)
    return replace(
        found,
        status=status,
        reason=reason,
        labels=labels,
        model=labelled.model,
        model_sha256=library[labelled.model].sha256,
        alarm=labelled.alarm,
        spans=spans,
        findings=findings,
        notes=(*found.notes, *filter(None, [labelled.remark])),
    )


def _of_log(run: nm.Run) -> Iterator[str]:
    """What was left out of a run when its log was read, and its gaps, sentences."""
    told = run.meta.get("notes")
    for each in map(printable, map(str, told if isinstance(told, list) else ())):
        yield f"{each[:1].upper()}{each[1:]}."
    if lost := gaps(run):
        seconds = sum(stop - start for start, stop in lost)
        many = counted(len(lost), "gap")
        yield f"{many}, {seconds:.3g} s in all, the first at {lost[0][0]:.6g} s: not judged."


def _status(
    run: nm.Run, seen: Audit, labels: nc.Labels, findings: Sequence[Event]
) -> tuple[Status, str]:
    """Status of a run that has labels, and why it cannot be told."""
    if findings:
        return Status.FINDINGS, ""
    if not seen.observable:
        return Status.CANNOT_TELL, " ".join(summary(seen))
    if (labels.label == nc.UNKNOWN).all():
        return Status.CANNOT_TELL, f"every frame is {nc.UNKNOWN}"
    length = float(labels.stop[0] - labels.start[0])
    share = len(labels) / max(1.0, (run.duration - length) / labels.step)
    if share < LEAST_LABELLED:
        return Status.CANNOT_TELL, f"gaps leave labels to {share:.0%} of the run"
    return Status.OK, ""


def analyse_file(
    path: str | Path | Opened,
    library: Library,
    *,
    links: bool = True,
    kind: str = "normal",
) -> Analysis:
    """Analyse a file for people: with its hash, its links, and what was assumed of a log.

    Args:
        links: Whether to compute the noise link by link, if the run names a robot that is known.
        kind: Kind of the extended noise, see ``noisemodel.noise``.
    """
    opened = path if isinstance(path, Opened) else open_run(path)
    found = analyse(opened.run, library, name=opened.source.shown.stem, sha256=opened.sha256)
    return with_links(replace(found, assumed=opened.assumed), kind if links else "")


def with_links(analysis: Analysis, kind: str) -> Analysis:
    """Add the noise link by link, if the run names a robot that is known and holds positions."""
    run = analysis.run
    found = replace(analysis, missing=tuple(_missing(run)))
    if not kind or not robot_known(run) or run.position is None:
        return found
    try:
        return replace(found, links=link_noise(run, kind))
    except nm.GeometryError as error:
        raise InspectorError(f"{error}; `--robot none` shows the run without the robot") from error


def robot_known(run: nm.Run) -> bool:
    """Whether a run names a robot that can be read by its name, or a URDF or an MJCF."""
    return run.robot is not None and (is_name(run.robot) or is_robot_file(run.robot))


def extents(
    run: nm.Run, labels: nc.Labels, lasting: Sequence[Event] = (), bursts: Sequence[Event] = ()
) -> tuple[tuple[Event, ...], tuple[Event, ...]]:
    """List the findings of labels, of what lasts and of bursts: as found, and from onset to end.

    Those that overlap or touch are one, of the class that lasts longer.
    """
    frame, pairs = float(labels.stop[0] - labels.start[0]), list[tuple[Event, Event]]()
    found = [(event, 0.0) for event in labels.events()]
    # A line fills most of its windows: it begins before the last hop of the first.
    found += [(event, nc.lasting.MARGIN + nc.lasting.HOP) for event in lasting]
    found += [(event, nc.bursts.MARGIN + nc.bursts.HOP) for event in bursts]
    for span, more in sorted(found, key=lambda each: (each[0].start, each[0].stop)):
        if span.line is None:
            start, stop = extent(run, span.start, span.stop, frame=frame, hop=labels.step)
        else:
            start, stop = line_extent(run, span, more)
        # As JSON has them, so that a verdict that is read again says the same.
        own = replace(span, start=round(start, 6), stop=round(stop, 6))
        if pairs and (pairs[-1][0].stop >= span.start or pairs[-1][1].stop >= own.start):
            before, located = pairs.pop()
            span = joined(before, span)
            start, stop = min(located.start, own.start), max(located.stop, own.stop)
            if span.line is None and span.label == "oscillations":  # a line may be most of it
                longer = max(located, own, key=lambda e: (e.line is not None, e.stop - e.start))
                most = 2.0 * (longer.stop - longer.start) >= stop - start
                span = replace(span, line=longer.line if most else None)
            own = replace(span, start=start, stop=stop)
        pairs.append((span, own))
    return tuple(span for span, _ in pairs), tuple(finding for _, finding in pairs)


def _missing(run: nm.Run) -> Iterator[str]:
    """List what a run lacks, and what was computed in its place."""
    if run.robot is None:
        yield "No 3D robot: the run names none."
    elif not robot_known(run):
        yield f"No 3D robot: {run.robot!r} is neither a listed robot nor a URDF or MJCF file."
    elif run.position is None:
        yield "No 3D robot: the run has no positions."
    elif run.base_pose is None and run.robot in nm.ROBOTS and nm.ROBOTS[run.robot].floating_base:
        yield "The run has no base pose: the robot is drawn with its base at the origin."
    if run.velocity_desired is None:
        yield "The run has no desired velocities: the noise counts the measured motion alone."
    for signal, method in run.meta.get("differentiated", {}).items():
        yield f"The run had no {signal}: it was differentiated ({method})."
    if lost := int((~run.mask).sum()):
        yield f"{lost} samples lie in gaps; frames that touch one are not labelled."


NOTHING = r"^Nothing stands out[^.]*\.\s*"  # what is said of a run without findings
MOST = 3
LOUDEST = "loudest"


@dataclass(frozen=True)
class Moment:
    """A stretch of a run, and where in it the noise is loudest."""

    label: str  # its class; "loudest" where nothing was found or annotated
    start: float  # [s]
    stop: float  # [s]
    peak: float  # middle of its loudest 50 ms, in [s]


def gaps(run: Run) -> list[tuple[float, float]]:
    """Start and stop of each gap, in [s]."""
    edges = np.flatnonzero(np.diff(run.mask, prepend=True, append=True))
    times = run.time[np.minimum(edges, len(run.time) - 1)].tolist()
    return list(zip(times[::2], times[1::2], strict=True))


def worst(analysis: Analysis) -> tuple[Moment, ...]:
    """Pick the findings whose noise vibrates most, up to three.

    Where nothing was found, annotated failures take their place, and without these the loudest
    moment of the run.
    """
    run = analysis.run
    begin, end = float(run.time[0]), float(run.time[-1])
    annotated = [block for block in run.blocks if block.label != "ok"]
    whole = [Block(begin, end, LOUDEST)]
    failures: Sequence[Event | Block] = analysis.findings or annotated or whole
    starts, levels = analysis.vibration_level
    time = (starts + np.append(starts[1:], end + 1.0 / run.rate)) / 2
    level = np.nan_to_num(levels[:, 0], nan=FLOOR_DB)
    found = []
    for each in failures:
        inside = np.flatnonzero((time >= each.start - STEP / 2) & (time <= each.stop + STEP / 2))
        if len(inside):
            peak = inside[level[inside].argmax()]
            start, stop = max(each.start, begin), min(each.stop, end)
            moment = Moment(each.label, start, stop, float(np.clip(time[peak], start, stop)))
            found.append((float(level[peak]), moment))
    found.sort(key=lambda pair: -pair[0])
    return tuple(moment for _, moment in found[:MOST])


SHOWN = 8  # joints and links that have a row in a picture


def worst_joint(analysis: Analysis) -> int | None:
    """Column of the joint of the worst finding, else of the loudest; None of a base alone."""
    if not analysis.run.joint_names:
        return None
    moment = worst(analysis)[:1]
    for event, known in analysis.localisations.items() if analysis.findings and moment else ():
        # The level has a value every `STEP`: that of the peak may be just before the onset.
        near = event.start - STEP / 2 <= moment[0].peak <= event.stop + STEP / 2
        if known.joints and near:
            return analysis.run.joint_names.index(known.joints[0][0])
    _, level = analysis.joint_levels
    return int(np.argmax(np.nansum(10.0 ** (level / 10.0), axis=0)))


def worst_signal(analysis: Analysis, joint: int | None) -> Array:
    """Velocity of a joint above 10 Hz, shape (samples,), in [rad/s] or [m/s]; else the noise.

    The noise is a norm, in which a vibration of 35 Hz has 70 Hz.
    """
    run, signal = analysis.run, analysis.noise
    if joint is not None:
        own = [run.velocity[rows][:, joint].astype(np.float64) for rows in pieces(run.velocity)]
        signal = np.concatenate(own)
    return np.asarray(vibrating(signal[:, None], run.mask, run.rate)[:, 0])


def chosen(analysis: Analysis, time: Array, level: Array) -> list[int]:
    """Columns of those that are loudest during findings, or at any time of a run without.

    Times are starts of steps, in [s], and levels of shape (steps, columns), NaN in gaps.
    """
    inside = np.zeros(len(time), dtype=bool)
    for event in analysis.findings:
        inside |= (time > event.start - STEP) & (time < event.stop)
    shown = level[inside] if inside.any() else level
    peaks = np.where(np.isnan(shown), -np.inf, shown).max(axis=0, initial=-np.inf)
    return sorted(np.argsort(-peaks, kind="stable")[:SHOWN].tolist())


KINDS = ("simplified", *nm.KINDS)


@dataclass(frozen=True, eq=False)
class Estimate:
    """A noise over time."""

    kind: str  # "simplified", or a kind of the extended noise
    unit: str  # of the pressure
    power: Array  # of each part, shape (samples, parts), in [unit²]
    parts: tuple[str, ...]  # joints or links
    remarks: tuple[str, ...] = ()  # what it leaves out, a sentence each

    @property
    def pressure(self) -> Array:
        """Square root of the whole power, shape (samples,), in [unit]."""
        return np.asarray(np.sqrt(self.power.sum(axis=1)))


def default_kinds(run: Run) -> tuple[str, ...]:
    """Take the simplified noise, and the paper's whole sum beside it where the run allows."""
    whole = robot_known(run) and run.position is not None
    return ("simplified", "paper") if whole else ("simplified",)


def estimate(run: Run, kind: str) -> Estimate:
    """Compute a noise over time."""
    if kind == "simplified":
        parts, powers = run.joint_names, [np.square(run.velocity.astype(np.float64))]
        if run.velocity_desired is not None:
            parts += tuple(f"{name}, desired" for name in run.desired_joint_names)
            powers.append(np.square(run.velocity_desired.astype(np.float64)))
        if run.base_velocity is not None:
            parts += ("base",)
            base = np.square(run.base_velocity.astype(np.float64))
            powers.append(base.sum(axis=1, keepdims=True))
        return Estimate(kind, "rad/s", np.hstack(powers), parts)
    if kind not in nm.KINDS:
        raise nm.UnknownKindError(kind, KINDS)
    if run.robot is None or not robot_known(run):
        names = "none" if run.robot is None else repr(run.robot)
        raise nm.RobotError(f"kind {kind!r} needs a robot, the run names {names}")
    robot = nm.Robot.of(run)
    surface = nm.Surface.of(robot, "auto")
    q_desired, v_desired = robot.desired(run) or (None, None)
    noise = nm.extended(
        robot, surface, *robot.configuration(run), kind, q_desired=q_desired, v_desired=v_desired
    )
    return Estimate(kind, "√W", noise.power, noise.names, tuple(assumed(run, robot, surface)))


def noise_level(run: Run, estimate: Estimate) -> str:
    """Sum an estimate up: root mean square, peak, and the shares of joints or links, in lines."""
    pressure = np.where(run.mask, estimate.pressure, 0.0)
    if not np.isfinite(pressure).all():
        sample = int(np.argmin(np.isfinite(pressure)))
        found = f"{pressure[sample]:g} at {run.time[sample]:.6g} s"
        limit = "no robot moves so fast, or is so large"
        raise InspectorError(f"the {estimate.kind} noise is {found}: {limit}")
    energy = estimate.power[run.mask].sum(axis=0)
    shares, unit = energy / (energy.sum() or 1.0), estimate.unit
    rms = float(np.sqrt(np.mean(pressure[run.mask] ** 2)))
    peak, when = float(pressure.max()), float(run.time[pressure.argmax()])
    lines = [f"{estimate.kind}: rms {rms:.4g} {unit}, peak {peak:.4g} {unit} at {when:.3f} s"]
    lines += [
        f"  {shares[part]:6.1%}  {estimate.parts[part]}"
        for part in np.argsort(-shares, kind="stable")
        if shares[part] >= 0.001
    ]
    return "\n".join([*lines, *(f"  {remark}" for remark in estimate.remarks)])


def write_csv(
    run: Run, estimates: tuple[Estimate, ...], path: Path, *, overwrite: bool = False
) -> None:
    """Write time and noises as CSV."""
    columns = np.column_stack((run.time, *(estimate.pressure for estimate in estimates)))
    names = ["time [s]", *(f"{estimate.kind} [{estimate.unit}]" for estimate in estimates)]
    csv = {"fmt": "%.9g", "delimiter": ",", "comments": "", "encoding": "utf-8"}
    with replacing(path, overwrite=overwrite) as temporary:
        np.savetxt(temporary, columns[run.mask], header=",".join(names), **csv)
