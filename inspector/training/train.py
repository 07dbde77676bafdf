"""Training and evaluation of models on files: annotated runs and NoisyTest folders."""

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from json import dumps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

import noiseclassifier as nc
import noisemodel as nm
from inspector.analysis import extents
from inspector.audit.signals import without_placeholder
from inspector.colors import SERIES, Color, of_classes
from inspector.errors import InspectorError, OptionError
from inspector.library import lines
from inspector.logs.clocks import without_hold
from inspector.logs.plausibility import check_joints
from inspector.report.picture import require as require
from inspector.text import counted, progress
from noiseclassifier import Assessment
from noiseclassifier.profile import HIGHEST, LOWEST, NOMINAL
from noisemodel.files import also_reading, refuse_existing, replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from noiseclassifier.measures import Estimate


SIMULATORS = {"mujoco", "pinocchio", "drake", "pybullet", "dm-control"}
"""Software whose versions in the ``meta`` of a run go into the manifest of a model."""


AnyModel = TypeVar("AnyModel", nc.Classifier, nc.General)


Read = tuple[nc.Recording | nc.Unanswered, nm.Run | None]
"""A recording, and the run file that it is of."""


PARTS = ("all", "training", "test")
"""Parts of a data set; a hash decides what is in `test`, see ``noiseclassifier.held_out``."""


def in_part(recording: nc.Recording | nc.Unanswered, part: str) -> bool:
    """Whether a recording belongs to a part of a data set."""
    return part == "all" or nc.held_out(nc.group_of(recording.name)) == (part == "test")


def classified(
    inputs: Sequence[Path], rate: float | None, part: str = "all", *, bare_too: bool = False
) -> Iterator[Read]:
    """Annotated noise as `inspector classify` takes it, and the runs that it cannot take.

    A desired velocity that is a placeholder, and an error of zero throughout, are left out of run
    files, and values that are held count once (`hold.without_hold`). A simulated run may have no
    annotated block: its failures were too faint to be labelled either way.

    Args:
        rate: The rate to decimate runs to, in [Hz]; slower ones have no verdict. None: each at its
            own, as a general model takes it.
        bare_too: Whether to yield run files without any annotation, in place of an error.
    """
    taken: set[str] = set()

    def named(one: nc.Recording | nc.Unanswered, path: Path, run: nm.Run | None) -> Iterator[Read]:
        one = _apart(one, path, taken)
        if in_part(one, part):
            yield one, run

    for path in inputs:
        if path.is_dir() and any(path.glob("*.toml")):
            also_reading([path])
            for each in nc.noisytest.read_folder(path, rate=rate):
                yield from named(each, path / each.name, None)
            continue
        for file in sorted(path.rglob("*.npz")) if path.is_dir() else [path]:
            also_reading([file])
            recording, run = _as_classified(file, rate, bare_too=bare_too)
            yield from named(recording, file, run)


def _as_classified(path: Path, rate: float | None, *, bare_too: bool) -> Read:
    run, _ = without_placeholder(nm.Run.load(path))
    check_joints(run.joint_names, run.robot)
    slower = without_hold(run)
    wanted = min(max(slower.rate, LOWEST), HIGHEST) if rate is None else rate
    held = rate is None or slower.rate >= rate * (1 - NOMINAL)
    chosen = slower if held else run
    if chosen.rate < wanted * (1 - NOMINAL):
        reason = f"rate {chosen.rate:g} Hz < {wanted:g} Hz"
        return nc.Unanswered(_name(path, run.robot), facts(run.robot, run.meta), reason), None
    found = of_run(path, chosen, wanted)
    if not (found.blocks or "events" in run.meta or bare_too):
        raise InspectorError(f"{path}: has no annotated blocks")
    signals = nc.signals.without_zero_error(nc.signals.named(found.signal))
    return replace(found, signal=signals), run


def _apart(
    one: nc.Recording | nc.Unanswered, path: Path, taken: set[str]
) -> nc.Recording | nc.Unanswered:
    """Name a recording apart from others of its name, by as much of its folder as it takes.

    A simulated run keeps its robot, scenario and seed, which tell the group.
    """
    name, depth = one.name, 0
    robot, _, rest = name.partition("/")
    folders = path.absolute().parent.parts[1:]
    folders = folders[:-1] if rest and folders[-1:] == (robot,) else folders
    while name in taken and depth < len(folders):
        depth += 1
        folder = "/".join(folders[-depth:])
        name = f"{robot}/{folder}/{rest}" if rest else f"{one.name} ({folder})"
    taken.add(name)
    return one if name == one.name else replace(one, name=name)


def of_run(path: Path, run: nm.Run, rate: float) -> nc.Recording:
    """Noise of a run, annotated or not, decimated to a rate in [Hz] that is not above its own.

    It is named as its file, with its robot before if the folder is named so.
    """
    rate = min(rate, run.rate)
    decimated = nm.decimated(run, rate)
    return nc.Recording(
        name=_name(path, run.robot),
        signal={**nm.norms(decimated), **nm.by_joint(decimated)},
        rate=rate,
        blocks=tuple(nc.Block(b.start, b.stop, b.label) for b in decimated.blocks),
        start=float(decimated.time[0]),
        valid=decimated.mask,
        sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
        events=faults(path, run.meta, run.blocks),
        facts=facts(run.robot, run.meta),
    )


def _name(path: Path, robot: str | None) -> str:
    """Name of a run file: with its robot before, if its folder is named so."""
    return f"{robot}/{path.stem}" if path.parent.name == robot else path.stem


def facts(robot: str | None, meta: Mapping[str, Any]) -> dict[str, str]:
    """Robot, scenario, domain and simulators of a run, as far as they are known."""
    domain = meta.get("domain")
    named = domain.get("name") if isinstance(domain, Mapping) else domain
    software = meta.get("versions")
    found = {
        "robot": robot,
        "scenario": meta.get("scenario"),
        "domain": named or meta.get("simulator") or meta.get("source"),
        **{name: software.get(name) for name in SIMULATORS if isinstance(software, Mapping)},
    }
    return {name: str(value) for name, value in found.items() if value}


class Simulators:
    """The software that simulated what a model learns from, noted while it is read.

    Attributes:
        versions: Versions of each, by name.
    """

    def __init__(self) -> None:
        self.versions: dict[str, set[str]] = {}

    def noting(self, found: Iterable[nc.Recording]) -> Iterator[nc.Recording]:
        """Recordings as they are, once their software is noted."""
        for each in found:
            for name in SIMULATORS & each.facts.keys():
                self.versions.setdefault(name, set()).add(each.facts[name])
            yield each

    def signed(self, model: AnyModel) -> AnyModel:
        """A model that has the versions in its manifest, beside those that it had already."""
        had = {name: set(model.versions.get(name, "").split(", ")) - {""} for name in self.versions}
        said = {name: ", ".join(sorted(had[name] | own)) for name, own in self.versions.items()}
        return replace(model, versions={**model.versions, **said})


def faults(path: Path, meta: Mapping[str, Any], blocks: Sequence[nm.Block]) -> tuple[nc.Fault, ...]:
    """All faults that were injected into a run, as the events of its meta have them."""
    bad = [block for block in blocks if block.label != "ok"]
    found = []
    events = meta.get("events") or ()
    for event in events if isinstance(events, list | tuple) else (events,):
        try:
            label, start, stop = str(event["label"]), float(event["start"]), float(event["stop"])
            overlaps = any(block.start <= stop and block.stop >= start for block in bad)
            felt = float(event["labelled"]) > 0.0 if "labelled" in event else overlaps
        except (LookupError, TypeError, ValueError, OverflowError) as error:
            raise InspectorError(
                f"{path}: an event of its meta lacks label, start or stop as numbers in s"
            ) from error
        found.append(nc.Fault(start, stop, label, felt))
    return tuple(found)


def count(inputs: Sequence[Path]) -> int:
    """Number of recordings in files and folders, or a few more: the length of a progress bar."""
    return sum(
        sum(1 for file in path.rglob("*.*") if file.suffix in (".npz", ".toml")) or 1
        for path in inputs
    )


ANY_RATE = "general"
"""The profile of a model for any rate."""
RATE = 10_000.0
"""Rate of a model of one rate unless another is given, in [Hz]."""
THIN = 8
"""A general model learns from every so many `ok` frames of a log."""

PROFILES: dict[str, Callable[[float], nc.Profile]] = {
    "joints": lambda rate: nc.EACH.at(rate),
    "norms": lambda rate: nc.GENERAL.at(rate),
    "scalar": lambda rate: nc.SCALAR.at(rate),
    "logbands": lambda rate: nc.LogBands().at(rate),
    "noisytest-rbf": lambda _: nc.Profile.noisytest("rbf"),
    "noisytest-linear": lambda _: nc.Profile.noisytest("linear"),
    "paper-rbf": lambda _: nc.Profile.paper("rbf"),
    "paper-linear": lambda _: nc.Profile.paper("linear"),
}
"""Profiles by name, at a rate in [Hz]."""

LACKING = {
    "measured": "without measured velocities",
    "desired": "without desired velocities",
    "error": "without tracking errors",
}
"""Why a run is left out, by the first signal that it lacks."""


@dataclass(frozen=True)
class LeftOut:
    """Runs that a profile cannot be trained on.

    Attributes:
        runs: Their names, by reason.
    """

    runs: dict[str, list[str]] = field(default_factory=dict)

    def without(
        self, found: Iterable[nc.Recording | nc.Unanswered], profile: nc.Profile
    ) -> Iterator[nc.Recording]:
        """Recordings that have all signals of a profile, at its rate; notes the others."""
        for each in found:
            if reason := lacking(each, profile):
                self.runs.setdefault(reason, []).append(each.name)
            elif isinstance(each, nc.Recording):
                yield each

    def __str__(self) -> str:
        if not self.runs:
            return "no run was left out"
        counts = [f"{len(names)} {reason}" for reason, names in self.runs.items()]
        first = next(iter(self.runs.values()))
        counts[0] = counts[0].replace(" ", " run " if len(first) == 1 else " runs ", 1)
        return f"left out: {', '.join(counts)}, e.g. {first[0]}"


def train(
    inputs: Sequence[Path],
    profile: str,
    rate: float | None,
    output: Path,
    *,
    part: str = "all",
    overwrite: bool = False,
) -> tuple[nc.Evaluation, LeftOut]:
    """Train a model and write it.

    Runs below the rate, those that lack a signal of the profile, and those without an annotation
    are left out; a desired velocity that is a placeholder is none, as in `inspector classify`.

    Args:
        inputs: Annotated run files, folders of them, or NoisyTest folders.
        profile: ``ANY_RATE``, or one of ``PROFILES``.
        rate: Rate of a model of one rate, in [Hz], to which faster runs are decimated; None for
            ``RATE``. A general model takes each run at its own.
        part: The part of the recordings to train on.
        overwrite: Whether a file that exists may be replaced.
    """
    if profile == ANY_RATE:
        if rate is not None:
            raise OptionError(f"profile {profile} is for any rate; leave out --rate {rate:g}")
        return _train_general(inputs, output, part=part, overwrite=overwrite)
    rate = RATE if rate is None else rate
    chosen = profile_at(profile, rate)
    refuse_existing(output, overwrite=overwrite)
    left_out, simulators = LeftOut(), Simulators()
    read = progress(classified(inputs, rate, part, bare_too=True), "read", total=count(inputs))
    try:
        usable = left_out.without((recording for recording, _ in read), chosen)
        examples = nc.Examples.read(simulators.noting(usable), chosen)
    except nc.NoFrameError as error:
        if error.count or not left_out.runs:
            raise
        scalar = set(LACKING.values()) & left_out.runs.keys()
        hint = "; --profile scalar takes the noise alone" if scalar else ""
        raise InspectorError(f"no run to train {profile} on; {left_out}{hint}") from error
    classifier = simulators.signed(nc.Classifier.train(examples, chosen))
    classifier.save(output, overwrite=overwrite)
    return classifier.evaluate(examples), left_out


def _train_general(
    inputs: Sequence[Path], output: Path, *, part: str, overwrite: bool
) -> tuple[nc.Evaluation, LeftOut]:
    """Train a general model and write it, see `train`."""
    refuse_existing(output, overwrite=overwrite)
    left_out, simulators = LeftOut(), Simulators()
    slowest = nc.ANY.bound(LOWEST, (nc.NOISE,))
    read = progress(classified(inputs, None, part, bare_too=True), "read", total=count(inputs))
    usable = left_out.without((recording for recording, _ in read), slowest)
    parts = list(nc.frames_of(simulators.noting(usable), nc.ANY, thin=THIN))
    if not parts:
        raise InspectorError(f"no run to train {ANY_RATE} on; {left_out}")
    frames = nc.Examples.joined(parts)
    model = simulators.signed(nc.General.train(frames, nc.ANY, thin=THIN))
    model.save(output, overwrite=overwrite)
    return model.evaluate(frames), left_out


def profile_at(name: str, rate: float) -> nc.Profile:
    """A profile by its name."""
    if name not in PROFILES:
        raise OptionError(
            f"no profile {name!r} of one rate; there are {', '.join(PROFILES)}, and {ANY_RATE} for"
            " any rate"
        )
    found = PROFILES[name](rate)
    if found.rate != rate:
        raise OptionError(f"profile {name} exists at {found.rate:g} Hz only, not {rate:g}")
    return found


def lacking(each: nc.Recording | nc.Unanswered, profile: nc.Profile) -> str:
    """Why a profile cannot be trained on a run, in a few words; empty if it can."""
    if isinstance(each, nc.Unanswered):
        return f"below {profile.rate:g} Hz"
    if not each.blocks:
        return "without annotated blocks"
    there = nc.signals.named(each.signal)
    if nc.signals.feeds(there, profile.signals):
        return ""
    gone = [name for name in profile.signals if name not in there]
    return next((LACKING[name] for name in gone if name in LACKING), "without joints")


Located = tuple[tuple[nc.Event, ...], tuple[nc.Event, ...]]
"""Findings by their frames, and from onset to end."""


def evaluate(
    model: Path, inputs: Sequence[Path], *, part: str = "all", seen_too: bool = False
) -> Assessment:
    """Measure a model."""
    classifier = nc.load(model)
    rate = None if isinstance(classifier, nc.General) else classifier.rate
    source: dict[str, nm.Run | None] = {}

    def read() -> Iterator[nc.Recording | nc.Unanswered]:
        for recording, run in classified(inputs, rate, part):
            source.clear()  # one run at a time stays in memory
            source[recording.name] = run
            yield recording

    def localise(recording: nc.Recording, labels: nc.Labels) -> Located:
        run = source[recording.name] or _run_of(recording)
        return extents(run, labels, *lines(run))

    return nc.assess(
        classifier,
        progress(read(), "evaluate", total=count(inputs)),
        seen_too=seen_too,
        localise=localise,
    )


def _run_of(recording: nc.Recording) -> nm.Run:
    """A run of what a sample keeps: its joints, or its noise as the motion of one joint."""
    signals = nc.signals.named(recording.signal)
    desired = None
    if "measured_joints" in signals:
        velocity = signals["measured_joints"].T
        desired = signals["desired_joints"].T if "desired_joints" in signals else None
    else:
        velocity = nc.signals.stacked(recording.signal, (nc.NOISE,))[:, None]
    return nm.Run(
        time=recording.time,
        velocity=velocity,
        velocity_desired=desired,
        joint_names=tuple(f"joint{number}" for number in range(velocity.shape[1])),
        valid=recording.valid,
    )


def as_json(assessment: Assessment, model: Path) -> str:
    """The measures of a model as a JSON text."""
    return dumps({"model": model.name, **assessment.as_dict()}, indent=1, allow_nan=False)


SIZE = (14.0, 5.0)
"""Width and height, in [inch]."""
DPI = 100
BLUE = SERIES[6]
GREY = "0.6"


def draw(assessment: Assessment, path: Path, *, title: str, overwrite: bool = False) -> None:
    """Draw the measures of a model as a PNG file."""
    require()
    from matplotlib.figure import Figure

    figure = Figure(figsize=SIZE, dpi=DPI, layout="constrained")
    confusion, intervals, reliability = figure.subplots(1, 3, width_ratios=(4, 4, 3))
    _confusion(confusion, assessment)
    _intervals(intervals, assessment)
    _reliability(reliability, assessment)
    seen = f", NOT A TEST: {len(assessment.seen)} were trained on" if assessment.seen else ""
    figure.suptitle(
        f"{title}: {counted(assessment.runs, 'run')} of {counted(assessment.groups, 'group')},"
        f" {assessment.protocol.counts['ok_hours']:.3g} h of ok motion{seen}"
    )
    with replacing(path, overwrite=overwrite) as temporary:
        figure.savefig(temporary, format="png")


def _confusion(axes: "Axes", assessment: Assessment) -> None:
    """Draw the confusion matrix, each row in the colour of its class, shaded by share."""
    evaluation = assessment.evaluation
    names, counts = evaluation.classes, evaluation.confusion
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    inks = np.array([_ink(color) for color in of_classes(names).values()])
    # The share is the opacity of the colour, on white.
    axes.imshow(1.0 - shares[..., None] * (1.0 - inks[:, None, :]), aspect="auto")
    for row, column in np.ndindex(counts.shape):
        text = f"{counts[row, column]}\n{shares[row, column]:.1%}" if counts[row, column] else "0"
        axes.text(column, row, text, ha="center", va="center", fontsize=9)
    axes.set_xticks(range(len(names)), names, fontsize=8)
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.set_xlabel("predicted")
    axes.set_title("Frames of annotated blocks (share of the row)", fontsize=10)


def _intervals(axes: "Axes", assessment: Assessment) -> None:
    frames, found = assessment.frames, assessment.protocol.pooled
    colors = of_classes(assessment.evaluation.classes)
    rows: list[tuple[str, Estimate, Color]] = [
        (f"recall of {name}", each, colors[name]) for name, each in frames["recall"].items()
    ]
    rows += [
        ("balanced accuracy", frames["balanced_accuracy"], (0, 0, 0)),
        ("failure recall", frames["failure_recall"], (0, 0, 0)),
        ("faults found", found["recall_injected"], (0, 0, 0)),
        ("faults found, detectable", found["recall_felt"], (0, 0, 0)),
        ("found with the right class", found["class_recall"], (0, 0, 0)),
        ("ok time flagged", found["ok_flagged"], (0, 0, 0)),
    ]
    rows = [row for row in rows if not np.isnan(row[1].value)]
    for place, (_, each, color) in enumerate(rows):
        axes.hlines(place, each.low, each.high, color=_ink(color), lw=6, alpha=0.55)
        axes.plot(each.value, place, "|", color="black", markersize=14, markeredgewidth=1.5)
    labels = [f"{name}\n{each.runs} runs, {each.groups} groups" for name, each, _ in rows]
    axes.set_yticks(range(len(rows)), labels, fontsize=8)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.grid(axis="x", alpha=0.4)
    axes.set_xlim(right=1.01)
    axes.set_title("Measures with their 95 % intervals", fontsize=10)


def _reliability(axes: "Axes", assessment: Assessment) -> None:
    axes.set_title("Reliability", fontsize=10)
    axes.set_xlabel("confidence")
    axes.set_ylabel("share of correct classes")
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 1.0)
    if assessment.reliability is None or assessment.calibration_error is None:
        axes.text(0.5, 0.5, "the scores are not probabilities", ha="center", va="center")
        return
    axes.plot([0.0, 1.0], [0.0, 1.0], "--", color=GREY, lw=1)
    table = assessment.reliability
    width = table["high"] - table["low"]
    axes.bar(table["low"], table["right"], width, align="edge", color=_ink(BLUE), alpha=0.35)
    axes.plot(table["confidence"], table["right"], "o", color=_ink(BLUE))
    for x, y, frames in zip(table["confidence"], table["right"], table["frames"], strict=True):
        if frames:
            axes.annotate(f"{frames:.0f}", (x, y), (0, -12), textcoords="offset points", fontsize=7)
    error = assessment.calibration_error
    axes.text(0.03, 0.94, f"expected calibration error {error.value:.1%}")


def _ink(color: Color) -> tuple[float, float, float]:
    red, green, blue = color
    return red / 255.0, green / 255.0, blue / 255.0
