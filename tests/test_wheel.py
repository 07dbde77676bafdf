"""An installed wheel works outside of the checkout."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    pip = [sys.executable, "-m", "pip", "--quiet", "--no-input"]
    build = ["wheel", "--no-deps", "--no-build-isolation", "--no-index", "-w", folder, ROOT]
    subprocess.run([*pip, *build], check=True)
    (wheel,) = folder.glob("noise_inspector-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder


def test_the_wheel_carries_what_the_commands_use(installed):
    site = installed / "site"
    assert (site / "inspector" / "assets" / "runs" / "demo.npz").is_file()
    assert list((site / "inspector" / "assets" / "models").glob("*.npz"))
    assert not list(site.glob("tests*"))


def test_the_demo_is_viewed_and_classified_from_an_installed_wheel(installed):
    environment = os.environ | {"PYTHONPATH": str(installed / "site"), "DISPLAY": ""}

    def inspector(*arguments):
        command = [sys.executable, "-m", "inspector", *arguments]
        return subprocess.run(
            command, cwd=installed, env=environment, capture_output=True, text=True
        )

    where = "import inspector; print(inspector.__file__)"
    found = subprocess.run(
        [sys.executable, "-c", where],
        cwd=installed,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert str(installed) in found.stdout
    viewed = inspector("view", "--save", "demo.rrd")
    assert viewed.returncode == 0, viewed.stderr
    assert (installed / "demo.rrd").stat().st_size > 1_000_000
    demo = installed / "site" / "inspector" / "assets" / "runs" / "demo.npz"
    assert inspector("classify", str(demo)).returncode == 1
