"""The plugin, in a pytest of its own."""

import os
import re
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from commandline import python
from hypothesis import example, given
from hypothesis import strategies as st

from inspector.pytest_plugin.noisecheck import name_of

ROOT = Path(__file__).parents[1]
RUNS = """
import numpy as np
import pytest
from noisemodel import Run

def run(seed, tone=0.0):
    random = np.random.default_rng(seed)
    time = np.arange(4000) / 1000
    slow = np.exp(-(((time - 1.5) / 0.4) ** 2)) + 0.5 * np.exp(-((time - 3.0) ** 2))
    velocity = slow[:, None] + 0.002 * random.normal(size=(4000, 2))
    velocity[:, 1] += tone * np.sin(2 * np.pi * 80 * time) * ((time > 1) & (time < 3))
    return Run(time=time, velocity=velocity, joint_names=("elbow", "wrist"))
"""

PROCESSES = [(), pytest.param(("-p", "xdist", "-n", "2"), marks=pytest.mark.slow)]


@pytest.fixture
def project(tmp_path):
    """Run pytest on a test file below a folder of its own: exit status and output."""

    def call(tests, *options):
        (tmp_path / "test_robot.py").write_text(RUNS + tests)
        command = ["-m", "pytest", "-q", "-p", "inspector.pytest_plugin", "-p", "no:cacheprovider"]
        command += ["--rootdir", tmp_path, "-c", "/dev/null", *options, tmp_path / "test_robot.py"]
        env = os.environ | {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}  # it may be installed, too
        done = python(*command, cwd=ROOT, env=env)
        return done.returncode, done.stdout + done.stderr

    return call


QUIET = """
def test_quiet(noise):
    (verdict,) = noise.check(run(0))
    assert not verdict.events

def test_loud(noise):
    noise.check(run(0, tone=0.5))

@pytest.mark.parametrize("place", ["oscillations", ("oscillations", 0.8, 3.2)])
def test_allowed(noise, place):
    (verdict,) = noise.check(run(0, tone=0.5), allow=[place, "impact"])
    assert verdict.events

def test_allowed_elsewhere(noise):
    noise.check(run(0, tone=0.5), allow=[("oscillations", 0.0, 0.5), "impact"])
"""


@pytest.mark.slow
@pytest.mark.parametrize("processes", PROCESSES)
def test_a_finding_fails_with_its_name_a_recording_and_a_picture(project, tmp_path, processes):
    status, out = project(QUIET, *processes, "--junitxml", tmp_path / "junit.xml")
    assert status == 1
    assert "2 failed, 3 passed" in out
    assert "in the run, by model general" in out
    assert "oscillations from 1." in out
    left = sorted(path.name for path in (tmp_path / "noise-artefacts").iterdir())
    assert left == [
        f"test_robot-test_{name}.{kind}"
        for name in ("allowed_elsewhere", "loud")
        for kind in ("png", "rrd")
    ]
    named = {
        p.get("name"): p.get("value") for p in ET.parse(tmp_path / "junit.xml").iter("property")
    }
    assert Path(named["noise_recording"]).exists()
    assert Path(named["noise_picture"]).exists()


CHECKED = """
TONE = {tone}

def test_one(noise):
    noise.check(run({first}, TONE))

def test_repetitions(noise):
    noise.check([run(seed, TONE) for seed in range({first}, {first} + 3)], name="reach")
"""


@pytest.mark.slow
@pytest.mark.parametrize("processes", PROCESSES)
def test_runs_are_compared_with_accepted_ones(project, tmp_path, processes):
    tests = CHECKED.format(tone=0.0, first=0)
    assert project(tests, "--noise-accept", "first release", *processes)[0] == 0
    text = (tmp_path / "reference" / "reference.toml").read_text()
    assert text.count("[[scenario.repetition]]") == 4
    assert text.count('reason = "first release"') == 2
    assert project(CHECKED.format(tone=0.0, first=5))[0] == 0
    status, out = project(CHECKED.format(tone=0.05, first=5), *processes)
    assert status == 1
    assert "2 failed" in out
    assert 'meant to be so? pytest --noise-accept "reason" accepts it' in out
    first = (
        r"noise: \w+ \d.\d\d-\d.\d\d s, wrist.*, 64-128 Hz, \+\d+ dB over 3 repetitions \(reach\)"
    )
    assert re.search(first, out), out
    left = {path.name for path in (tmp_path / "noise-artefacts").iterdir()}
    assert {"test_robot-test_one.rrd", "test_robot-test_one.png"} <= left
    loud = CHECKED.format(tone=0.05, first=5)
    assert project(loud, "--noise-accept", "a new gear", *processes)[0] == 0
    assert project(loud)[0] == 0


SEEDS = """
@pytest.mark.parametrize("seed", [1, 0, 2])
def test_turn(noise, seed):
    noise.check(run(seed, 0.05 if seed == 1 else 0.0), name="turn")
"""


def test_runs_of_one_name_that_several_tests_accept_are_its_repetitions(project, monkeypatch):
    assert project(SEEDS, "--noise-accept", "first release")[0] == project(SEEDS)[0] == 0
    said = "ERROR: --noise-accept: say why the runs are accepted\n\n"
    assert project(SEEDS, "--noise-accept", " ") == (4, said)
    monkeypatch.setenv("CI", "true")
    said = "ERROR: CI=true: a person accepts runs, after review (CI= overrides)\n\n"
    assert project(SEEDS, "--noise-accept", "more") == (4, said)


STRANGE = """
from dataclasses import replace

def test_one(noise):
    noise.check(replace(run(0, {tone}), joint_names=({names})))
"""


@pytest.mark.slow
def test_a_finding_in_joints_that_were_never_accepted_has_a_picture(project, tmp_path):
    known = STRANGE.format(tone=0.0, names="'elbow', 'wrist'")
    assert project(known, "--noise-accept", "first release")[0] == 0
    status, out = project(STRANGE.format(tone=1.0, names="'left', 'right'"))
    assert (status, "IndexError" in out) == (1, False), out
    assert "oscillations from 1." in out
    assert (tmp_path / "noise-artefacts" / "test_robot-test_one.png").exists()


NODES = st.builds(
    "{}{}.py{}::{}{}".format,
    st.sampled_from(["", "a/", "a/b/", "a.b/", "../"]),
    st.sampled_from(["a", "b", "a-b"]),
    st.sampled_from(["", "::A", "::A::B", "::b"]),
    st.sampled_from(["a", "b", "A"]),
    st.one_of(st.just(""), st.builds("[{}]".format, st.text("abA2-_ /.:[]~", max_size=4))),
)


@given(NODES, NODES, st.sampled_from(["", "-2", "-3"]), st.sampled_from(["", "-2", "-3"]))
@example("t.py::good[logs/a.npz]", "t.py::other[logs/a.npz]", "", "")
@example("t.py::good[a b]", "t.py::good[a-b]", "", "")
@example("t.py::good[a]", "t.py::good[a-2]", "-2", "")
@example("t.py::good[pick/a.npz]", "t.py::good[press/a.npz]", "", "")
@example(f"t.py::{'a' * 200}b", f"t.py::{'a' * 200}c", "", "")
def test_no_two_tests_have_files_of_one_name(one, other, which, second):
    names = [name_of(one) + which, name_of(other) + second]
    assert (names[0] == names[1]) is ((one, which) == (other, second))
    assert all(re.fullmatch(r"\w[\w.~-]*", name) and len(name) < 200 for name in names)


def test_files_of_plain_tests_are_named_by_their_node_ids():
    assert name_of("test_arm.py::TestArm::test_one") == "test_arm-TestArm-test_one"
    assert name_of("tests/test_arm.py::test_one[fast-left]") == "tests.test_arm-test_one-fast-left"


def test_a_run_that_cannot_be_classified_is_not_quiet(project):
    tests = """
def slow():
    time = np.arange(400) / 50
    return Run(time=time, velocity=np.cos(time)[:, None], joint_names=("elbow",))

def test_slow(noise):
    noise.check(slow())

def test_allowed(noise):
    noise.check(slow(), allow=["cannot-tell"])
"""
    status, out = project(tests)
    assert status == 1
    assert "1 failed, 1 passed" in out
    assert "cannot tell whether the run is quiet: " in out


def test_a_class_that_is_allowed_has_to_be_one(project):
    tests = """
@pytest.mark.parametrize("allow", ["impakt", ["impakt"], [("impakt", 0.0, 1.0)]])
def test_unknown(noise, allow):
    noise.check(run(0), allow=allow)

@pytest.mark.parametrize("allow", [("impact", 0.0, 1.0), [("impact", 1.0)], [3]])
def test_no_list(noise, allow):
    noise.check(run(0), allow=allow)

def test_one(noise):
    noise.check(run(0, tone=0.5), allow="oscillations")
"""
    status, out = project(tests)
    assert status == 1
    assert "6 failed, 1 passed" in out
    lines = out.splitlines()
    known = "impact, highaccelerations, oscillations, unknown, louder, cannot-tell"
    told = f", expected a class, or (class, from, to) in [s]; classes are {known}"
    for wrong in ("'impakt'", "'impakt'", "('impakt', 0.0, 1.0)", "0.0", "('impact', 1.0)", "3"):
        assert f"allow: {wrong}{told}" in lines
    assert "noisecheck.py" not in out


def test_a_log_or_a_reference_that_cannot_be_read_fails_in_one_line(project, tmp_path):
    (tmp_path / "broken.npz").write_text("no archive")
    tests = """
@pytest.mark.parametrize("name", ["missing.npz", "missing.csv", "broken.npz"])
def test_quiet(noise, name):
    noise.check(f"{FOLDER}/{name}")

def test_reference(noise):
    from pathlib import Path
    store = Path(FOLDER) / "reference" / "reference.toml"
    store.parent.mkdir()
    store.write_text("format = 3\\n")
    noise.check(run(0))
"""
    status, out = project(f"FOLDER = {str(tmp_path)!r}\n{tests}")
    assert status == 1
    assert "4 failed" in out
    lines = out.splitlines()
    for name, problem in (
        ("missing.npz", "cannot be read"),
        ("broken.npz", "not a run file"),
        ("reference/reference.toml", "of format 3, this version reads 'noise-reference/1'"),
    ):
        assert sum(line.startswith(f"{tmp_path}/{name}: {problem}") for line in lines) == 1
    assert "Traceback" not in out
    assert ".py:" not in out.partition("short test summary")[0].replace("test_robot.py::", "")


def test_the_plugin_is_registered():
    import tomllib

    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["entry-points"]["pytest11"] == {"noise": "inspector.pytest_plugin"}
