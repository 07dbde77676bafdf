"""Progress where there is no terminal."""

from inspector import progress as module
from inspector.progress import progress


def test_a_line_every_ten_seconds_says_how_many_are_left(capsys, monkeypatch):
    clock = iter([0.0, 4.0, 10.0, 13.0, 20.0])
    monkeypatch.setattr(module, "monotonic", lambda: next(clock))
    assert list(progress("abcd", "classify", total=4)) == list("abcd")
    out, err = capsys.readouterr()
    assert (out, err) == ("", "classify: 2 of 4, 10 s left\n")


def test_a_short_task_says_nothing(capsys):
    assert list(progress("abcd", "classify", total=4)) == list("abcd")
    assert capsys.readouterr().err == ""
