"""The command line, called from tests in this process, and programs in others."""

import contextlib
import io
import subprocess
import sys
from unittest import mock

from inspector.cli import main

# Commands that take a run or a log, with the options that they need.
WRITING = {"view": ("out.rrd", "out.html"), "listen": ("out.wav",), "export": ("out.csv",)}
TAKING_RUNS = [["classify"], ["audit"], ["noise"]]
TAKING_RUNS += [[name, "-o", file] for name, files in WRITING.items() for file in files]


def call(*arguments):
    """Call the command line; returns exit status, what it printed, and what it complained."""
    out, err = io.StringIO(), io.StringIO()
    with (
        mock.patch.object(sys, "argv", ["inspector", *map(str, arguments)]),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            main()
            status = 0
        except SystemExit as end:
            status = end.code or 0
    return status, out.getvalue(), err.getvalue()


def printed(*arguments, status=0):
    """What the command line prints where it complains of nothing and ends so."""
    found, out, err = call(*arguments)
    assert (found, err) == (status, ""), out
    return out


def complaint(*arguments, status=3):
    """What the command line complains of; it ends so."""
    found, out, err = call(*arguments)
    assert found == status, out + err
    return err


def refused(*arguments, status=3):
    """The one line with which the command line refuses."""
    found, out, err = call(*arguments)
    assert (found, out, err.count("\n")) == (status, "", 1), err
    return err


def ran(*command, status=None, **options):
    """Run a program in a process of its own; its status, output and complaints, as text."""
    words = list(map(str, command))
    done = subprocess.run(words, capture_output=True, text=True, check=False, **options)
    assert status in (None, done.returncode), done.stdout + done.stderr
    return done


def python(*arguments, **options):
    """Run Python in a process of its own, as `ran` does."""
    return ran(sys.executable, *arguments, **options)
