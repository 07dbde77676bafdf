"""What the command line takes, and what it refuses before any work is done."""

from importlib import metadata

import pytest
from typer.testing import CliRunner

import noisemodel
from inspector.cli import app
from inspector.commands.options import KINDS


def test_the_version_is_that_of_the_distribution(monkeypatch):
    monkeypatch.setattr(metadata, "version", {"noise-inspector": "1.2.3"}.__getitem__)
    result = CliRunner().invoke(app, ["--version"])
    assert (result.exit_code, result.output) == (0, "inspector 1.2.3\n")


def test_a_source_tree_that_is_not_installed_says_so(monkeypatch):
    def version(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "version", version)
    result = CliRunner().invoke(app, ["--version"])
    assert (result.exit_code, result.output) == (0, "inspector, not installed\n")


def test_the_kinds_are_those_of_the_noise_model():
    assert set(KINDS) == set(noisemodel.KINDS)


@pytest.mark.parametrize("command", [["view"], ["shot", "run.npz", "-o", "shot.png"]])
def test_a_kind_that_does_not_exist_is_a_usage_error(command):
    result = CliRunner().invoke(app, [*command, "--kind", "D"], env={"COLUMNS": "200"})
    assert result.exit_code == 2
    assert "'D' is none of normal, rms, mean, paper, A, B, C" in result.output
