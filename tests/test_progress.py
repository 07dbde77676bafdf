import io
import sys
import time

from inspector import text as module
from inspector.text import progress


def test_a_line_every_ten_seconds_says_how_many_are_left(capsys, monkeypatch):
    clock = iter([0.0, 4.0, 10.0, 13.0, 20.0])
    monkeypatch.setattr(module, "monotonic", lambda: next(clock))
    assert list(progress("abcd", "classify", total=4)) == list("abcd")
    out, err = capsys.readouterr()
    assert (out, err) == ("", "classify: 2 of 4, 10 s left\n")


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_on_a_terminal_there_is_a_bar_and_nothing_is_left_of_it(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys, "stderr", Terminal())
    found = []
    for each in progress("abcd", "classify", total=4):
        found.append(each)
        time.sleep(0.15)  # the bar is drawn ten times a second
    assert found == list("abcd")
    shown = sys.stderr.getvalue()
    assert "classify" in shown
    assert "━" in shown
    assert shown.endswith("\x1b[1A\x1b[2K")  # one line up, and cleared


def test_a_short_task_says_nothing(capsys):
    assert list(progress("abcd", "classify", total=4)) == list("abcd")
    assert capsys.readouterr().err == ""
