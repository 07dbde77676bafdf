"""Training and evaluation of models on files: annotated runs and NoisyTest folders."""

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import noiseclassifier as nc
import noisemodel as nm
from inspector.analysis import extents
from inspector.errors import InspectorError, OptionError
from inspector.library import lines
from inspector.logs.clocks import without_hold
from inspector.logs.plausibility import check_joints
from inspector.signals import without_placeholder
from inspector.text import progress
from noiseclassifier import Assessment
from noiseclassifier.profile import HIGHEST, LOWEST, NOMINAL
from noisemodel.files import also_reading, refuse_existing

# A recording, and the run file that it is of.
Read = tuple[nc.Recording | nc.Unanswered, nm.Run | None]
# Findings by their frames, and from onset to end.
Located = tuple[tuple[nc.Event, ...], tuple[nc.Event, ...]]
ANY_RATE = "general"  # the profile of a model for any rate
RATE = 10_000.0  # rate of a model of one rate unless another is given, in [Hz]
THIN = 8  # a general model learns from every so many `ok` frames of a log
# Profiles by name, at a rate in [Hz].
PROFILES: dict[str, Callable[[float], nc.Profile]] = {
    "logbands": nc.LogBands().at,
    "noisytest-rbf": lambda _: nc.Profile.noisytest("rbf"),
    "noisytest-linear": lambda _: nc.Profile.noisytest("linear"),
    "paper-rbf": lambda _: nc.Profile.paper("rbf"),
    "paper-linear": lambda _: nc.Profile.paper("linear"),
}


def classified(
    inputs: Sequence[Path], rate: float | None, part: str = "all", *, bare_too: bool = False
) -> Iterator[Read]:
    """Annotated noise as `inspector classify` takes it, and the runs that it cannot take.

    A desired velocity that is a placeholder, and an error of zero throughout, are left out of run
    files, and values that are held count once. A simulated run may have no annotated block: its
    failures were too faint to be labelled either way.

    Args:
        rate: The rate to decimate runs to, in [Hz]; slower ones have no verdict. None: each at its
            own, as a general model takes it.
        part: "all", "training" or "test", by ``noiseclassifier.held_out``.
        bare_too: Whether to yield run files without any annotation, in place of an error.
    """
    taken: set[str] = set()
    for path, (one, run) in _all(inputs, rate, bare_too=bare_too):
        each = _apart(one, path, taken)
        if part == "all" or nc.held_out(nc.group_of(each.name)) == (part == "test"):
            yield each, run


def _all(
    inputs: Sequence[Path], rate: float | None, *, bare_too: bool
) -> Iterator[tuple[Path, Read]]:
    for path in inputs:
        if path.is_dir() and any(path.glob("*.toml")):
            also_reading([path])
            for each in nc.noisytest.read_folder(path, rate=rate):
                yield path / each.name, (each, None)
            continue
        for file in sorted(path.rglob("*.npz")) if path.is_dir() else [path]:
            also_reading([file])
            yield file, _as_classified(file, rate, bare_too=bare_too)


def _as_classified(path: Path, rate: float | None, *, bare_too: bool) -> Read:
    run, _ = without_placeholder(nm.Run.load(path))
    check_joints(run.joint_names, run.robot)
    slower = without_hold(run)
    wanted = min(max(slower.rate, LOWEST), HIGHEST) if rate is None else rate
    held = rate is None or slower.rate >= rate * (1 - NOMINAL)
    chosen = slower if held else run
    if chosen.rate < wanted * (1 - NOMINAL):
        reason = f"rate {chosen.rate:g} Hz < {wanted:g} Hz"
        return nc.Unanswered(_name(path, run.robot), _facts(run), reason), None
    lower = min(wanted, chosen.rate)
    decimated = nm.decimated(chosen, lower)
    if not (decimated.blocks or "events" in run.meta or bare_too):
        raise InspectorError(f"{path}: has no annotated blocks")
    signals = nc.signals.named({**nm.norms(decimated), **nm.by_joint(decimated)})
    found = nc.Recording(
        name=_name(path, run.robot),
        signal=nc.signals.without_zero_error(signals),
        rate=lower,
        blocks=tuple(nc.Block(b.start, b.stop, b.label) for b in decimated.blocks),
        start=float(decimated.time[0]),
        valid=decimated.mask,
        sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
        events=_faults(path, chosen),
        facts=_facts(run),
    )
    return found, run


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


def _name(path: Path, robot: str | None) -> str:
    """Name of a run file: with its robot before, if its folder is named so."""
    return f"{robot}/{path.stem}" if path.parent.name == robot else path.stem


def _facts(run: nm.Run) -> dict[str, str]:
    """Robot, scenario and domain of a run, as far as they are known."""
    domain = run.meta.get("domain")
    named = domain.get("name") if isinstance(domain, Mapping) else domain
    found = {
        "robot": run.robot,
        "scenario": run.meta.get("scenario"),
        "domain": named or run.meta.get("simulator") or run.meta.get("source"),
    }
    return {name: str(value) for name, value in found.items() if value}


def _faults(path: Path, run: nm.Run) -> tuple[nc.Fault, ...]:
    """All faults that were injected into a run, as the events of its meta have them."""
    bad = [block for block in run.blocks if block.label != "ok"]
    found = []
    events = run.meta.get("events") or ()
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


@dataclass(frozen=True)
class LeftOut:
    """Runs that a profile cannot be trained on."""

    runs: dict[str, list[str]] = field(default_factory=dict)  # their names, by reason

    def without(
        self, found: Iterable[nc.Recording | nc.Unanswered], profile: nc.Profile
    ) -> Iterator[nc.Recording]:
        """Recordings that have all signals of a profile, at its rate; notes the others."""
        for each in found:
            if isinstance(each, nc.Recording) and each.blocks:
                yield each
                continue
            below = isinstance(each, nc.Unanswered)
            reason = f"below {profile.rate:g} Hz" if below else "without annotated blocks"
            self.runs.setdefault(reason, []).append(each.name)

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

    Runs below the rate and those without an annotation are left out; a desired velocity that is a
    placeholder is none, as in `inspector classify`.

    Args:
        inputs: Annotated run files, folders of them, or NoisyTest folders.
        profile: ``ANY_RATE``, or one of ``PROFILES``.
        rate: Rate of a model of one rate, in [Hz], to which faster runs are decimated; None for
            ``RATE``. A general model takes each run at its own.
        part: The part of the recordings to train on.
        overwrite: Whether a file that exists may be replaced.
    """
    general = profile == ANY_RATE
    if general and rate is not None:
        raise OptionError(f"profile {profile} is for any rate; leave out --rate {rate:g}")
    rate = None if general else RATE if rate is None else rate
    chosen = nc.ANY.at(LOWEST, (nc.NOISE,)) if rate is None else profile_at(profile, rate)
    refuse_existing(output, overwrite=overwrite)
    left_out = LeftOut()
    read = progress(classified(inputs, rate, part, bare_too=True), "read", total=count(inputs))
    usable = left_out.without((recording for recording, _ in read), chosen)
    model: nc.Classifier | nc.General
    try:
        if general:
            parts = list(nc.frames_of(usable, nc.ANY, thin=THIN))
            if not parts:
                raise nc.NoFrameError(0, nc.ANY.classes)
            frames = nc.Dataset.joined(parts)
            model = nc.General.train(frames, nc.ANY, thin=THIN)
        else:
            frames = nc.Dataset.of(usable, chosen)
            model = nc.Classifier.train(frames, chosen)
    except nc.NoFrameError as error:
        if error.count or not left_out.runs:
            raise
        raise InspectorError(f"no run to train {profile} on; {left_out}") from error
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
    """A run of NoisyTest's noise, as the motion of one joint."""
    velocity = nc.signals.stacked(recording.signal, (nc.NOISE,))[:, None]
    time, valid = recording.time, recording.valid
    return nm.Run(time=time, velocity=velocity, joint_names=("joint0",), valid=valid)
