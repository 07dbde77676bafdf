"""The command line, called from tests in this process, and programs in others."""

import contextlib
import io
import subprocess
import sys
from unittest import mock

from inspector.cli import main

# Commands that take a run or a log, with the options that they need.
TAKING_RUNS = [
    ["classify"],
    ["audit"],
    ["noise"],
    ["view", "-o", "out.rrd"],
    ["view", "-o", "out.html"],
    ["listen", "-o", "out.wav"],
    ["export", "-o", "out.csv"],
]


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


def ran(*command, **options):
    """Run a program in a process of its own; its status, output and complaints, as text."""
    words = list(map(str, command))
    return subprocess.run(words, capture_output=True, text=True, check=False, **options)


def python(*arguments, **options):
    """Run Python in a process of its own, as `ran` does."""
    return ran(sys.executable, *arguments, **options)
