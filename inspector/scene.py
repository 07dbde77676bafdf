"""The moving robot in a recording, from its URDF."""

import tempfile
from pathlib import Path

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from rerun.urdf import UrdfTree

from inspector import meshes, series
from noisemodel import robot, urdf
from noisemodel.errors import UnknownJointError
from noisemodel.run import Run

FRAMES_PER_SECOND = 50.0
MAX_FRAMES = 2000
WORLD = "world"


def load(name: str) -> UrdfTree:
    """Read the robot that a run names, for drawing.

    Args:
        name: A listed robot, or the path of a URDF.

    Returns:
        Rerun's tree of its links and joints.

    Raises:
        RobotError: If there is no such robot, or its URDF cannot be read.
        MeshError: If one of its meshes cannot be read.
    """
    path = robot.locate(name)
    urdf.read(path)
    roots = robot.package_roots(name)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / path.name
        copy.write_text(meshes.drawable(path, roots), encoding="utf-8")
        return UrdfTree.from_file_path(
            copy, entity_path_prefix="robot", static_transform_entity_path="/robot/fixed"
        )


def check_joints(tree: UrdfTree, run: Run) -> None:
    """Refuse a run that names joints which the robot does not have.

    Raises:
        UnknownJointError: Naming the first such joint.
    """
    known = [joint.name for joint in tree.joints() if joint.joint_type != "fixed"]
    for name in (*run.joint_names, *run.desired_joint_names):
        if name not in known:
            raise UnknownJointError(name, tree.name, known)


def log(recording: rr.RecordingStream, tree: UrdfTree, run: Run) -> None:
    """Log a robot and its motion.

    Args:
        recording: Where to.
        tree: The robot.
        run: A run with positions; joints that it does not name rest.
    """
    recording.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    rr.send_chunks(tree.stream(), recording=recording)
    assert run.position is not None
    step = max(1, round(run.rate / FRAMES_PER_SECOND), -(-len(run.time) // MAX_FRAMES))
    shown = np.arange(0, len(run.time), step)
    shown = shown[run.mask[shown]]
    columns = {name: run.position[shown, i] for i, name in enumerate(run.joint_names)}
    for joint in tree.joints():
        follows = joint.mimic
        if follows is not None and follows.joint in columns:
            angles = columns[follows.joint] * follows.multiplier + follows.offset
        elif joint.name in columns:
            angles = columns[joint.name]
        else:
            continue
        recording.send_columns(
            f"/robot/motion/{joint.name}",
            indexes=[series.at(run.time[shown])],
            columns=joint.compute_transform_columns(angles.tolist(), clamp=False),
        )
    if run.base_pose is not None:
        _log_base(recording, tree, run, shown)


def _log_base(
    recording: rr.RecordingStream, tree: UrdfTree, run: Run, shown: NDArray[np.intp]
) -> None:
    assert run.base_pose is not None
    pose = run.base_pose[shown]
    recording.send_columns(
        "/robot/motion/base",
        indexes=[series.at(run.time[shown])],
        columns=rr.Transform3D.columns(
            translation=pose[:, :3],
            quaternion=pose[:, 3:],
            parent_frame=[WORLD] * len(pose),
            child_frame=[tree.root_link().name] * len(pose),
        ),
    )
