"""Two checkouts compared: differences are noticed, renamed names are found, commands are timed."""

import importlib
import io
import json
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import numpy as np
import pytest
from generalmodel import fixed, trained

from noisemodel import Run

ROOT = Path(__file__).parents[1]
PACKAGES = ("noisemodel", "models", "inspector")
# What is compared of the version before.
OLD = ("noisemodel", "models", "scenarios", "inspector", "assets/models/general.npz")
FIRST = "293fa6a"  # its commit: the last of 0.6.0
# Prints the public names of a checkout: what packages export, and what their classes have.
PUBLIC = """
import importlib, inspect, json

found = []
for package in ("noisemodel", "models", "scenarios", "inspector"):
    module = importlib.import_module(package)
    for name in module.__all__:
        thing = getattr(module, name)
        found.append(f"{package}.{name}")
        if inspect.isclass(thing):
            own = {*vars(thing), *getattr(thing, "__dataclass_fields__", ())}
            found += [f"{package}.{name}.{one}" for one in own if not one.startswith("_")]
print(json.dumps(found))
"""
RESOLVE = """
import json, sys
from checkoutsprobe import resolve
for name in json.load(sys.stdin):
    resolve(name)
"""


@pytest.fixture(scope="module")
def benchmarks():
    """The folder of benchmarks as a package."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT)
        yield importlib.import_module("benchmarks")


@pytest.fixture(scope="module")
def checkouts(benchmarks):
    return importlib.import_module("benchmarks.checkouts")


@pytest.fixture(scope="module")
def probe(benchmarks):
    return importlib.import_module("benchmarks.checkoutsprobe")


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """The checkout of 0.6.0, from the history."""
    archived = subprocess.run(
        ["git", "archive", FIRST, *OLD], cwd=ROOT, capture_output=True, check=False
    )
    if archived.returncode:
        pytest.skip(f"needs commit {FIRST}, version 0.6.0, in the history")
    folder = tmp_path_factory.mktemp("first")
    with tarfile.open(fileobj=io.BytesIO(archived.stdout)) as archive:
        archive.extractall(folder, filter="data")
    return folder


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """A run file of 1 s at 1 kHz, of two joints that rattle."""
    random, time = np.random.default_rng(0), np.arange(1000) / 1000
    velocity = np.cos(6.0 * time)[:, None] + 0.1 * random.normal(size=(1000, 2))
    run = Run(time=time, velocity=velocity, joint_names=("hip", "knee"))
    path = tmp_path_factory.mktemp("runs") / "short.npz"
    run.save(path)
    return path


def compared(before, run, output):
    """Exit status and lines of the script, that compares this checkout with an older one."""
    command = [sys.executable, ROOT / "benchmarks" / "checkouts.py", "--before", before]
    pythons = ["--python-before", sys.executable, "--python-after", sys.executable]
    done = subprocess.run(
        [*command, *pythons, "--runs", run, "--output", output],
        capture_output=True,
        text=True,
        check=False,
    )
    assert not done.stderr
    return done.returncode, done.stdout.splitlines()


def called(script, folder, *, given=None):
    """What a script prints that imports a checkout, and the probe."""
    path = {"PYTHONPATH": f"{folder}:{ROOT / 'benchmarks'}", "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(
        [sys.executable, "-P", "-c", script],
        cwd=folder,
        env=path,
        input=json.dumps(given),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_a_noise_that_differs_in_its_last_bit_is_noticed(short, tmp_path):
    altered = tmp_path / "altered"
    for package in PACKAGES:
        shutil.copytree(
            ROOT / package, altered / package, ignore=shutil.ignore_patterns("__pycache__")
        )
    (altered / "docs").mkdir()
    shutil.copy(ROOT / "docs" / "renamed.csv", altered / "docs")
    fixed().save(altered / "models" / "one-rate.npz")
    trained().save(altered / "models" / "any-rate.npz")
    with (altered / "noisemodel" / "__init__.py").open("a") as file:
        file.write(
            "\nimport numpy as np\nexact = simplified\n"
            "def simplified(*signals):\n    return np.nextafter(exact(*signals), np.inf)\n"
        )
    status, lines = compared(altered, short, tmp_path / "output")
    assert status == 1
    (changed,) = [line for line in lines if line.startswith("different")]
    assert changed.startswith("different  short, simplified noise: noise: 1000 of 1000 values")
    for name in ("one-rate", "any-rate"):
        assert [line for line in lines if line.startswith(f"same       short, {name}: signals")]
    assert lines[-1].endswith(" the same, 1 different")


@pytest.mark.slow
def test_noise_and_scores_are_those_of_the_version_before(first, short, tmp_path):
    _, lines = compared(first, short, tmp_path)
    assert not [line for line in lines if line.startswith("different")], lines
    assert [line for line in lines if line.startswith("same       short, simplified noise: vel")]


@pytest.mark.parametrize(
    ("after", "text"),
    [
        ([1.0, np.nan, 0.0], ""),
        ([1.0 + 2**-52, np.nan, 0.0], "1 of 3 values differ, by at most 2.22e-16"),
        ([1.0, np.nan, -0.0], "1 of 3 values differ, by at most 0"),
        ([1.0, 2.0, 0.0], "1 of 3 values differ, by at most 0"),
        ([1.0, np.nan], r"float64 (3,) before, float64 (2,) after"),
        (np.float32([1.0, np.nan, 0.0]), "float64 (3,) before, float32 (3,) after"),
    ],
)
def test_arrays_are_the_same_only_if_all_their_bytes_are(checkouts, after, text):
    assert checkouts.difference(np.array([1.0, np.nan, 0.0]), np.asarray(after)) == text


def test_a_result_or_an_array_that_one_checkout_lacks_is_a_difference(checkouts, tmp_path):
    before, after = tmp_path / "before", tmp_path / "after"
    for side, scores in ((before, {"scores": [1.0]}), (after, {"scores": [1.0], "more": [2.0]})):
        (side / "demo").mkdir(parents=True)
        np.savez(side / "demo" / "model.npz", **scores)
        np.savez(side / "demo" / "equal.npz", scores=[1.0])
    np.savez(before / "demo" / "noise.npz", noise=[1.0])
    equal, model, noise = checkouts.compare(before, after)
    assert str(equal) == "same       demo, equal: scores (1,)"
    assert str(model) == "different  demo, model: array more is in one of them only"
    assert str(noise) == "different  demo, noise: not computed by the checkout after"
    assert checkouts.closing([equal, model]) == ("2 compared: 1 the same, 1 different", 1)
    assert checkouts.closing([equal]) == ("1 compared: 1 the same, 0 different", 0)
    assert checkouts.closing([]) == ("nothing was compared", 1)


def test_code_of_another_checkout_than_the_one_that_was_named_is_refused(tmp_path):
    job = tmp_path / "job.json"
    job.write_text(json.dumps({"checkout": str(tmp_path), "renamed": {}}))
    done = subprocess.run(
        [sys.executable, "-P", ROOT / "benchmarks" / "checkoutsprobe.py", job],
        capture_output=True,
        text=True,
        env={"PYTHONPATH": f"{ROOT}:{ROOT / 'models'}", "PYTHONDONTWRITEBYTECODE": "1"},
        check=False,
    )
    assert done.returncode == 1
    assert f"not from {tmp_path}" in done.stderr


def test_old_names_are_found_by_the_longest_part_that_is_listed(probe):
    renamed = {"models.new": "models.old", "models.new.Thing.decide": "models.old.Thing.judge"}
    assert probe.older("models.new.Thing.decide", renamed) == "models.old.Thing.judge"
    assert probe.older("models.new.Thing.rate", renamed) == "models.old.Thing.rate"
    assert probe.older("models.newer", renamed) == "models.newer"


def test_a_name_that_does_not_exist_is_not_found(probe):
    for name in ("nothing", "Classifier.nothing", "labels.nothing"):
        with pytest.raises(AttributeError, match="nothing"):
            probe.resolve(f"noiseclassifier.{name}")


def test_each_new_name_exists_and_each_old_name_is_listed_once(checkouts, probe):
    rows = checkouts.names()
    for old, new in rows:
        assert old != new
        if new:
            probe.resolve(new)
    assert len({old for old, _ in rows}) == len(rows)


@pytest.mark.slow
def test_each_old_name_existed_in_the_first_version(checkouts, first):
    called(RESOLVE, first, given=[old for old, _ in checkouts.names()])


def test_each_public_name_of_the_first_version_exists_or_is_listed(checkouts, probe, first):
    listed = {old for old, _ in checkouts.names()}
    lost = []
    for name in json.loads(called(PUBLIC, first)):
        if not any(name == old or name.startswith(f"{old}.") for old in listed):
            try:
                probe.resolve(name)
            except AttributeError:
                lost.append(name)
    assert lost == []
