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

HOMES = {"rerun": {"inspector"}, "typer": {"inspector"}, "mujoco": {"scenarios"}}
"""The only packages of ours that may import a library."""

SLOW = ["rerun", "typer", "sklearn", "mujoco", "pinocchio", "scipy.signal"]


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
    ],
)
def test_importing_a_package_imports_no_more_than_it_should(package, never):
    script = f"import sys, {package}; print([name for name in {never} if name in sys.modules])"
    loaded = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert loaded.stdout.strip() == "[]"


def test_modules_are_short():
    for path, _ in modules():
        assert len(path.read_text().splitlines()) <= 300, path
