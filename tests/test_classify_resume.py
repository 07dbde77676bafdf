"""A batch that is killed and resumes."""

import fcntl
import hashlib
import json
import os
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
import workers
from commandline import call, complaint, printed
from wholeverdict import WHOLE

from inspector import verdict
from inspector.errors import InspectorError, Status
from inspector.library import demo_run, load_library, model_files
from inspector.logs.mapping import ReadOptions
from inspector.logs.read import Reading, Source, open_source
from inspector.verdict import StateError, Verdict, classify_files, digest, kept
from noisemodel import OutputError

ROOT = Path(__file__).parents[1]
COUNT = 12
LIBRARY = load_library(model_files())


@pytest.fixture
def runs(tmp_path):
    folder = tmp_path / "runs"
    folder.mkdir()
    for number in range(COUNT):
        shutil.copy(demo_run(), folder / f"{number:02d}.npz")
    return folder


def rows(state):
    return [json.loads(line) for line in state.read_bytes().split(b"\n")[1:-1]]


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
def test_a_killed_batch_resumes_without_loss_or_repetition(runs, tmp_path, jobs):
    state = tmp_path / "state.jsonl"
    command = [sys.executable, "-m", "inspector", "classify", runs, "--resume", state]
    command += ["-j", str(jobs)]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL)
    while process.poll() is None:  # the batch may end before this process sees it
        if state.exists() and state.read_bytes().count(b"\n") > 3:
            break
        time.sleep(0.005)
    process.kill()
    process.wait()
    before = rows(state)
    assert 0 < len(before) <= COUNT
    with state.open("ab") as file:
        file.write(b'{"run": "half a li')
    out = printed("classify", runs, "--resume", state, "-j", jobs, status=1)
    after = rows(state)
    assert after[: len(before)] == before
    assert sorted(row["run"] for row in after) == sorted(map(str, runs.glob("*.npz")))
    assert call("classify", runs)[1] == out


def test_a_run_whose_picture_is_gone_is_done_again(tmp_path):
    pictures = []

    def draw(*_):
        pictures.append(tmp_path / f"{len(pictures)}.png")
        pictures[-1].touch()
        return pictures[-1]

    def resumed():
        run, state = Source(demo_run()), tmp_path / "state.jsonl"
        (verdict,) = classify_files([run], LIBRARY, resume=state, draw=draw)
        return verdict.picture

    first = resumed()
    assert resumed() == first
    assert len(pictures) == 1
    first.unlink()
    assert resumed() == pictures[1] != first
    assert resumed() == pictures[1]
    assert len(pictures) == 2


@pytest.mark.slow
def test_only_what_changed_is_done_again(runs, tmp_path):
    state = runs / "state.jsonl"  # beside the logs
    first = call("classify", runs, "--format", "json", "--resume", state)[1]
    again = call("classify", runs, "--format", "json", "--resume", state)[1]
    assert again == first
    assert len(rows(state)) == COUNT
    (runs / "03.npz").write_text("broken")
    assert "03.npz" in complaint("classify", runs, "--format", "json", "--resume", state)
    assert len(rows(state)) == COUNT + 1
    assert rows(state)[-1]["status"] == "bad-input"


def test_a_state_of_another_batch_or_no_state_is_refused_and_kept(tmp_path):
    state, other = tmp_path / "state.jsonl", tmp_path / "other.npz"
    shutil.copy(model_files()[0], other)
    call("classify", demo_run(), "--resume", state)
    whole = state.read_text()
    head, _, rest = whole.partition("\n")

    def refused(content, problem, *options):
        state.write_text(content)
        status, _, err = call("classify", demo_run(), "--resume", state, *options)
        said = f"inspector: {state}: {problem}; name another file, or delete it\n"
        assert (status, err, state.read_text()) == (3, said, content)

    for name, options in {
        "--unknown": ("--unknown", "ignore"),
        "reading of logs": ("--format", "json", "--robot", "panda"),
        "models": ("--model", other),
    }.items():
        refused(whole, f"is of another batch (its {name} differs)", *options)
    for name, value in {"format": "noise-classify-state/0", "version": "0.4.9"}.items():
        changed = f"{json.dumps(json.loads(head) | {name: value})}\n{rest}"
        refused(changed, f"is of another batch (its {name} differs)")
    for content in ("some notes\n", '{"format": "notes/1"}\n', '["noise-state/1"]\n', "7\n", "x"):
        refused(content, "holds no state of classify")


def test_a_run_that_kills_its_worker_is_named_and_the_others_are_classified(runs, monkeypatch):
    monkeypatch.setattr(verdict, "open_source", die_of_seven)
    workers.simulate(monkeypatch)
    status, out, err = call("classify", runs, "-j", 2)
    assert status == 70
    assert out.splitlines()[-1].startswith(f"{COUNT} runs: 1 internal error, {COUNT - 1} with")
    assert f"inspector: {runs}/07.npz: the worker died" in err


def die_of_seven(source, reading=None):
    if source.path.name == "07.npz":
        workers.die()
    return open_source(source, reading)


@pytest.mark.parametrize("change", [{"lost": [1]}, {"events": {"label": 1}}])
def test_a_state_of_other_types_is_damaged(tmp_path, change):
    path = tmp_path / "state"
    with kept(path, {}) as (_, add):
        add(Verdict(Path("a.npz"), Status.OK), "0" * 64)
    header, row = path.read_text().splitlines()
    with kept(path, {}) as (verdicts, _):
        assert len(verdicts) == 1
    path.write_text(f"{header}\n{json.dumps(json.loads(row) | change)}\n")
    with pytest.raises(StateError, match="is damaged in line 2"), kept(path, {}):
        pass


def test_a_verdict_is_read_back_as_it_was_written(tmp_path):
    path, settings = tmp_path / "state", {"models": {"a": "0"}, "version": "1"}
    plain = Verdict(Path("b.npz"), Status.OK)
    with kept(path, settings) as (_, add):
        add(replace(WHOLE, lost=("a sentence",)), "0" * 64)
        add(plain, "1" * 64)
        add(Verdict(Path("c.npz"), Status.INTERNAL_ERROR), "2" * 64)  # tried again
    with kept(path, settings) as (verdicts, _):
        pass
    assert verdicts == {
        (WHOLE.path, "0" * 64): replace(WHOLE, lost=("a sentence",)),
        (Path("b.npz"), "1" * 64): plain,
    }


@pytest.mark.parametrize("torn", [b'{"run": "half a li', b"{}", b"\xff"])
def test_a_line_that_was_being_written_is_dropped(tmp_path, torn):
    path = tmp_path / "state"
    with kept(path, {"a": 1}) as (_, add):
        add(Verdict(Path("a.npz"), Status.OK), "0" * 64)
    whole = path.read_bytes()
    path.write_bytes(whole + torn)
    with kept(path, {"a": 1}) as (verdicts, add):
        assert list(verdicts) == [(Path("a.npz"), "0" * 64)]
        assert path.read_bytes() == whole
        add(Verdict(Path("b.npz"), Status.OK), "1" * 64)
    assert path.read_bytes().startswith(whole)
    assert len(rows(path)) == 2


def test_a_header_that_was_being_written_is_written_again(tmp_path):
    path = tmp_path / "state"
    with kept(path, {"a": 1}):
        whole = path.read_bytes()
    for length in (0, 7, len(whole) - 1):
        path.write_bytes(whole[:length])
        with kept(path, {"a": 1}):
            assert path.read_bytes() == whole
    path.write_bytes(whole[:7] + b"x")
    with pytest.raises(StateError, match="holds no state"), kept(path, {"a": 1}):
        pass


def test_a_state_that_cannot_be_written_or_is_no_file_is_refused(tmp_path, monkeypatch):
    def refused(path, error, problem):
        with pytest.raises(error, match=problem), kept(tmp_path / path, {}):
            pass

    refused(".", StateError, "is no regular file")
    (tmp_path / "file").touch()
    refused("file/state", OutputError, r"file/state: cannot be written \(Not a directory\)$")
    with (tmp_path / "held").open("ab") as holder:
        fcntl.flock(holder, fcntl.LOCK_EX)
        refused("held", InspectorError, "is being written by another process; wait")
    with (tmp_path / "large").open("wb") as file:
        file.truncate(2**28 + 1)
    refused("large", StateError, "large: is larger than 268435456 bytes;")

    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    refused("new", OutputError, r"new: cannot be written \(No space left on device\)$")


@pytest.mark.parametrize("beside", ["robot", "desired"])
def test_a_file_that_logs_are_read_with_is_one_of_the_settings(tmp_path, beside):
    path, other = tmp_path / "state", tmp_path / "other"
    desired = other if beside == "desired" else None
    options = ReadOptions(robot=str(other)) if beside == "robot" else ReadOptions()
    for content, changed in ((b"one", False), (b"one", False), (b"other", True)):
        other.write_bytes(content)
        reading = Reading(options, desired)
        done = classify_files([], LIBRARY, resume=path, reading=reading)
        if changed:
            with pytest.raises(StateError, match="its reading of logs differs"):
                list(done)
        else:
            assert list(done) == []


def test_a_digest_is_of_a_file_or_of_all_names_and_files_in_a_folder(tmp_path):
    (tmp_path / "log" / "deep").mkdir(parents=True)
    one, other = tmp_path / "log" / "b", tmp_path / "log" / "deep" / "a"
    one.write_bytes(b"one")
    other.write_bytes(b"other")

    def sha256(content):
        return hashlib.sha256(content).hexdigest()

    assert digest(one) == sha256(b"one")
    lines = f"b {sha256(b'one')}\ndeep/a {sha256(b'other')}"
    assert digest(tmp_path / "log") == sha256(lines.encode())
    other.rename(other.with_name("c"))
    assert digest(tmp_path / "log") != sha256(lines.encode())
