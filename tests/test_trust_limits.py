"""Limits are stated, and raised by an option that workers follow too."""

import numpy as np
import pytest
from commandline import call, complaint, refused

from noisemodel import MeshError, NoiseModelError, Run, files, meshes

TIME = np.arange(40) / 100


@pytest.fixture(autouse=True)
def own_environment(monkeypatch):
    for name in files.LIMITS:
        monkeypatch.setenv(f"NOISE_LIMIT_{name.upper()}", str(files.LIMITS[name]))


def test_more_joints_and_columns_are_read_if_that_is_asked_for(tmp_path):
    names = [f"j{n}.velocity" for n in range(1001)]
    rows = [",".join(map(str, (at, *np.full(1001, 0.1)))) for at in TIME]
    log = tmp_path / "log.csv"
    log.write_text("\n".join([",".join(["time", *names]), *rows]) + "\n")
    command = ("import", log, "-o", tmp_path / "run.npz")
    assert "1001 joints, the limit is 1000 (--limit joints=N raises it)" in refused(*command)
    status, _, err = call(*command, "--limit", "columns=1000", "--limit", "joints=1001")
    assert (status, "1002 columns, the limit is 1000 (--limit columns=N" in err) == (3, True)
    assert call(*command, "--limit", "joints=1001", "--limit", "columns=2000")[0] == 0
    assert len(Run.load(tmp_path / "run.npz").joint_names) == 1001


def test_the_limit_of_triangles_is_how_many_a_mesh_may_have(tmp_path, monkeypatch):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n" + "f 1 2 3\n" * 5)
    monkeypatch.setenv("NOISE_LIMIT_TRIANGLES", "4")
    with pytest.raises(MeshError, match="5 triangles, the limit is 4 .--limit triangles=N"):
        meshes.read(tmp_path / "a.obj")


@pytest.mark.parametrize("given", ["joint=5", "joints", "joints=", "joints=-5", "joints=1e5"])
def test_a_limit_that_is_none_is_a_usage_error(given):
    assert "joints=N" in complaint("noise", "run.npz", "--limit", given, status=2)


@pytest.mark.parametrize("stated", ["many", "-1", "٣", "9" * 5000])
def test_a_limit_of_the_environment_that_is_no_number_is_named(monkeypatch, stated):
    monkeypatch.setenv("NOISE_LIMIT_JOINTS", stated)
    with pytest.raises(NoiseModelError, match="NOISE_LIMIT_JOINTS is .*, expected a whole number"):
        Run(time=TIME, velocity=np.ones((40, 1)), joint_names=("a",))
