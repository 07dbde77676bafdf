import ast
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
from commandline import python

ROOT = Path(__file__).parents[1]
# Our packages, scenarios apart from the classifier that they are in.
PLACES = {
    "noisemodel": ROOT / "noisemodel",
    "noiseclassifier": ROOT / "models" / "noiseclassifier",
    "noiseclassifier.scenarios": ROOT / "models" / "noiseclassifier" / "scenarios",
    "inspector": ROOT / "inspector",
}
OURS = set(PLACES)
# Which of our packages each may import.
ALLOWED = {
    "noisemodel": {"noisemodel"},
    "noiseclassifier": {"noiseclassifier"},
    "noiseclassifier.scenarios": {"noiseclassifier.scenarios", "noisemodel"},
    "inspector": OURS,
}
# The only packages of ours that may import a library.
HOMES = {
    "rerun": {"inspector"},
    "typer": {"inspector"},
    "mujoco": {"noisemodel", "noiseclassifier.scenarios"},
}
SLOW = ["typer", "rerun", "sklearn", "mujoco", "pinocchio", "scipy.signal"]


def modules():
    """All our modules that there are, with the package that each belongs to."""
    return [(path, name) for name in OURS for path in _sources(name)]


def _sources(package):
    inner = [place for place in PLACES.values() if PLACES[package] in place.parents]
    every = sorted(PLACES[package].rglob("*.py"))
    return [path for path in every if not any(place in path.parents for place in inner)]


def _package(name):
    """The package of ours that a module is in, or the name itself."""
    found = [one for one in OURS if f"{name}.".startswith(f"{one}.")]
    return max(found, key=len, default=name)


@cache
def statements(path):
    """The imports of a module, anywhere in it."""
    nodes = ast.walk(ast.parse(path.read_text()))
    return [node for node in nodes if isinstance(node, (ast.Import, ast.ImportFrom))]


def imports(path):
    """Names of what a module imports."""
    for node in statements(path):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        else:
            assert node.level == 0, f"{path}: imports by relative name"
            yield node.module


def test_packages_import_only_what_lies_below_them_and_libraries_stay_in_theirs():
    for path, package in modules():
        for name in imports(path):
            assert _package(name) not in OURS - ALLOWED[package], f"{path} imports {name}"
            homes = HOMES.get(name.split(".")[0])
            assert homes is None or package in homes, f"{path} imports {name}"


def test_nothing_is_pickled():
    for path, _ in modules():
        assert not {"pickle", "dill", "cloudpickle"} & set(imports(path)), path
        assert "allow_pickle=True" not in path.read_text(), path


@pytest.mark.parametrize(
    ("package", "never"),
    [
        ("noisemodel", [*SLOW, "noiseclassifier", "inspector"]),
        ("noiseclassifier", [*SLOW, "noisemodel", "noiseclassifier.scenarios", "inspector"]),
        ("noiseclassifier.scenarios", [*SLOW, "inspector"]),
        ("inspector.cli", ["rerun", "sklearn", "mujoco", "pinocchio", "scipy", "numpy"]),
        ("inspector.verdict", [*SLOW[1:], "scipy", "numpy.random", "pyarrow"]),
        ("inspector.export.sound", ["scipy.signal"]),
        ("inspector.pytest_plugin", ["rerun", "numpy", "scipy", "typer", "noisemodel"]),
        ("inspector.reference.difference", [*SLOW[1:], "scipy", "numpy.random", "pyarrow"]),
    ],
)
def test_importing_a_package_imports_no_more_than_it_should(package, never):
    script = f"import sys, {package}; print([name for name in {never} if name in sys.modules])"
    loaded = python("-c", script, cwd=ROOT)
    assert loaded.stdout.strip() == "[]"


def name_of(path):
    """A module's dotted name; a package's is that of its folder."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    parts = parts[1:] if parts[0] == "models" else parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {name_of(path): path for path, _ in modules()}


def modules_imported(path):
    """Names of our modules that a module imports; packages only for their own."""
    for node in statements(path):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in MODULES)
        else:
            for alias in node.names:
                name = f"{node.module}.{alias.name}"
                name = name if name in MODULES else node.module
                if name in MODULES:
                    yield name


def folder_of(name):
    """The folder that a module is in, or the module itself if it is directly in its package."""
    package = _package(name)
    parts, depth = name.split("."), package.count(".") + 2
    inside = MODULES[name].name == "__init__.py" or len(parts) > depth
    return ".".join(parts[:depth]) if inside else name


def test_modules_do_not_import_each_other_in_a_circle():
    arrows = {
        name: {other for other in modules_imported(path) if not name.startswith(f"{other}.")}
        for name, path in MODULES.items()
    }
    TopologicalSorter(arrows).prepare()  # or it names the circle


@pytest.mark.parametrize("package", sorted(OURS))
def test_folders_of_a_package_import_downwards(package):
    arrows = {}
    for name, path in MODULES.items():
        if _package(name) == package and name != package:
            folders = {folder_of(other) for other in modules_imported(path) if other != package}
            own = {folder for folder in folders if folder.startswith(f"{package}.")}
            arrows.setdefault(folder_of(name), set()).update(own - {folder_of(name)})
    TopologicalSorter(arrows).prepare()  # or it names the circle
