import numpy as np
import pinocchio
import pytest
from commandline import call
from rerun.chunk import RrdReader
from test_noisemodel_mjcf import ARM, LEGS, one_body, write_stl, written
from typer.testing import CliRunner

from inspector.cli import app
from inspector.errors import InspectorError
from inspector.recording import robot as scene
from noisemodel import Robot
from noisemodel.compare import excitation


@pytest.fixture
def run_file(tmp_path):
    """A run of an arm from an MJCF, which has a mesh and two colours."""
    write_stl(tmp_path / "part.stl")
    text = ARM.replace(
        "<worldbody>",
        '<asset><mesh name="part" file="part.stl" scale="0.1 0.1 0.1"/></asset><worldbody>',
    ).replace(
        '<body name="tip" pos="0.3 0 0">',
        '<body name="tip" pos="0.3 0 0"><geom type="mesh" mesh="part" rgba="1 0 0 1"/>',
    )
    run = excitation(Robot.load(written(tmp_path, text, "arm.xml")))
    path = tmp_path / "run.npz"
    run.save(path)
    return path


def inspector(*arguments):
    status, out, err = call(*arguments)
    assert status == 0, err
    return out


def drawn(recording):
    """Paths of the meshes of a recording."""
    return {
        str(chunk.entity_path)
        for chunk in RrdReader(recording).stream().to_chunks()
        if "Asset3D:blob" in chunk.to_record_batch().schema.names
    }


def test_a_recording_has_the_meshes_of_a_robot_of_an_mjcf(run_file, tmp_path):
    saved = tmp_path / "run.rrd"
    inspector("view", run_file, "-o", saved)
    paths = drawn(saved)
    assert len(paths) == 5  # a ball on each of four bodies, and the mesh in another colour
    assert sum("/tip/" in path for path in paths) == 2


@pytest.mark.parametrize("text", [ARM, LEGS])
def test_what_is_drawn_moves_as_the_robot(tmp_path, text):
    robot = Robot.load(written(tmp_path, text))
    path = written(tmp_path, scene.drawable_mjcf(robot, tmp_path), "drawn.urdf")
    root = (pinocchio.JointModelFreeFlyer(),) if robot.floating_base else ()
    model = pinocchio.buildModelFromUrdf(str(path), *root)
    assert list(model.names)[1 + len(root) :] == [j.name for j in robot.joints[len(root) :]]
    for joint in range(1 + len(root), model.njoints):
        ours = robot.model.jointPlacements[joint].homogeneous
        np.testing.assert_allclose(model.jointPlacements[joint].homogeneous, ours, atol=1e-12)
        kind = robot.model.joints[joint].shortname()
        if kind.endswith("Unaligned"):
            axes = [m.joints[joint].createData().S for m in (model, robot.model)]
            np.testing.assert_allclose(*axes, atol=1e-12)


def test_a_link_without_visual_geometry_is_drawn_as_it_collides(tmp_path):
    body = '<body name="tip" pos="0.3 0 0"><joint name="wrist" axis="1 0 0"/><geom group="3"'
    text = ARM.replace(
        '<body name="tip" pos="0.3 0 0"><joint name="wrist" axis="1 0 0"/><geom', body
    )
    assert text != ARM
    tree = scene.load(str(written(tmp_path, text)), tmp_path)
    drawn = {link for link, shapes in scene.shapes_by_link(tree).items() if shapes}
    assert drawn == {"foot", "upper", "body3", "tip"}


def test_a_missing_mesh_is_named_with_the_way_out(tmp_path):
    head = '<asset><mesh name="m" file="gone.stl"/></asset>'
    path = written(tmp_path, one_body('<geom type="mesh" mesh="m"/>', head=head))
    with pytest.raises(InspectorError, match=r"gone\.stl: not found in .*--robot none"):
        scene.load(str(path), tmp_path)


def test_a_base_that_floats_is_the_root_and_the_world_is_left_out(tmp_path):
    door = '<body name="door"><joint name="hinge"/><geom size="1"/></body></worldbody>'
    path = written(tmp_path, LEGS.replace("</worldbody>", door))
    tree = scene.load(str(path), tmp_path)
    assert tree.root_link().name == "trunk"
    assert [joint.name for joint in tree.joints()] == ["hip", "knee"]


def test_commands_take_the_path_of_an_mjcf(run_file, tmp_path):
    mjcf = tmp_path / "arm.xml"
    assert "arm" in inspector("noise", "--robots", mjcf, "--kind", "rms", "--kind", "mean")
    rows = ["time," + ",".join(f"{name}.velocity,{name}.position" for name in ("lift", "turn"))]
    rows += [f"{i / 500},0.1,{i / 5000},0.2,{i / 2500}" for i in range(1000)]
    log = written(tmp_path, "\n".join(rows), "log.csv")
    inspector("import", log, "--robot", mjcf, "-o", tmp_path / "imported.npz")
    with np.load(tmp_path / "imported.npz") as arrays:
        assert str(arrays["robot"]) == str(mjcf)
    saved = tmp_path / "live.rrd"
    result = CliRunner().invoke(
        app,
        ["live", "--rate", "500", "--robot", str(mjcf), "--save", str(saved)],
        input=log.read_text(),
    )
    assert result.exit_code in (0, 1, 4), result.output
    assert len(drawn(saved)) == 5
