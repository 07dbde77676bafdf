"""Recordings of run files and NoisyTest folders, at the rate of a model."""

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import noiseclassifier as nc
import noisemodel as nm
from inspector.audit.placeholder import without_placeholder
from inspector.errors import InspectorError
from inspector.hold import without_hold
from inspector.training.part import Part
from inspector.wrongrobot import check_joints
from noiseclassifier.logbands import HIGHEST, LOWEST
from noiseclassifier.profile import NOMINAL
from noisemodel.atomic import also_reading

SIMULATORS = {"mujoco", "pinocchio", "drake", "pybullet", "dm-control"}
"""Software whose versions in the ``meta`` of a run go into the manifest of a model."""


Model = TypeVar("Model", nc.Classifier, nc.General)


class SlowRunError(InspectorError):
    """A run that was recorded at a lower rate than a model needs.

    Args:
        path: The run file.
        own: Its rate, in [Hz].
        wanted: The rate that is needed, in [Hz].
        facts: Its robot, scenario and domain.
    """

    def __init__(self, path: Path, own: float, wanted: float, facts: Mapping[str, str]) -> None:
        self.path, self.own, self.wanted, self.facts = path, own, wanted, facts
        super().__init__(f"{path}: recorded at {own:g} Hz, the model needs {wanted:g} Hz")


Read = tuple[nc.Recording | nc.Unanswered, nm.Run | None]
"""A recording, and the run file that it is of."""


def recordings(
    inputs: Sequence[Path], rate: float, part: Part = Part.ALL
) -> Iterator[nc.Recording]:
    """Annotated noise of runs and NoisyTest folders.

    Args:
        inputs: Files, and folders of them, however deep.
        rate: The rate to decimate runs to, in [Hz].
        part: The part of these recordings to read.

    Yields:
        One recording per run or log. A simulated run may have no annotated block: its failures were
        too faint to be labelled either way.
    """
    for recording in _recordings(inputs, rate):
        if in_part(recording, part):
            yield recording


def in_part(recording: nc.Recording | nc.Unanswered, part: Part) -> bool:
    """Whether a recording belongs to a part of a data set."""
    return part.has(held_out=nc.held_out(nc.group_of(recording.name)))


def classified(
    inputs: Sequence[Path], rate: float | None, part: Part = Part.ALL, *, bare_too: bool = False
) -> Iterator[Read]:
    """Annotated noise as `inspector classify` takes it, and the runs that it cannot take.

    A desired velocity that is a placeholder, and an error of zero throughout, are left out of run
    files, and values that are held count once (`hold.without_hold`).

    Args:
        inputs: Files, and folders of them, however deep.
        rate: The rate to decimate runs to, in [Hz]; slower ones have no verdict. None: each at its
            own, as a general model takes it.
        part: The part of these recordings to read.
        bare_too: Whether to yield run files without any annotation, in place of an error.

    Yields:
        Each recording, and the run that it is of if that is a run file.

    Raises:
        InspectorError: If a run file has neither blocks nor events, unless ``bare_too``.
    """

    def read(path: Path) -> Read:
        return _as_classified(path, rate, bare_too=bare_too)

    for recording, run in _read(inputs, read, rate):
        if in_part(recording, part):
            yield recording, run


def _recordings(inputs: Sequence[Path], rate: float) -> Iterator[nc.Recording]:
    def read(path: Path) -> Read:
        return of_annotated_run(path, rate), None

    for recording, _ in _read(inputs, read, rate):
        if isinstance(recording, nc.Recording):
            yield recording


def _read(
    inputs: Sequence[Path], read: Callable[[Path], Read], rate: float | None
) -> Iterator[Read]:
    taken: set[str] = set()
    for path in inputs:
        if path.is_dir() and any(path.glob("*.toml")):
            also_reading([path])
            for each in nc.noisytest.read_folder(path, rate=rate):
                yield _apart(each, path / each.name, taken), None
            continue
        for file in sorted(path.rglob("*.npz")) if path.is_dir() else [path]:
            also_reading([file])
            recording, run = read(file)
            yield _apart(recording, file, taken), run


def _as_classified(path: Path, rate: float | None, *, bare_too: bool) -> Read:
    try:
        run, _ = without_placeholder(nm.Run.load(path))
        slower = without_hold(run)
        if rate is None:
            found = of_run(path, slower, min(max(slower.rate, LOWEST), HIGHEST))
        else:
            found = of_run(path, run if slower.rate < rate * (1 - NOMINAL) else slower, rate)
    except SlowRunError as error:
        reason = f"rate {error.own:g} Hz < {error.wanted:g} Hz"
        return nc.Unanswered(_name(path, error.facts.get("robot")), error.facts, reason), None
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


def of_annotated_run(path: Path, rate: float) -> nc.Recording:
    """Annotated noise of a run file.

    Args:
        path: A run file.
        rate: The rate to decimate it to, in [Hz].

    Returns:
        Its norms and joints with its blocks.

    Raises:
        SlowRunError: If the run's rate is lower.
        InspectorError: If it has no blocks.
    """
    run = nm.Run.load(path)
    found = of_run(path, run, rate)
    if not (found.blocks or "events" in run.meta):
        raise InspectorError(f"{path}: has no annotated blocks")
    return found


def of_run(path: Path, run: nm.Run, rate: float, *, sha256: str = "") -> nc.Recording:
    """Noise of a run, annotated or not.

    Args:
        path: The run file.
        run: Its content.
        rate: The rate to decimate it to, in [Hz].
        sha256: SHA-256 of the file; computed unless given.

    Returns:
        Its norms and joints with its blocks, if it has any, named as its file; with its robot
        before, if the folder is named so.

    Raises:
        SlowRunError: If the run's rate is lower.
        InspectorError: If the events of its meta are damaged.
        UnknownJointError: If it names a joint that its robot lacks.
    """
    check_joints(run.joint_names, run.robot)
    known = facts(run.robot, run.meta)
    if run.rate < rate * (1 - NOMINAL):
        raise SlowRunError(path, run.rate, rate, known)
    rate = min(rate, run.rate)
    decimated = nm.decimated(run, rate)
    return nc.Recording(
        name=_name(path, run.robot),
        signal={**nm.norms(decimated), **nm.by_joint(decimated)},
        rate=rate,
        blocks=tuple(nc.Block(b.start, b.stop, b.label) for b in decimated.blocks),
        start=float(decimated.time[0]),
        valid=decimated.mask,
        sha256=sha256 or hashlib.sha256(path.read_bytes()).hexdigest(),
        events=faults(path, run.meta, run.blocks),
        facts=known,
    )


def _name(path: Path, robot: str | None) -> str:
    """Name of a run file: with its robot before, if its folder is named so."""
    return f"{robot}/{path.stem}" if path.parent.name == robot else path.stem


def facts(robot: str | None, meta: Mapping[str, Any]) -> dict[str, str]:
    """Robot, scenario, domain and simulators of a run, as far as they are known.

    Args:
        robot: Name of its robot, if it has one.
        meta: What else is known of it. Its domain is the name in ``domain``, else its
            ``simulator``, else its ``source``.
    """
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

    def signed(self, model: Model) -> Model:
        """A model that has the versions in its manifest, beside those that it had already."""
        had = {name: set(model.versions.get(name, "").split(", ")) - {""} for name in self.versions}
        said = {name: ", ".join(sorted(had[name] | own)) for name, own in self.versions.items()}
        return replace(model, versions={**model.versions, **said})


def faults(path: Path, meta: Mapping[str, Any], blocks: Sequence[nm.Block]) -> tuple[nc.Fault, ...]:
    """All faults that were injected into a run, as the events of its meta have them.

    Args:
        path: Its file, for messages.
        meta: What is known of the run. Each of its ``events`` has ``label``, ``start`` and
            ``stop`` in [s], and ``labelled``, the time with its label; without that, it is felt if
            a block of a failure overlaps it.
        blocks: Annotated stretches of the run.

    Raises:
        InspectorError: If an event has no label, start or stop.
    """
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
