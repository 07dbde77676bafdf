"""Two checkouts compared, bit for bit; names of 0.6 that are gone are in `docs/renamed.csv`."""

import csv
import importlib
import inspect
import io
import json
import shutil
import subprocess
import tarfile
from pathlib import Path

import numpy as np
import pytest
from commandline import python
from generalmodel import fixed, trained

from benchmarks import checkouts
from noisemodel import Run

ROOT = Path(__file__).parents[1]
SCRIPT = ROOT / "benchmarks" / "checkouts.py"
PACKAGES = ("noisemodel", "models", "inspector")
FIRST = "293fa6a"  # the last commit of 0.6.0
OLD = ("noisemodel", "models", "scenarios", "inspector", "assets/models/general.npz")
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


def resolve(name):
    """Module, class, function, attribute or dataclass field of a dotted name."""
    first, *rest = name.split(".")
    found, path = importlib.import_module(first), first
    for part in rest:
        path = f"{path}.{part}"
        fields = getattr(found, "__dataclass_fields__", {})
        if part in fields:
            found = fields[part]
        elif hasattr(found, part) or not hasattr(found, "__path__"):
            found = getattr(found, part)
        else:
            found = importlib.import_module(path)


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
    done = python(SCRIPT, "--before", before, "--runs", run, "--output", output)
    assert not done.stderr
    return done.returncode, done.stdout.splitlines()


@pytest.mark.slow
def test_a_noise_that_differs_in_its_last_bit_is_noticed(short, tmp_path):
    altered = tmp_path / "altered"
    for package in PACKAGES:
        shutil.copytree(
            ROOT / package, altered / package, ignore=shutil.ignore_patterns("__pycache__")
        )
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
    assert [line for line in lines if line.startswith("same       short, simplified noise: noise")]


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
def test_arrays_are_the_same_only_if_all_their_bytes_are(after, text):
    assert checkouts.difference(np.array([1.0, np.nan, 0.0]), np.asarray(after)) == text


def test_a_result_or_an_array_that_one_checkout_lacks_is_a_difference(tmp_path):
    before, after = tmp_path / "before", tmp_path / "after"
    for side, scores in ((before, {"scores": [1.0]}), (after, {"scores": [1.0], "more": [2.0]})):
        (side / "demo").mkdir(parents=True)
        np.savez(side / "demo" / "model.npz", **scores)
        np.savez(side / "demo" / "equal.npz", scores=[1.0])
    np.savez(before / "demo" / "noise.npz", noise=[1.0])
    equal, model, noise = checkouts.compare(before, after)
    assert equal == "same       demo, equal: scores (1,)"
    assert model == "different  demo, model: array more is in one of them only"
    assert noise == "different  demo, noise: not computed by the checkout after"
    assert checkouts.closing([equal, model]) == ("2 compared: 1 the same, 1 different", 1)
    assert checkouts.closing([equal]) == ("1 compared: 1 the same, 0 different", 0)
    assert checkouts.closing([]) == ("nothing was compared", 1)


def test_code_of_another_checkout_than_the_one_that_was_named_is_refused(tmp_path):
    job = tmp_path / "job.json"
    job.write_text(json.dumps({"checkout": str(tmp_path)}))
    env = {"PYTHONPATH": f"{ROOT}:{ROOT / 'models'}", "PYTHONDONTWRITEBYTECODE": "1"}
    done = python("-P", SCRIPT, "--compute", job, env=env)
    assert done.returncode == 1
    assert f"not of {tmp_path}" in done.stderr


@pytest.fixture(scope="module")
def listed():
    """Each old name with its new one."""
    with (ROOT / "docs" / "renamed.csv").open(newline="") as file:
        rows = [(row["old"], row["new"]) for row in csv.DictReader(file)]
    assert len(dict(rows)) == len(rows)
    return dict(rows)


def called(script, folder):
    """What a script prints that imports a checkout."""
    env = {"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    done = python("-P", "-c", script, cwd=folder, env=env)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_each_new_name_exists(listed):
    for old, new in listed.items():
        assert old != new
        if new:
            resolve(new)


@pytest.mark.slow
def test_each_old_name_existed_in_the_first_version(listed, first):
    code = f"import importlib\n{inspect.getsource(resolve)}\n"
    called(code + f"for name in {list(listed)!r}:\n    resolve(name)", first)


def test_each_public_name_of_the_first_version_exists_or_is_listed(listed, first):
    lost = []
    for name in json.loads(called(PUBLIC, first)):
        if not any(name == old or name.startswith(f"{old}.") for old in listed):
            try:
                resolve(name)
            except (AttributeError, ModuleNotFoundError):
                lost.append(name)
    assert lost == []
