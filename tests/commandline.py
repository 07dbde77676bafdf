"""The command line, called from tests in this process, and Python in another one."""

import contextlib
import io
import subprocess
import sys
from unittest import mock

from inspector.cli import main


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


def python(*arguments, **options):
    """Run Python in a process of its own; its status, what it printed and complained, as text."""
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, **options)
