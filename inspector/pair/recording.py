"""Two runs as one rerun recording: what goes into it, in order."""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import rerun as rr
from rerun.urdf import UrdfTree

from inspector.pair import classes, joints, links, noise
from inspector.pair.blueprint import Contents, layout
from inspector.pair.changes import CAME, Change, changes
from inspector.pair.levels import STEP, steps, whole
from inspector.pair.pair import Pair
from inspector.pair.report import report
from inspector.pair.sound import sounds
from inspector.recording import robot, unstable
from inspector.recording.limbs import limbs
from inspector.recording.series import TIMELINE
from inspector.recording.stream import log_report, writing


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
    run, found, loud = pair.after.run, changes(pair), list[str]()
    if tree is not None:
        robot.log(recording, tree, run, coloured=True)
        loud = links.log(recording, tree, pair)
    lanes = classes.log(recording, pair, found)
    noise.log(recording, pair)
    names = dict.fromkeys((*run.joint_names, *pair.before.run.joint_names))
    limb_plots = joints.log(recording, pair, limbs(tuple(names), tree))
    loop = _loudest_change(pair, found)
    heard = sounds(pair, loop[0])
    start = float(pair.time[0])
    for name, sound in heard.items():
        unstable.log_audio(recording, f"/sound/{name}", sound, TIMELINE, start=start)
    _log_text(recording, pair)
    return Contents(
        joints=limb_plots,
        links=loud,
        root=None if tree is None else robot.root(tree, floating=run.base_pose is not None),
        lanes=lanes,
        events=bool(found),
        sounds=tuple(heard),
        rate=pair.rate,
        loop=loop,
    )


def _loudest_change(pair: Pair, found: Sequence[Change]) -> tuple[float, float]:
    """Choose what is looked at first: what came, or else where the level changed most."""
    came = [change for change in found if change.kind == CAME]
    if came:
        worst = max(came, key=lambda change: change.level.after)
        begin, end = float(pair.time[0]), float(pair.time[-1])
        return max(worst.start, begin), min(worst.stop, end)
    time, level = steps(pair)
    place = float(time[np.abs(level[:, 1] - level[:, 0]).argmax()])
    return place - STEP, place + STEP


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
