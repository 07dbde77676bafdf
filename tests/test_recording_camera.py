"""The robot is in view: laws of the camera, with the mesh and the kinematics of the noise model."""

import numpy as np
import pinocchio
import pytest
from recordings import layout, motion, read
from test_noisemodel_mjcf import ARM, LEGS, written

from inspector.analysis import analyse_file
from inspector.recording.robot import FIELD_OF_VIEW, fitted
from inspector.recording.run import write
from noisemodel import Robot, Run
from noisemodel.surface import triangles


def run_of(robot, name, seconds=1.0):
    """Every joint swings; what floats walks in a circle, turns, and bobs."""
    time = np.arange(round(seconds * 1000)) / 1000
    names = robot.joint_names
    phase = 2 * np.pi * (np.linspace(0.3, 0.9, len(names)) * time[:, None] + np.arange(len(names)))
    reach = np.array([0.1 if j.kind == "prismatic" else 0.6 for j in robot.joints if j.nv == 1])
    fields = {"velocity": reach * np.cos(phase), "position": reach * np.sin(phase)}
    fields |= {"time": time, "joint_names": names, "robot": name}
    if robot.floating_base:
        yaw = time
        pose = np.zeros((len(time), 7))
        pose[:, 0], pose[:, 1] = 4 * np.cos(time), 4 * np.sin(time)
        pose[:, 2] = 1.0 + 0.2 * np.sin(9 * time)
        pose[:, 5], pose[:, 6] = np.sin(yaw / 2), np.cos(yaw / 2)
        fields["base_pose"] = pose
    return Run(**fields)


def eye_of(recording):
    """What the blueprint says of the eye, by component."""
    return {name.partition(":")[2]: value[0] for _, name, value in layout(recording) if value}


def in_picture(points, eye, target, aspect):
    """Where points are in the picture: -1 to 1 from edge to edge, in both directions."""
    ahead = target - eye
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, ahead)
    offset = points - eye
    depth = offset @ ahead
    assert (depth > 0).all()
    slope = np.tan(FIELD_OF_VIEW / 2)
    return (
        np.stack([offset @ right / (aspect * slope), offset @ up / slope], axis=1) / depth[:, None]
    )


def placed(robot, run, samples):
    """All corners of all triangles of a robot, sample by sample, by Pinocchio."""
    surfaces = triangles(robot, "auto", world=True)
    corners = {i: each.reshape(-1, 3)[::7] for i, each in enumerate(surfaces) if len(each)}
    q, _ = robot.configuration(run)
    data = robot.model.createData()
    for sample in samples:
        pinocchio.forwardKinematics(robot.model, data, q[sample])
        poses = [data.oMi[joint] for joint in corners]
        yield np.concatenate(
            [
                points @ pose.rotation.T + pose.translation
                for pose, points in zip(poses, corners.values(), strict=True)
            ]
        )


@pytest.fixture(scope="module", params=["panda", "arm.xml", "legs.xml"])
def filmed(request, tmp_path_factory):
    """A robot, its run, and its recording: from a URDF, and from MJCFs on a base and floating."""
    folder = tmp_path_factory.mktemp("filmed")
    text = {"arm.xml": ARM, "legs.xml": LEGS}.get(request.param)
    name = request.param if text is None else str(written(folder, text, request.param))
    robot = Robot.load(name)
    run = run_of(robot, name)
    run.save(folder / "run.npz")
    write(analyse_file(folder / "run.npz", {}, links=True), folder / "run.rrd")
    return robot, run, folder / "run.rrd"


def test_every_link_is_in_the_picture_at_every_time(filmed):
    robot, run, recording = filmed
    eye = eye_of(recording)
    position, target = np.array(eye["position"]), np.array(eye["look_target"])
    samples = range(0, len(run.time), 20)
    moved = np.zeros((len(samples), 3))
    if robot.floating_base:
        assert eye["target_frame"] == "robot/_view"
        time, below = motion(recording, "robot/_view")
        np.testing.assert_allclose(time, run.time[::20], atol=1e-9)
        moved = below[:, :3]
        assert np.ptp(moved, axis=0)[:2].min() > 1.0  # it walks far out of the first picture
    most = 0.0
    for points, shift in zip(placed(robot, run, samples), moved, strict=True):
        seen = in_picture(points, position + shift, target + shift, 1.0)
        most = max(most, np.abs(seen).max())
    assert 0.7 < most < 1.0  # all of it is seen, and it fills the picture


def test_the_floor_is_below_the_robot_at_all_times(filmed):
    robot, run, recording = filmed
    plane = eye_of(recording)["plane"]
    assert plane[:3] == [0.0, 0.0, 1.0]
    places = list(placed(robot, run, range(0, len(run.time), 20)))
    assert min(points[:, 2].min() for points in places) == pytest.approx(plane[3], abs=0.02)
    if robot.floating_base:  # it lies still, wherever the robot walks
        _, (lines,) = read(recording, "/robot/floor", "LineStrips3D:strips")
        lines = np.array(lines)
        np.testing.assert_allclose(lines[..., 2], plane[3], atol=1e-6)
        for points in places:
            assert (lines.min(axis=(0, 1))[:2] < points.min(axis=0)[:2]).all()
            assert (lines.max(axis=(0, 1))[:2] > points.max(axis=0)[:2]).all()
        assert read(recording, "/robot/floor", "CoordinateFrame:frame")[1] == [["robot/_world"]]


def test_a_nearer_camera_would_not_see_all():
    points = np.random.default_rng(3).standard_normal((50, 3))
    for aspect in (0.6, 1.0, 2.0):
        camera = fitted([points], aspect=aspect)
        seen = np.abs(in_picture(points, camera.eye, camera.target, aspect))
        assert seen.max() == pytest.approx(0.84)  # the margin is kept, and touched
        ahead = camera.target - camera.eye
        nearer = camera.eye + 0.1 * ahead
        assert np.abs(in_picture(points, nearer, camera.target, aspect)).max() > 0.86


def test_a_robot_of_twice_the_size_or_of_none_is_the_same_picture():
    points = np.random.default_rng(3).standard_normal((50, 3))
    one, two = (fitted([scale * points]) for scale in (1.0, 2.0))
    np.testing.assert_allclose(two.eye, 2 * one.eye)
    np.testing.assert_allclose(two.target, 2 * one.target)
    assert two.floor == pytest.approx(2 * one.floor)
    camera = fitted([np.array([[1.0, 2.0, 3.0]])])  # of no size: in the middle
    assert np.isfinite(camera.eye).all()
    np.testing.assert_allclose(camera.target, [1.0, 2.0, 3.0], atol=0.01)
    assert camera.floor == 3.0
