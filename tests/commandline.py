"""The command line, called from tests in this process."""

import contextlib
import io
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
