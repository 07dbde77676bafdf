"""No file reads what lies outside of its own folders."""

import os
from contextlib import suppress
from pathlib import Path

import pytest
from checks import memory_below
from commandline import call, complaint

from noisemodel import Robot, RobotError, robot
from noisemodel.surface import triangles
from noisemodel.types import MeshError

OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
URDF = """<robot name="r"><link name="base"/><link name="arm"><visual><geometry>
<mesh filename="{}"/></geometry></visual></link>
<joint name="j" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
</joint></robot>"""


def urdf(folder: Path, address: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "r.urdf"
    path.write_text(URDF.format(address))
    return path


def mesh(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(OBJ)
    return path


@pytest.mark.parametrize(
    ("place", "file", "address"),
    [
        ("ws/arm/urdf", "ws/arm/meshes/a.obj", "package://arm/meshes/a.obj"),
        ("ws/arm/urdf", "ws/arm/meshes/a.obj", "package:///arm/meshes/a.obj"),
        ("ws/arm/urdf", "ws/arm/meshes/a.obj", "../meshes/a.obj"),
        ("ws/arm/urdf", "ws/arm/visual/a.obj", "../visual/a.obj"),
        ("ws/arm", "ws/arm/parts/a.obj", "parts/a.obj"),
        ("ws/arm/robots/v2/urdf", "ws/arm/x/a.obj", "package://arm/x/a.obj"),
    ],
)
def test_meshes_of_the_robots_own_folders_are_found(tmp_path, place, file, address):
    mesh(tmp_path / file)
    assert len(triangles(Robot.load(urdf(tmp_path / place, address)))[0]) == 1


def test_a_package_of_another_folder_name_is_known_by_its_package_xml(tmp_path):
    mesh(tmp_path / "clone-of-arm" / "meshes" / "a.obj")
    (tmp_path / "clone-of-arm" / "package.xml").touch()
    path = urdf(tmp_path / "clone-of-arm" / "robots" / "urdf", "package://arm/meshes/a.obj")
    assert len(triangles(Robot.load(path))[0]) == 1


@pytest.mark.parametrize(
    "address",
    ["../a.obj", "../../a.obj", "package://arm/../../a.obj", "package://../a.obj", "package://x/a"],
)
def test_a_file_above_the_robots_folders_is_not_opened(tmp_path, address):
    for folder in (tmp_path, tmp_path / "ws"):
        mesh(folder / "a.obj")
    path = urdf(tmp_path / "ws" / "arm", address)
    with pytest.raises(MeshError, match=r"(outside of|not found in).*--package-root"):
        triangles(Robot.load(path))


def test_a_neighbouring_package_needs_a_package_root(tmp_path):
    mesh(tmp_path / "ws" / "hand" / "a.obj")
    path = urdf(tmp_path / "ws" / "arm" / "urdf", "package://hand/a.obj")
    with pytest.raises(MeshError, match="not found in .*--package-root"):
        triangles(Robot.load(path))
    found = Robot.load(path, package_root=tmp_path / "ws")
    assert len(triangles(found)[0]) == 1
    with pytest.raises(RobotError, match="package root .*nowhere: there is no such folder"):
        Robot.load(path, package_root=tmp_path / "nowhere")


def test_a_home_and_what_contains_it_are_no_roots(tmp_path, monkeypatch):
    home = tmp_path / "people" / "me"
    home.mkdir(parents=True)
    monkeypatch.setenv("HOME", str(home))
    mesh(home / "private" / "a.obj")
    (home / "package.xml").touch()
    for folder, address in (
        (home, "private/a.obj"),
        (home / "urdf", "package://me/private/a.obj"),
        (home / "urdf", "package://people/me/private/a.obj"),
        (tmp_path / "people", "me/private/a.obj"),
    ):
        with pytest.raises(MeshError, match=r"(outside of|not found in)"):
            triangles(Robot.load(urdf(folder, address)))
    mesh(home / "meshes" / "a.obj")
    assert len(triangles(Robot.load(urdf(home, "meshes/a.obj")))[0]) == 1


def test_the_root_of_the_disk_is_no_root(tmp_path, monkeypatch):
    about = tmp_path.stat()
    monkeypatch.setattr(Path, "stat", lambda path, **_: about)
    monkeypatch.setattr(Path, "read_bytes", lambda path: b'"package://usr/x" "package://home/y"')
    for path in ("/r.urdf", "/usr/r/r.urdf", "/home/me/r.urdf", "/home/me/r/r.urdf"):
        for root in robot.package_roots(path):
            assert root not in (Path("/"), Path("/usr"), Path("/home"), Path("/home/me"))


def test_the_commands_take_a_package_root(tmp_path):
    mesh(tmp_path / "ws" / "hand" / "a.obj")
    path = urdf(tmp_path / "ws" / "arm" / "urdf", "package://hand/a.obj")
    rows = "".join(f"{i / 1000},{i % 7 / 10},{i % 5 / 10}\n" for i in range(1000))
    (tmp_path / "log.csv").write_text("time,j.position,j.velocity\n" + rows)
    command = ("noise", tmp_path / "log.csv", "--robot", path)
    assert "--package-root" in complaint(*command)
    assert call(*command, "--package-root", tmp_path / "ws")[0] == 0


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("r.urdf", '<robot name="r"><link name="a"/></robot>'),
        ("r.xml", "<mujoco><worldbody><geom size='1'/></worldbody></mujoco>"),
    ],
)
def test_a_robot_whose_name_is_not_utf8_is_read_or_one_line(tmp_path, name, text):
    path = tmp_path / os.fsdecode(b"\xff\xfe" + name.encode())
    path.write_text(text)
    with suppress(RobotError):
        assert Robot.load(path).path == path


@pytest.mark.parametrize("name", ["r.urdf", "r.xml"])
def test_a_robot_of_gigabytes_is_not_read(tmp_path, name):
    path = tmp_path / name
    path.touch()
    os.truncate(path, 3 * 10**9)
    with memory_below(200e6), pytest.raises(RobotError, match="larger than 67108864 bytes"):
        Robot.load(path)
