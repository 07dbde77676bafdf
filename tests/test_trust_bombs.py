"""Small files that ask for much memory or time end in one line, soon."""

import os
import struct
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest
from checks import one_line
from test_noisemodel_runfile import headed, packed

import noiseclassifier as nc
from inspector.errors import LogError
from inspector.library import load_library, model_files
from inspector.logs.read import read_log
from noisemodel import Robot, RobotError, Run, RunFileError, meshes
from noisemodel.surface import LinkSurface, fine
from noisemodel.types import MeshError

READERS = ((Run.load, RunFileError), (read_log, LogError))
MODELS = (lambda path: load_library([path]), nc.FileError)


def refused(path, problem, readers=READERS):
    """Check that each way to read a file says in one line why it does not."""
    for read, error in readers:
        with one_line(error, problem):
            read(path)


LAUGHS = "".join(f'<!ENTITY l{n + 1} "{f"&l{n};" * 10}">' for n in range(9))


def test_a_scene_whose_instances_double_is_refused(tmp_path):
    nodes = "".join(
        f'<node id="n{n}"><instance_node url="#n{n + 1}"/><instance_node url="#n{n + 1}"/></node>'
        for n in range(60)
    )
    path = tmp_path / "a.dae"
    path.write_text(
        f'<COLLADA><library_nodes>{nodes}<node id="n60"/></library_nodes><library_visual_scenes>'
        '<visual_scene id="s"><node><instance_node url="#n0"/></node></visual_scene>'
        '</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>'
    )
    with pytest.raises(MeshError, match="more than 10000 nodes with their instances"):
        meshes.read(path)


def test_a_polygon_of_many_slender_triangles_has_no_more_fine_points_than_others(tmp_path):
    angle = np.linspace(0, 2 * np.pi, 10_000, endpoint=False)
    rim = np.stack((np.cos(angle), np.sin(angle), np.zeros_like(angle)), axis=1)
    corners = np.stack((np.broadcast_to(rim[0], rim[1:-1].shape), rim[1:-1], rim[2:]), axis=1)
    assert len(fine(corners).points) <= 1_000_000
    assert LinkSurface.of(corners, None).area == pytest.approx(np.pi, rel=1e-6)


LAUGHING = f'<!DOCTYPE a [<!ENTITY l0 "ha">{LAUGHS}]>'
ATTRIBUTES = "".join(f'a{n}="" ' for n in range(100_000))


@pytest.mark.parametrize(("name", "root"), [("r.urdf", "robot"), ("r.xml", "mujoco")])
@pytest.mark.parametrize(
    ("text", "encoding", "problem"),
    [
        ("{laughs}<{root}>&l9;</{root}>", "utf-8", "no document type or entities are read"),
        ("{laughs}<{root}>&l9;</{root}>", "utf-16", "no document type or entities are read"),
        ("<{root}>{links}</{root}>", "utf-8", "nested more than 500 deep"),
        ("<{root}><a {attributes}/></{root}>", "utf-8", "an element has more than 200 attributes"),
        ("{comments}", "utf-8", "not XML"),
    ],
)
def test_text_of_a_robot_that_asks_for_much_is_refused(
    tmp_path, name, root, text, encoding, problem
):
    whole = text.format(
        root=root, laughs=f'<?xml version="1.0" encoding="{encoding}"?>{LAUGHING}',
        links="<link name='a'>" * 100_000 + "</link>" * 100_000,
        attributes=ATTRIBUTES, comments="<!--" * 1_000_000,
    )  # fmt: skip
    (tmp_path / name).write_text(whole, encoding=encoding)
    with pytest.raises(RobotError, match=problem):
        Robot.load(tmp_path / name)


def attached(folder, count):
    """MJCFs that attach the next one twice each."""
    for n in range(count):
        model = f'<asset><model name="m" file="a{n + 1}.xml"/></asset>' if n < count - 1 else ""
        arm = '<body name="{0}"><attach model="m" body="b" prefix="{0}"/></body>' if model else ""
        (folder / f"a{n}.xml").write_text(
            f"<mujoco>{model}<worldbody><body name='b'>{arm.format('l')}{arm.format('r')}"
            "<geom size='1'/></body></worldbody></mujoco>"
        )
    return folder / "a0.xml"


def test_models_that_attach_each_other_twice_are_one_line(tmp_path, apart):
    assert len(Robot.load(attached(tmp_path, 3)).joints) == 0
    with one_line(RobotError, "a0.xml: MuJoCo "):
        Robot.load(attached(tmp_path, 40))


@pytest.mark.parametrize(
    "element",
    [
        '<flexcomp name="f" type="grid" count="300 300 300"/>',
        '<composite type="cable" prefix="a" count="1000000 1 1"/>',
        "<body/>" * 30_000,
        "<body><joint/></body>" * 15_000,
    ],
)
def test_an_mjcf_of_more_than_any_robot_has_is_one_line(tmp_path, apart, element):
    path = tmp_path / "r.xml"
    path.write_text(f'<mujoco><worldbody><body name="b">{element}</body></worldbody></mujoco>')
    with one_line(RobotError, "r.xml: (MuJoCo |30002 bodies)"):
        Robot.load(path)


@pytest.mark.parametrize("kind", ["gmsh", "mesh"])
def test_a_flex_of_a_pipe_is_refused_unopened(tmp_path, kind):
    os.mkfifo(tmp_path / "f.msh")
    flex = f'<body name="b"><flexcomp name="f" type="{kind}" file="f.msh"/></body>'
    (tmp_path / "r.xml").write_text(f"<mujoco><worldbody>{flex}</worldbody></mujoco>")
    with pytest.raises(RobotError, match=r"r.xml: names 'f.msh', which is no regular file"):
        Robot.load(tmp_path / "r.xml")


@pytest.mark.parametrize("element", ["hfield", "texture"])
def test_a_tiny_png_that_states_a_huge_size_is_one_line_or_not_read(tmp_path, element):
    (tmp_path / "a.png").write_bytes(png(60_000, 60_000))
    more = 'type="2d"' if element == "texture" else 'size="1 1 1 1"'
    asset = f'<asset><{element} name="a" file="a.png" {more}/></asset>'
    (tmp_path / "r.xml").write_text(f"<mujoco>{asset}<worldbody/></mujoco>")
    if element == "texture":
        assert Robot.load(tmp_path / "r.xml").joints == ()
    else:
        with pytest.raises(RobotError, match=r"r.xml: MuJoCo cannot read the MJCF .*PNG"):
            Robot.load(tmp_path / "r.xml")


def png(width, height):
    """A picture that states a size and holds a thousand bytes."""
    parts = {b"IHDR": struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)}
    parts |= {b"IDAT": zlib.compress(bytes(1000)), b"IEND": b""}
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in parts.items()
    )


def test_an_archive_of_zeros_is_refused_before_it_is_unpacked(tmp_path):
    path = tmp_path / "run.npz"
    zeros = bytes(2**20)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        with archive.open("velocity.npy", "w", force_zip64=True) as member:
            for _ in range(600):
                member.write(zeros)
        archive.writestr("time.npy", b"")
    refused(path, r"unpacks to 0.629 GB from 0.6\d+ MB, .*--max-unpacked")


@pytest.mark.parametrize(
    "header",
    [
        "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (-1,), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (0, " + "9" * 30 + "), }",
        "{'descr': '<U0', 'fortran_order': False, 'shape': (1000000000000,), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (1.5,), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (" + "9" * 60 + ",), }",
        "{'descr': [('a', '<f8')] * 9, 'fortran_order': False, 'shape': (), }",
        "{'descr': 'O', 'fortran_order': False, 'shape': (), }",
        "(" * 100,
        "'",
        "{",
        "\n\t   ]",
    ],
)
def test_a_broken_header_of_an_array_is_one_line(tmp_path, header):
    array = headed(header)
    path = packed(tmp_path / "run.npz", zipfile.ZIP_DEFLATED, time=array, velocity=array)
    refused(path, "time")


def test_a_second_member_of_one_name_is_refused(tmp_path):
    path = tmp_path / "run.npz"
    np.savez(path, time=np.arange(40) / 1000, velocity=np.ones((40, 2)))
    with zipfile.ZipFile(path) as archive:
        again = archive.read("velocity.npy")
    with pytest.warns(UserWarning, match="Duplicate"), zipfile.ZipFile(path, "a") as archive:
        archive.writestr("velocity.npy", again)
    refused(path, "two arrays named 'velocity'")


@pytest.mark.parametrize("method", [zipfile.ZIP_STORED, zipfile.ZIP_LZMA])
def test_an_array_whose_name_has_control_characters_is_refused(tmp_path, method):
    path = tmp_path / "run.npz"
    with zipfile.ZipFile(path, "w", method) as archive:
        archive.writestr("a\n\x1b[31m.npy", b"")
    refused(path, r"has an array named 'a\\n\\x1b\[31m'")


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_methods_that_unpack_gigabytes_at_once_are_not_read(tmp_path, method):
    with zipfile.ZipFile(tmp_path / "run.npz", "w", method) as archive:
        archive.writestr("time.npy", bytes(10**6))
    with pytest.raises(RunFileError, match="another method than NumPy's"):
        Run.load(tmp_path / "run.npz")


@pytest.mark.parametrize("text", ["[" * 100_000, '{"a": 1' + "0" * 400 + "}", "\0"])
def test_a_hostile_manifest_of_a_model_is_one_line(tmp_path, text):
    with np.load(model_files()[0]) as shipped:
        np.savez(tmp_path / "m.npz", **{**shipped, "manifest": np.array(text)})
    with one_line(nc.FileError, "m.npz: manifest is no JSON"):
        load_library([tmp_path / "m.npz"])


def test_a_device_is_no_file():
    refused(Path("/dev/zero"), "is no regular file", (*READERS, MODELS))


def test_an_archive_whose_names_are_no_text_is_one_line(tmp_path):
    path = tmp_path / "run.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("é\n.npy", b"")
    path.write_bytes(path.read_bytes().replace("é".encode(), b"\xff\xfe"))
    refused(path, None, (*READERS, MODELS))
