import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
OURS = {"noisemodel", "models", "scenarios", "inspector"}
ALLOWED = {
    "noisemodel": {"noisemodel"},
    "models": {"models"},
    "scenarios": {"scenarios", "noisemodel"},
    "inspector": OURS,
}
"""Which of our packages each may import."""

HOMES = {"rerun": {"inspector"}, "typer": {"inspector"}, "mujoco": {"noisemodel", "scenarios"}}
"""The only packages of ours that may import a library."""

SLOW = ["typer", "rerun", "sklearn", "mujoco", "pinocchio", "scipy.signal"]


def modules():
    """All our modules that there are, with the package that each belongs to."""
    return [(path, path.parts[len(ROOT.parts)]) for name in OURS for path in _sources(name)]


def _sources(package):
    return sorted((ROOT / package).rglob("*.py"))


def imports(path):
    """Names of what a module imports, anywhere in it."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports by relative name"
            yield node.module


def test_packages_import_only_what_lies_below_them():
    for path, package in modules():
        for name in imports(path):
            top = name.split(".")[0]
            assert top not in OURS - ALLOWED[package], f"{path} imports {name}"


def test_libraries_stay_in_their_package():
    for path, package in modules():
        for name in imports(path):
            homes = HOMES.get(name.split(".")[0])
            assert homes is None or package in homes, f"{path} imports {name}"


def test_nothing_is_pickled():
    for path, _ in modules():
        assert not {"pickle", "dill", "cloudpickle"} & set(imports(path)), path
        assert "allow_pickle=True" not in path.read_text(), path


@pytest.mark.parametrize(
    ("package", "never"),
    [
        ("noisemodel", [*SLOW, "models", "scenarios", "inspector"]),
        ("models", [*SLOW, "noisemodel", "scenarios", "inspector"]),
        ("scenarios", ["rerun", "typer", "sklearn", "mujoco", "models", "inspector"]),
        ("inspector.cli", ["rerun", "sklearn", "mujoco", "pinocchio", "scipy", "numpy"]),
        ("inspector.analysis.verdict", [*SLOW[1:], "scipy", "numpy.random", "pyarrow"]),
        ("inspector.regression.measure", [*SLOW[1:], "scipy", "numpy.random", "pyarrow"]),
    ],
)
def test_importing_a_package_imports_no_more_than_it_should(package, never):
    script = f"import sys, {package}; print([name for name in {never} if name in sys.modules])"
    loaded = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert loaded.stdout.strip() == "[]"


def name_of(path):
    """A module's dotted name; a package's is that of its folder."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {name_of(path): path for path, _ in modules()}


def modules_imported(path):
    """Names of our modules that a module imports, anywhere in it; packages only for their own."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in MODULES)
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                name = f"{node.module}.{alias.name}"
                name = name if name in MODULES else node.module
                if name in MODULES:
                    yield name


def folder_of(name):
    """The folder that a module is in, or the module itself if it is directly in its package."""
    parts = name.split(".")
    inside = MODULES[name].name == "__init__.py" or len(parts) > 2
    return ".".join(parts[:2]) if inside else name


def circle(arrows):
    """One circle in a graph of names and those that each points to, or an empty list."""
    done, path = set(), []

    def visit(name):
        if name in path:
            return [*path[path.index(name) :], name]
        if name in done:
            return []
        path.append(name)
        for other in sorted(arrows.get(name, ())):
            if found := visit(other):
                return found
        path.pop()
        done.add(name)
        return []

    return next((found for name in sorted(arrows) if (found := visit(name))), [])


def test_a_circle_is_recognised():
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == ["b", "c", "b"]
    assert circle({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == []


def test_modules_do_not_import_each_other_in_a_circle():
    arrows = {
        name: {other for other in modules_imported(path) if not name.startswith(f"{other}.")}
        for name, path in MODULES.items()
    }
    assert circle(arrows) == []


@pytest.mark.parametrize("package", sorted(OURS))
def test_folders_of_a_package_import_downwards(package):
    arrows = {}
    for name, path in MODULES.items():
        if name.split(".")[0] == package and name != package:
            folders = {folder_of(other) for other in modules_imported(path) if other != package}
            own = {folder for folder in folders if folder.startswith(f"{package}.")}
            arrows.setdefault(folder_of(name), set()).update(own - {folder_of(name)})
    assert circle(arrows) == []
