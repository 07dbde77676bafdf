"""What is drawn of a robot: the noise model's triangles, where Pinocchio puts them."""

from pathlib import Path

import numpy as np
import pinocchio
import pytest
import rerun as rr
from recordings import read
from test_noisemodel_mjcf import ARM, LEGS, write_stl, written

from inspector.errors import InspectorError
from inspector.recording.robot import log_robot
from noisemodel import Robot, meshes
from noisemodel.meshes import FACET

TRIANGLE = b"\0" * 80 + (1).to_bytes(4, "little") + b"\0" * 50


def robot(folder: Path, mesh: str) -> Path:
    path = folder / "robot.urdf"
    path.write_text(
        f"""<robot name="r"><link name="base"><visual><geometry><mesh filename="{mesh}"/></geometry>
        <material name="m"><texture/></material></visual>
        <collision><geometry><box size="1 1 1"/></geometry></collision></link></robot>"""
    )
    return path


def drawn(path):
    """Draw a robot into no file."""
    return log_robot(rr.RecordingStream("test"), str(path), ())


def test_a_mesh_that_cannot_be_read_is_named_with_the_way_out(tmp_path):
    (tmp_path / "cut.stl").write_bytes(TRIANGLE[:-1])
    problem = "mesh .*cut.stl: .*is cut off, 1 triangles do not fit 133 bytes.*--robot none"
    with pytest.raises(InspectorError, match=problem):
        drawn(robot(tmp_path, "cut.stl"))


@pytest.mark.parametrize("address", ["../../secret.stl", "file:///{outside}/secret.stl"])
def test_no_mesh_is_read_outside_of_the_robots_folders(tmp_path, address):
    inner = tmp_path / "a" / "b"
    inner.mkdir(parents=True)
    (tmp_path / "secret.stl").write_bytes(TRIANGLE)
    with pytest.raises(InspectorError, match="lies outside of"):
        drawn(robot(inner, address.format(outside=tmp_path)))


def test_a_link_is_drawn_by_the_triangles_of_its_mesh_with_their_normals(tmp_path):
    write_stl(tmp_path / "part.stl")
    recording = rr.RecordingStream("test")
    recording.save(tmp_path / "out.rrd")
    log_robot(recording, str(robot(tmp_path, "part.stl")), ())
    recording.disconnect()
    _, ((blob,),) = read(tmp_path / "out.rrd", "/robot/_fixed", "Asset3D:blob")
    facets = np.frombuffer(bytes(blob)[84:], FACET)
    corners = meshes.read(tmp_path / "part.stl")
    np.testing.assert_allclose(facets["corners"], corners)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(across, axis=1)
    np.testing.assert_allclose((facets["normal"] * across).sum(axis=1), length, rtol=1e-6)


@pytest.mark.parametrize("name", ["panda", "talos", "tiago", "hyq", "arm.xml", "legs.xml"])
def test_links_stand_where_pinocchio_puts_them(tmp_path, name):
    text = {"arm.xml": ARM, "legs.xml": LEGS}.get(name)
    path = name if text is None else written(tmp_path, text, name)
    found = drawn(path)
    assert len(found.outermost) >= 3
    model, random = found.robot.model, np.random.default_rng(1)
    names = Robot.load(path, mimic=True).joint_names
    columns = {joint: random.uniform(-1.0, 1.0, 3) for joint in names}
    poses = found.poses(3, columns, None)
    angles = dict(columns)
    for joint, mimic in found.mimics.items():
        if not model.existJointName(joint):
            continue  # a joint that is fixed
        angles[joint] = mimic.multiplier * columns[mimic.joint] + mimic.offset
    for sample in range(3):
        q = pinocchio.neutral(model)
        for joint, angle in angles.items():
            first = model.idx_qs[model.getJointId(joint)]
            if model.nqs[model.getJointId(joint)] == 2:
                q[first : first + 2] = np.cos(angle[sample]), np.sin(angle[sample])
            else:
                q[first] = angle[sample]
        data = model.createData()
        pinocchio.forwardKinematics(model, data, q)
        for index, pose in zip(found.outermost, poses[sample], strict=True):
            wanted = pinocchio.SE3ToXYZQUAT(data.oMi[index])
            np.testing.assert_allclose(pose[:3], wanted[:3], atol=1e-9)
            assert abs(pose[3:] @ wanted[3:]) == pytest.approx(1.0, abs=1e-9)


def test_a_link_without_visual_geometry_is_drawn_as_it_collides(tmp_path):
    body = '<body name="tip" pos="0.3 0 0"><joint name="wrist" axis="1 0 0"/><geom group="3"'
    text = ARM.replace(
        '<body name="tip" pos="0.3 0 0"><joint name="wrist" axis="1 0 0"/><geom', body
    )
    assert text != ARM
    assert drawn(written(tmp_path, text)).links == ["_fixed", "upper", "body3", "tip"]


def test_what_belongs_to_the_world_of_a_base_that_floats_is_left_out(tmp_path):
    door = '<body name="door"><joint name="hinge"/><geom size="1"/></body></worldbody>'
    path = written(tmp_path, LEGS.replace("</worldbody>", door))
    assert drawn(path).links == ["trunk", "left", "shin"]


def test_links_of_any_name_are_drawn(tmp_path):
    text = ARM.replace('"tip"', '"_fixed/a b"').replace('"upper"', '"_world"')
    found = drawn(written(tmp_path, text))
    paths = [*map(found.path, found.links)]
    assert paths[1:] == ["robot/_world", "robot/body3", r"robot/_fixed\/a\ b"]
