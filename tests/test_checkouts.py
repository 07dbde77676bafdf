import csv
import importlib
import inspect
import io
import json
import subprocess
import tarfile
from pathlib import Path

import pytest
from commandline import python

ROOT = Path(__file__).parents[1]
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
def listed():
    """Each old name with its new one."""
    with (ROOT / "docs" / "renamed.csv").open(newline="") as file:
        rows = [(row["old"], row["new"]) for row in csv.DictReader(file)]
    assert len(dict(rows)) == len(rows)
    return dict(rows)


def called(script, folder):
    """What a script prints that imports a checkout."""
    env = {"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    return python("-P", "-c", script, cwd=folder, env=env, status=0).stdout


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
