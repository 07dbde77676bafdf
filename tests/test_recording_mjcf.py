import numpy as np
import pytest
from commandline import printed
from rerun.chunk import RrdReader
from test_noisemodel_mjcf import ARM, write_stl, written
from typer.testing import CliRunner

from inspector.cli import app
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
    return printed(*arguments)


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
    assert paths == {f"/robot/{link}" for link in ("_fixed", "upper", "body3", "tip")}


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
    assert len(drawn(saved)) == 4
