"""A wheel, installed in a new environment, works outside of the checkout and beside any modules."""

import os
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest
from commandline import ran

ROOT = Path(__file__).parents[1]
pytestmark = pytest.mark.slow

FIXTURE = """
def test_a_run_is_as_quiet_as_accepted(noise):
    noise.check("demo.npz")
"""
LIBRARY = "import inspector, noisemodel; print(inspector.analyse(noisemodel.Run.load('demo.npz')))"


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """Folder of an environment with the wheel, which borrows what the wheel depends on."""
    folder = tmp_path_factory.mktemp("wheel")
    pip = [sys.executable, "-m", "pip", "--quiet", "--no-input"]
    build = ["wheel", "--no-deps", "--no-build-isolation", "--no-index", "-w", folder, ROOT]
    subprocess.run([*pip, *build], check=True)
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "env"], check=True)
    (site,) = (folder / "env").glob("lib/python*/site-packages")
    (wheel,) = folder.glob("noise_inspector-*.whl")
    into = ["--python", folder / "env" / "bin" / "python"]
    subprocess.run([*pip, *into, "install", "--no-deps", "--no-index", wheel], check=True)
    borrowed = Path(sysconfig.get_path("purelib"))
    cmeel = next(borrowed.glob("cmeel.prefix/lib/python*/site-packages"))  # Pinocchio's
    (site / "borrowed.pth").write_text(f"{borrowed}\n{cmeel}\n")
    return folder / "env"


@pytest.fixture
def called(installed, tmp_path):
    """Calls a program of the environment in a folder with a run and hostile neighbours."""
    demo = next(installed.rglob("assets/runs/demo.npz"))
    (tmp_path / "demo.npz").symlink_to(demo)
    for name in ("models.py", "inspector_utils.py", "scenarios/__init__.py", "assets/__init__.py"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("raise ImportError('a neighbour was imported')\n")
    variables = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    alone = {"cwd": tmp_path, "env": variables | {"DISPLAY": ""}}
    return lambda program, *arguments: ran(installed / "bin" / program, *arguments, **alone)


def test_the_wheel_carries_what_the_commands_use(installed):
    assert next(installed.rglob("inspector/assets/runs/demo.npz")).is_file()
    assert list(installed.rglob("inspector/assets/models/*.npz"))
    assert not list(installed.rglob("tests*"))


def test_the_demo_is_opened_and_classified_by_the_shipped_model(called, tmp_path, installed):
    where = called("python", "-c", "import inspector; print(inspector.__file__)")
    assert str(installed) in where.stdout
    viewed = called("inspector", "view", "-o", "demo.rrd")
    assert viewed.returncode == 0, viewed.stderr
    assert (tmp_path / "demo.rrd").stat().st_size > 1_000_000
    found = called("inspector", "classify", "demo.npz")
    assert (found.returncode, found.stderr) == (1, "")
    assert "impact" in found.stdout


def test_neighbours_of_any_name_are_not_imported(called, tmp_path):
    found = called("python", "-c", LIBRARY)
    assert found.returncode == 0, found.stderr
    (tmp_path / "test_mine.py").write_text(FIXTURE)
    test = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "test_mine.py")
    ran = called("python", *test, "--noise-accept", "the first run")
    assert "a neighbour was imported" not in ran.stdout + ran.stderr
    assert "1 passed" in ran.stdout, ran.stdout
