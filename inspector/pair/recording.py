"""Two runs as one rerun recording: what goes into it, in order."""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import rerun as rr
from rerun.urdf import UrdfTree

from inspector.errors import InspectorError
from inspector.pair import classes, joints, links, noise
from inspector.pair.blueprint import Contents, layout
from inspector.pair.changes import changes, largest_change
from inspector.pair.levels import whole
from inspector.pair.pair import Pair
from inspector.pair.report import report
from inspector.recording import framing, robot, unstable
from inspector.recording.camera import Camera
from inspector.recording.limbs import limbs
from inspector.recording.noise import log_span
from inspector.recording.series import TIMELINE
from inspector.recording.stream import log_report, writing
from inspector.sound.sonification import Settings, common_gain, sound_of
from inspector.sound.sound import SMALL_RATE
from noisemodel.run import part

ASPECT = 1.35
"""Least width of a robot's view by its height."""
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
        trees = {} if pair.links is None else _robots(pair, Path(folder))
        contents = _log(recording, pair, trees, Path(folder))
        recording.send_blueprint(layout(contents))  # takes the place of an older layout


def _robots(pair: Pair, folder: Path) -> dict[str, UrdfTree]:
    """The robot before and after, as two robots."""
    return {side: robot.of_run(each.run, folder, side=side) for side, each in pair.sides}


def _log(
    recording: rr.RecordingStream, pair: Pair, trees: Mapping[str, UrdfTree], folder: Path
) -> Contents:
    run, found = pair.after.run, changes(pair)
    panel, shown, cameras = None, list[str](), dict[str, Camera]()
    log_span(recording, run)
    if trees:
        assert run.robot is not None
        pairs = [(trees[side], each.run) for side, each in pair.sides]
        for tree, own in pairs:
            robot.log(recording, tree, own, coloured=True)
        urdf = robot.drawn_file(run.robot, folder)
        cameras = dict(zip(trees, framing.log(recording, pairs, urdf, aspect=ASPECT), strict=True))
        panel, shown = links.log(recording, trees, pair)
    names = dict.fromkeys((*run.joint_names, *pair.before.run.joint_names))
    limb_plots = joints.log(recording, pair, limbs(tuple(names), trees.get("after")))
    loop = largest_change(pair, found)
    audible = _sounds(pair, loop[0])
    start = float(pair.time[0])
    for name, sound in audible.items():
        unstable.log_audio(recording, f"/sound/{name}", sound, TIMELINE, start=start)
    _log_text(recording, pair)
    return Contents(
        joints=limb_plots,
        classes=classes.log(recording, pair, found),
        ends=noise.log(recording, pair, found),
        spectra=noise.log_spectra(recording, pair),
        changes=panel,
        links=shown,
        cameras=cameras,
        events=bool(found),
        sounds=tuple(audible),
        loop=loop,
    )


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
