"""What the command line takes, and what it refuses before any work is done."""

import shlex
import sys
from importlib import metadata
from typing import get_args

import pytest
import typer
from commandline import call, printed, refused
from typer.testing import CliRunner

import inspector
import noisemodel
from inspector import cli
from inspector.cli import app
from inspector.commands.shared import Kinds, say_assumed


def test_the_version_is_that_of_the_distribution_and_0_without_one(monkeypatch):
    for known, shown in (({"noise-inspector": "1.2.3"}, "1.2.3"), ({}, "0")):

        def version(name, known=known):
            if name not in known:
                raise metadata.PackageNotFoundError(name)
            return known[name]

        monkeypatch.setattr(metadata, "version", version)
        result = CliRunner().invoke(app, ["--version"])
        assert (result.exit_code, result.output) == (0, f"inspector {shown}\n")


def test_names_are_the_public_ones_that_can_be_imported_and_kinds_those_of_the_model():
    assert dir(inspector) == sorted(inspector.__all__)
    assert all(hasattr(inspector, name) for name in inspector.__all__)
    assert set(get_args(Kinds)) == set(noisemodel.KINDS)


@pytest.mark.parametrize("command", [["classify", "run.npz", "--format"], ["view", "--kind"]])
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


@pytest.fixture
def help_of(monkeypatch):
    """The lines of a help text, as a terminal of 80 columns shows them."""
    monkeypatch.setenv("COLUMNS", "80")

    def lines(*path):
        out = printed(*path, "--help")
        return [line.strip() for line in out.splitlines()]

    return lines


@pytest.mark.parametrize("option", ["-h", "--help"])
def test_the_help_has_a_line_for_each_command_and_imports_none(option):
    _, alone, _ = call()
    assert len(alone.splitlines()) == 10
    assert "inspector classify log.csv" in alone
    before = set(sys.modules)
    out = printed(option)
    assert not {name for name in set(sys.modules) - before if name.startswith("inspector")}
    for own in cli.PANELS.values():
        for name, summary in own.items():
            assert f"  {name:11} {summary}\n" in out
    assert max(map(len, out.splitlines())) <= 80


def test_there_are_at_most_twenty_commands_and_two_hundred_options_shown():
    assert len(cli.MODULES) <= 20
    options = [each for command in COMMANDS.values() for each in command.params]
    shown = [each for each in options if each.param_type_name == "option" and not each.hidden]
    assert len(shown) <= 200


@pytest.mark.parametrize("name", cli.RENAMED)
def test_an_old_name_answers_with_the_new_one(name):
    err = refused(name, "run.npz", "--any", "thing", status=2)
    assert err.startswith(f"inspector: `inspector {name}` is now `inspector ")


def test_options_on_reading_logs_are_in_one_topic_and_in_the_help_of_import():
    _, topic, _ = call("help", "logs")
    _, full, _ = call("help", "import")
    _, other, _ = call("help", "classify")
    for option in ("--robot", "--map", "--desired", "--max-unpacked"):
        assert f"  {option} " in topic
        assert option in full
    assert "--mapping" not in other
    assert "`inspector help logs`" in other
    assert call("help", "nothing")[0] == 2


@pytest.mark.parametrize("path", COMMANDS, ids=" ".join)
def test_the_help_of_a_command_ends_with_an_example_that_is_accepted(help_of, path, monkeypatch):
    *_, last = filter(None, help_of(*path))
    assert last == COMMANDS[path].epilog
    assert last.startswith(f"Example: inspector {' '.join(path)}")
    inspector, called = typer.main.get_command(app), []
    for words, command in commands(inspector):
        if not hasattr(command, "commands"):
            own = lambda words=words, **_: called.append(words)  # noqa: E731
            monkeypatch.setattr(command, "callback", own)
    program, *arguments = shlex.split(COMMANDS[path].epilog.removeprefix("Example: "))
    arguments = arguments[: arguments.index("<")] if "<" in arguments else arguments
    inspector.main(args=arguments, standalone_mode=False)
    assert program == "inspector"
    assert called == [("simulate", "run") if path == ("simulate",) else path]


def test_at_most_100_characters_tell_what_was_assumed_and_v_tells_all(capsys):
    short, long = ("radians; robot not named", "; ".join(f"column {n} is joint" for n in range(20)))
    whole = "a sentence without an end " * 10
    say_assumed({"a": short, "b": long, "c": whole}, verbose=False)
    lines = [line.split(": ", 1)[1] for line in capsys.readouterr().err.splitlines()]
    assert lines[0] == short
    assert all(len(line) <= 100 and line.endswith("... (-v)") for line in lines[1:])
    assert lines[2].startswith("a sentence")
    say_assumed({"b": long})
    assert long in capsys.readouterr().err
