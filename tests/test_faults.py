"""Commands that write: on a disk that is full or read-only, or killed.

A file either appears whole under its name or not at all, and the same command succeeds afterwards.
"""

import ctypes
import os
import resource
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from inspector.library import demo_run
from noisemodel import Run

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="uses prctl and /proc"),
]

ROOT = Path(__file__).parents[1]
# Commands that write one file, by what it is.
FILES = {
    "view": ("view", "plain.npz", "-o", "out/run.rrd"),
    "report": ("view", "plain.npz", "-o", "out/run.html"),
    "export csv": ("export", "plain.npz", "-o", "out/run.csv"),
    "export mcap": ("export", "plain.npz", "-o", "out/run.mcap"),
    "export parquet": ("export", "plain.npz", "-o", "out/run.parquet"),
    "import": ("import", "log.csv", "-o", "out/run.npz"),
    "noise": ("noise", "run.npz", "--csv", "out/noise.csv"),
    "compare csv": ("noise", "--compare", "run.npz", "--csv", "out/compare.csv"),
    "listen": ("listen", "run.npz", "-o", "out/run.wav"),
    "labels": ("export", "run.npz", "--labels", "annotated", "-o", "out/labels.txt"),
    "classify": ("classify", "good", "--write", "json=out/verdicts.json"),
    "resume": ("classify", "good", "--resume", "out/state.jsonl"),
    "simulate": ("simulate", "run", "panda", "--duration", "3", "-o", "out/simulated.npz"),
    "live": ("live", "--rate", "1000", "--save", "out/live.rrd"),
}
# One of each way in which a file grows: by rerun, in pieces, by pyarrow, by lines, at once.
WRITERS = ("view", "export mcap", "export parquet", "resume", "import", "live")
# Commands that write a folder.
FOLDERS = {
    "import": ("import", "logs", "-o", "out"),
    "report": ("classify", "good", "--report", "out"),
    "diff": ("diff", "good", "good", "--report", "out"),
    "accept": ("accept", "good", "--reason", "good", "-o", "out"),
}
ROWS = "time,elbow.velocity\n" + "".join(f"{k / 1000},{k % 70 / 70}\n" for k in range(4000))


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """Runs and logs, to be copied for each command."""
    folder = tmp_path_factory.mktemp("inputs")
    demo = Run.load(demo_run())
    kept = ("time", "velocity", "velocity_desired", "position")
    thin = {name: getattr(demo, name)[::10] for name in kept}
    run = Run(**thin, joint_names=demo.joint_names, robot=demo.robot, blocks=demo.blocks)
    run.save(folder / "run.npz")
    replace(run, robot=None).save(folder / "plain.npz")
    (folder / "good").mkdir()
    time = np.arange(8000) / 1000
    for k in range(2):
        speed = 0.5 * np.sin(time * (1 + k / 10))[:, None]
        Run(time=time, velocity=speed, joint_names=("elbow",)).save(folder / f"good/{k}.npz")
    (folder / "log.csv").write_text(ROWS)
    (folder / "logs").mkdir()
    for name in ("a.csv", "b.csv"):
        (folder / "logs" / name).write_text(ROWS)
    return folder


@pytest.fixture
def place(inputs, tmp_path):
    """A copy of the inputs with an empty folder `out`."""
    shutil.copytree(inputs, tmp_path, dirs_exist_ok=True)
    (tmp_path / "out").mkdir()
    return tmp_path


def start(place, arguments, *, before=None, **environment):
    return subprocess.Popen(
        [sys.executable, "-m", "inspector", *arguments],
        cwd=place,
        env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
        **dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE),
        text=True,
        preexec_fn=before,
    )


def run(place, arguments, **settings):
    """Run a command to its end; exit status and standard error."""
    process = start(place, arguments, **settings)
    _, err = process.communicate(ROWS if arguments[0] == "live" else "")
    assert "Traceback" not in err
    return process.returncode, err


def written(place):
    return {each.name: each.stat().st_size for each in (place / "out").iterdir()}


@pytest.fixture(scope="module")
def undisturbed(inputs, tmp_path_factory):
    """What a command ends with and writes, by its arguments; run when it is first asked for."""
    known = {}

    def look_up(arguments):
        if arguments not in known:
            place = tmp_path_factory.mktemp("undisturbed")
            shutil.copytree(inputs, place, dirs_exist_ok=True)
            (place / "out").mkdir()
            status, err = run(place, arguments)
            assert status in (0, 1, 4), err
            known[arguments] = status, written(place)
        return known[arguments]

    return look_up


@pytest.mark.parametrize("arguments", FILES.values(), ids=FILES)
def test_a_full_disk_leaves_no_file_and_ends_with_5(place, undisturbed, arguments):
    ((name, size),) = undisturbed(arguments)[1].items()

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (size // 2, size // 2))

    status, err = run(place, arguments, before=limit)
    assert status == 5, err
    assert f"out/{name}: cannot be written (File too large)" in err.splitlines()[-1]
    assert written(place) == {} or LINES in arguments


# A command with this option writes its file line by line, and reads what was killed.
LINES = "--resume"


def without_override():
    """Let the permissions of files count for root as well."""
    drop_from_bounding_set, dac_override = 24, 1
    ctypes.CDLL(None).prctl(drop_from_bounding_set, dac_override, 0, 0, 0)


@pytest.mark.parametrize("arguments", [*map(FILES.get, WRITERS)], ids=WRITERS)
def test_a_read_only_folder_is_one_line_and_ends_with_5(place, arguments):
    (place / "out").chmod(0o555)
    try:
        status, err = run(place, arguments, before=without_override)
        assert (status, written(place)) == (5, {}), err
    finally:
        (place / "out").chmod(0o755)
    assert err.splitlines()[-1].endswith(": cannot be written (Permission denied)")


def kill_while_writing(place, arguments):
    """Kill a command as soon as anything is in its folder."""
    with start(place, arguments) as process:
        if arguments[0] == "live":
            process.stdin.write(ROWS)
            process.stdin.flush()
        else:
            process.stdin.close()
        while process.poll() is None and not os.listdir(place / "out"):
            time.sleep(0.001)
        process.kill()


def finished(place):
    """Sizes of the files that are no temporary ones."""
    return {name: size for name, size in written(place).items() if not name.startswith(".")}


@pytest.mark.parametrize("arguments", [*map(FILES.get, WRITERS)], ids=WRITERS)
def test_a_command_that_was_killed_leaves_a_whole_file_or_none(place, undisturbed, arguments):
    status, whole = undisturbed(arguments)
    kill_while_writing(place, arguments)
    left = finished(place)
    if LINES not in arguments:
        assert left in ({}, whole)
    again = (*arguments, "--overwrite") if left and LINES not in arguments else arguments
    assert run(place, again)[0] == status
    assert set(finished(place)) == set(whole)


@pytest.mark.parametrize("arguments", FOLDERS.values(), ids=FOLDERS)
def test_a_folder_of_a_command_that_was_killed_is_completed(place, undisturbed, arguments):
    status, whole = undisturbed(arguments)
    kill_while_writing(place, arguments)
    again = arguments if arguments[0] in ("import", "accept") else (*arguments, "--overwrite")
    assert run(place, again)[0] == status
    assert set(finished(place)) == set(whole)
