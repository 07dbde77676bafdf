import os
import re
import subprocess
import sys
from pathlib import Path

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def test_the_code_of_the_readme_runs(tmp_path):
    code = "\n".join(blocks("python")).replace("velocity=velocity,", "velocity=run.velocity,")
    code = code.replace("=velocity_desired)", "=run.velocity)")
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[1])},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "elbow.npz").exists()
    assert (tmp_path / "plain.npz").exists()


def test_the_first_screen_has_eight_lines_of_python():
    assert len([line for line in blocks("python")[0].splitlines() if line.strip()]) == 8


def test_every_command_of_the_readme_exists():
    from typer.main import get_command

    from inspector.cli import app

    known = set(get_command(app).commands)
    used = set(re.findall(r"^(?:\.venv/bin/)?inspector (\w+)", README, flags=re.MULTILINE))
    assert used <= known
    assert {"view", "classify", "import", "simulate", "train", "evaluate"} <= used


def test_pictures_of_the_first_log_are_small_and_fetch_nothing():
    pictures = sorted((Path(__file__).parents[1] / "assets" / "pictures").glob("first-log-*"))
    assert len(pictures) == 2
    assert all(picture.stat().st_size < 200_000 for picture in pictures)
    (svg,) = (picture.read_text() for picture in pictures if picture.suffix == ".svg")
    assert not re.search(r"url\((?!#)", svg)
