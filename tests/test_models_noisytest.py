import hashlib
from contextlib import suppress
from math import inf

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import noiseclassifier as nc
from noiseclassifier.noisytest import read_annotations, read_folder, read_recording

IN_PLACE = settings(
    deadline=None, max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
TOML = """
[data]
chunk_ranges = [[0, 0.5], [1.25, -1]]
chunk_labels = ["ok", "impact"]
"""
CHUNK = "[data]\nchunk_ranges = [[{}]]\nchunk_labels = [{}]"


@pytest.fixture
def log(tmp_path):
    """Writes a `.log` of some text."""

    def write(text, name="walk.log"):
        path = tmp_path / name
        path.write_bytes(text.encode())
        return path

    return write


def rows(samples, rate=10_000):
    return "".join(f"{i / rate:.12f} {0.001 * i:.15e}\n" for i in range(samples))


@pytest.mark.parametrize(
    "text",
    [
        "# time noise\n0.0 1.5\n0.1 2.5\n0.2 3.5\n",
        "0.0 1.5\n0.1 2.5\n0.2 3.5",
        "0.0\t1.5\r\n0.1\t2.5\r\n0.2\t3.5\r\n",
        "\n\n0.0   1.5 \n  \n 0.1 \t 2.5\n# in between\n0.2 3.5 # a remark\n\n",
        "\ufeff0 15e-1\n1e-1 2.5\n.2 +3.5\n",
        "# Prüfstand\n0.0 1.5\n0.1 2.5\n0.2 3.5\n",
    ],
    ids=["header", "bare", "tabs-crlf", "blanks", "byte-order-mark", "umlaut"],
)
def test_logs_are_read_in_every_common_layout(log, text):
    time, noise = nc.read_log(log(text))
    assert time.tolist() == [0.0, 0.1, 0.2]
    assert noise.tolist() == [1.5, 2.5, 3.5]


@IN_PLACE
@given(st.text(max_size=60))
def test_any_text_is_read_or_refused_with_a_reason(log, text):
    with suppress(nc.FileError):
        time, noise = nc.read_log(log(text))
        assert len(time) == len(noise) >= 2


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "walk.log: is empty; expected rows of time and noise"),
        ("0 1\n", "has one row"),
        ("# x\n0 1\n1 2 3\n2 3\n", "line 3 is '1 2 3', expected time and noise, finite"),
        ("0 1\n1\n", "line 2 is '1', expected time and noise"),
        ("time noise\n0 1\n1 2\n", "line 1 is 'time noise', expected"),
        ("0 1\n1 nan\n2 1\n", "line 2 is '1 nan', expected"),
        ("0 1\n\n1 1\ninf 1\n", "line 4 is 'inf 1', expected"),
        ("0 1\n1 1\n1 1\n2 1\n", "not in even steps of 1 s from row 2 to row 3: 1 s, then 1 s"),
        ("0 1\n1 1\n.5 1\n2 1\n3 1\n", "not in even steps of 1 s from row 2 to row 3: 1 s, then"),
        ("0 1\n1 1\n2 1\n4 1\n", "not in even steps of 1 s from row 3 to row 4: 2 s, then 4 s"),
    ],
)
def test_what_is_wrong_with_a_log_is_named(log, text, reason):
    with pytest.raises(nc.FileError, match=reason):
        nc.read_log(log(text))


def test_folders_that_are_no_recordings_are_refused(log, tmp_path):
    with pytest.raises(nc.FileError, match=r"has no .log file; name a folder"):
        list(read_folder(tmp_path))
    with pytest.raises(nc.FileError, match="is no folder"):
        list(read_folder(tmp_path / "none"))
    with pytest.raises(nc.FileError, match=r"none.log: cannot be read"):
        nc.read_log(tmp_path / "none.log")
    log(rows(20_000, rate=9_200))
    with pytest.raises(nc.FileError, match=r"walk.toml: .* each .log needs its .toml"):
        list(read_folder(tmp_path))
    log(TOML, "walk.toml")
    with pytest.raises(nc.RateError, match=r"rate of 9200 Hz; .* 10000 Hz: .*walk.log"):
        list(read_folder(tmp_path, rate=10_000.0))


def test_the_rate_is_that_of_the_whole_log():
    time = np.round(np.arange(2000) / 1000, 3) + 5.0
    assert nc.nominal_rate(time) == 1000.0


def test_annotations_take_integers_and_open_ends(log):
    blocks = read_annotations(log(TOML, "walk.toml"))
    assert blocks == (nc.Block(0.0, 0.5, "ok"), nc.Block(1.25, inf, "impact"))


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("chunk_ranges = [", r"not TOML \(Invalid value"),
        ("[data]\nchunk_ranges = []", "lacks chunk_ranges and chunk_labels, lists of one"),
        ("[simulation]\n", "lacks chunk_ranges and chunk_labels, lists of one"),
        ("data = 3\n", "lacks chunk_ranges and chunk_labels, lists of one"),
        ("[data]\nchunk_ranges = 3\nchunk_labels = []", "lacks chunk_ranges and chunk_labels"),
        (CHUNK.format("0, 1", '"ok", "ok"'), "lacks chunk_ranges and chunk_labels, lists of one"),
        (CHUNK.format("0", '"ok"'), r"chunk 1: \[0\] with label 'ok'"),
        (CHUNK.format("0, 1", "1"), r"chunk 1: \[0, 1\] with label 1"),
        (CHUNK.format(f"0, {10**400}", '"ok"'), "an integer of more than 20"),
        (CHUNK.format(f"0, {10**15}", '"ok"'), "chunk 1: .* expected"),
    ],
)
def test_what_is_wrong_with_annotations_is_named(log, text, reason):
    with pytest.raises(nc.FileError, match=reason):
        read_annotations(log(text, "walk.toml"))


def test_a_recording_joins_signal_annotations_and_hash(log):
    log(TOML, "walk.toml")
    path = log(rows(20_000))
    recording = read_recording(path, rate=10_000.0)
    assert (recording.name, recording.rate, len(recording.signal)) == ("walk", 10_000.0, 20_000)
    assert recording.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
