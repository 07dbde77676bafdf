"""What the command line takes, and what it refuses before any work is done."""

import re
import shlex
from importlib import metadata

import pytest
import typer
from commandline import call
from typer.testing import CliRunner

import noisemodel
from inspector.cli import app
from inspector.commands.compare import GEOMETRIES
from inspector.commands.options import KINDS
from noisemodel import surface


def test_the_version_is_that_of_the_distribution(monkeypatch):
    monkeypatch.setattr(metadata, "version", {"noise-inspector": "1.2.3"}.__getitem__)
    result = CliRunner().invoke(app, ["--version"])
    assert (result.exit_code, result.output) == (0, "inspector 1.2.3\n")


def test_the_version_option_states_that_a_source_tree_is_not_installed(monkeypatch):
    def version(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "version", version)
    result = CliRunner().invoke(app, ["--version"])
    assert (result.exit_code, result.output) == (0, "inspector, not installed\n")


def test_kinds_and_geometries_are_those_of_the_noise_model():
    assert set(KINDS) == set(noisemodel.KINDS)
    assert set(GEOMETRIES) == set(surface.GEOMETRIES)


@pytest.mark.parametrize("command", [["view"], ["shot", "run.npz", "-o", "shot.png"]])
def test_a_kind_that_does_not_exist_is_a_usage_error(command):
    result = CliRunner().invoke(app, [*command, "--kind", "D"], env={"COLUMNS": "200"})
    assert result.exit_code == 2
    assert "'D' is none of normal, rms, mean, paper, A, B, C" in result.output


@pytest.mark.parametrize(
    "command", [["classify", "run.npz", "--format"], ["simulate", "dataset", "--format"]]
)
def test_a_choice_that_does_not_exist_is_answered_with_those_that_do(command):
    result = CliRunner().invoke(app, [*command, "xml"], env={"COLUMNS": "300"})
    assert result.exit_code == 2
    assert f"Invalid value for '{command[-1]}': 'xml' is not one of '" in result.output


def commands(group=None, path=()):
    """All commands and groups by the words that call them, without `inspector` itself."""
    for name, command in (group or typer.main.get_command(app)).commands.items():
        yield (*path, name), command
        if hasattr(command, "commands"):
            yield from commands(command, (*path, name))


COMMANDS = dict(commands())
PATHS = pytest.mark.parametrize("path", COMMANDS, ids=" ".join)


@pytest.fixture
def help_of(monkeypatch):
    """The lines of a help text, as a terminal of 80 columns shows them."""
    monkeypatch.setenv("COLUMNS", "80")

    def lines(*path):
        status, out, err = call(*path, "--help")
        assert (status, err) == (0, "")
        return [line.strip() for line in out.splitlines()]

    return lines


def test_every_command_is_in_a_panel(help_of):
    titles = [line.strip("╭╮─ ") for line in help_of() if line.startswith("╭")]
    assert titles == [
        "Options",
        "Look",
        "Judge",
        "Import and export",
        "Train",
        "Simulate",
    ]


@PATHS
def test_the_help_of_a_command_ends_with_an_example_on_one_line(help_of, path):
    *_, last = filter(None, help_of(*path))
    assert last == COMMANDS[path].epilog
    assert last.startswith(f"Example: inspector {' '.join(path)}")


@PATHS
def test_the_example_of_a_command_is_accepted(path):
    inspector, called = typer.main.get_command(app), []
    for words, command in commands(inspector):
        if not hasattr(command, "commands"):
            command.callback = lambda words=words, **_: called.append(words)
    program, *arguments = shlex.split(COMMANDS[path].epilog.removeprefix("Example: "))
    arguments = arguments[: arguments.index("<")] if "<" in arguments else arguments
    inspector.main(args=arguments, standalone_mode=False)
    assert program == "inspector"
    assert called == [("simulate", "run") if path == ("simulate",) else path]


def test_the_help_of_inspector_shows_each_command_on_one_line(help_of):
    rows = [line.strip("│ ") for line in help_of()]
    width = max(len(path[0]) for path in COMMANDS) + 2
    for path, command in COMMANDS.items():
        if len(path) == 1:
            summary, *_ = command.help.split("\n\n")
            assert f"{path[0]:{width}}{summary}" in rows


def test_no_help_holds_brackets_that_would_be_taken_for_markup():
    for command in COMMANDS.values():
        texts = [command.help, *(getattr(option, "help", "") or "" for option in command.params)]
        assert not [text for text in texts if re.search(r"\[[a-z#/@!]", text)]


def test_the_help_of_classify_lists_the_exit_statuses(help_of):
    lines = help_of("classify")
    meanings = ("ok", "findings", "wrong usage", "bad input", "cannot tell", "output lost")
    listed = lines[lines.index("Exit status:") + 2 :]
    for status, (line, meaning) in enumerate(zip(listed, meanings, strict=False)):
        assert line.startswith(f"{status}  {meaning}")
    assert listed[len(meanings)].startswith("70  internal error")
    assert listed[len(meanings) + 2] == "Of several, the worst: 70, 5, 3, 1, 4, 0."
