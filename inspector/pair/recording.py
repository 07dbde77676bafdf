"""Two runs as one rerun recording: what goes into it, in order."""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import rerun as rr
from rerun.urdf import UrdfTree

from inspector.errors import InspectorError
from inspector.pair import classes, joints, links, noise
from inspector.pair.blueprint import Contents, layout
from inspector.pair.changes import NEW, Change, changes
from inspector.pair.levels import STEP, steps, whole
from inspector.pair.pair import Pair
from inspector.pair.report import report
from inspector.recording import robot, unstable
from inspector.recording.limbs import limbs
from inspector.recording.series import TIMELINE
from inspector.recording.stream import log_report, writing
from inspector.sound.sonification import Settings, common_gain, sound_of
from inspector.sound.sound import SMALL_RATE
from noisemodel.run import part

MAX_VALUES = 8_000_000
"""Velocities of a run that are mixed into a sound: a second of work."""


def write(pair: Pair, path: Path, *, overwrite: bool = False) -> None:
    """Write the recording of two runs, whole or not at all.

    The same input makes a recording of the same id: opened again, it replaces itself.

    Args:
        pair: The runs.
        path: The file to write, by convention ``*.rrd``.
        overwrite: Whether a file that exists may be replaced.

    Raises:
        OutputError: If the file exists or cannot be written.
        RobotError: If the robot's URDF cannot be read, or lacks one of the runs' joints.
        MeshError: If one of the robot's meshes cannot be read.
    """
    parts = (pair.before.sha256, pair.after.sha256, str(pair.alignment.lag))
    identity = hashlib.sha256(" ".join(parts).encode()).hexdigest()
    with TemporaryDirectory() as folder, writing(path, identity, overwrite=overwrite) as recording:
        tree = None if pair.links is None else robot.of_run(pair.after.run, Path(folder))
        contents = _log(recording, pair, tree)
        recording.send_blueprint(layout(contents))  # takes the place of an older layout


def _log(recording: rr.RecordingStream, pair: Pair, tree: UrdfTree | None) -> Contents:
    run, found, shown = pair.after.run, changes(pair), list[str]()
    if tree is not None:
        robot.log(recording, tree, run, coloured=True)
        shown = links.log(recording, tree, pair)
    lanes = classes.log(recording, pair, found)
    noise.log(recording, pair)
    names = dict.fromkeys((*run.joint_names, *pair.before.run.joint_names))
    limb_plots = joints.log(recording, pair, limbs(tuple(names), tree))
    loop = _loudest_change(pair, found)
    audible = _sounds(pair, loop[0])
    start = float(pair.time[0])
    for name, sound in audible.items():
        unstable.log_audio(recording, f"/sound/{name}", sound, TIMELINE, start=start)
    _log_text(recording, pair)
    return Contents(
        joints=limb_plots,
        links=shown,
        root=None if tree is None else robot.root(tree, floating=run.base_pose is not None),
        lanes=lanes,
        events=bool(found),
        sounds=tuple(audible),
        rate=pair.rate,
        loop=loop,
    )


def _loudest_change(pair: Pair, found: Sequence[Change]) -> tuple[float, float]:
    """Time to show first: of the loudest new failure, or else of the largest change of level."""
    new = [change for change in found if change.kind == NEW]
    if new:
        worst = max(new, key=lambda change: change.level.after)
        begin, end = float(pair.time[0]), float(pair.time[-1])
        return max(worst.start, begin), min(worst.stop, end)
    time, level = steps(pair)
    place = float(time[np.abs(level[:, 1] - level[:, 0]).argmax()])
    return place - STEP, place + STEP


def _sounds(pair: Pair, around: float) -> dict[str, bytes]:
    """A WAV file of the simplified noise of each run, both at one gain; none if all is silent.

    Of runs that are too long, only a part around a time in [s] is audible.
    """
    widest = max(2 * side.run.motion.shape[1] for _, side in pair.sides)
    count = min(max(2, MAX_VALUES // widest), len(pair.time))
    middle = int(np.searchsorted(pair.time, around))
    first = min(max(middle - count // 2, 0), len(pair.time) - count)
    try:
        made = {
            name: sound_of(part(side.run, first, first + count), Settings())
            for name, side in pair.sides
        }
    except InspectorError:
        return {}
    gain = common_gain(list(made.values()))
    lead = first / pair.rate
    return {name: s.file(gain, rate=SMALL_RATE, lead=lead) for name, s in made.items()}


def _log_text(recording: rr.RecordingStream, pair: Pair) -> None:
    properties = {
        "before_sha256": pair.before.sha256,
        "after_sha256": pair.after.sha256,
        "aligned": str(pair.alignment.how),
        "lag_s": pair.alignment.seconds,
        "rate_hz": pair.rate,
        "duration_s": pair.before.run.duration,
        "vibration_change_db": whole(pair).change,
    }
    log_report(recording, f"{pair.before.name} → {pair.after.name}", report(pair), properties)
