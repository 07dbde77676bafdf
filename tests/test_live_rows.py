import io
import json
import os
import signal
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from inspector.live import LiveError
from inspector.live.pipe import (
    MAX_LINE_BYTES,
    SMALL_CHUNK_BYTES,
    CsvReader,
    JsonReader,
    chunks,
    follow,
    reader_of,
)
from inspector.logs.read import read_log

HEAD = b"time,elbow.velocity,wrist.velocity,elbow.position,wrist.position,load"


def read(reader, lines, first=2):
    """Rows of lines, and the kinds and texts of what is told of them."""
    warned = []
    return list(reader.read(lines, first, lambda *told: warned.append(told))), warned


def test_columns_are_found_by_their_names():
    reader = CsvReader(HEAD, ())
    (rows,), warned = read(reader, b"0.5,1,2,3,4,9\n0.6,1.5,-2e-3,3,4,9\n0.7,,nan,3,4,9\n")
    assert reader.names == ("elbow", "wrist")
    assert rows["time"].tolist() == [0.5, 0.6, 0.7]
    unknown = [np.nan, np.nan]
    np.testing.assert_array_equal(rows["velocity"], [[1.0, 2.0], [1.5, -2e-3], unknown])
    assert rows["position"].tolist() == 3 * [[3.0, 4.0]]
    assert warned == []


def test_names_select_joints_and_their_order():
    (rows,), _ = read(CsvReader(HEAD, ("wrist",)), b"0,1,2,3,4,9\n")
    assert rows["velocity"].tolist() == [[2.0]]
    (rows,), _ = read(CsvReader(b"t,dq1 [deg/s]", ()), b"0,180\n")
    assert rows["velocity"].tolist() == [[np.pi]]
    head = b"t;actual_qd_0;actual_qd_1;target_qd_0;target_qd_1"
    reader = CsvReader(head, ("shoulder", "elbow"))
    (rows,), _ = read(reader, b"0;1;2;3;4\r\n")
    assert rows["velocity_desired"].tolist() == [[3.0, 4.0]]
    assert CsvReader(head, ()).names == ("joint_0", "joint_1")


@pytest.mark.parametrize(
    ("lines", "first", "kept", "told"),
    [
        (
            b"0,1,2,3,4,9\n1,2,3\n\nx,1,2,3,4,9\n2,1,2,3,4,9\n",
            100,
            [0.0, 2.0],
            {
                101: "3 cells where the header names 6",
                103: "could not convert string to float: 'x'",
            },
        ),
        (  # of wrong lengths that add up
            b"0,1,2,3,4\n1,1,2,3,4,9,9\n2,1,2,3,4,9\n",
            2,
            [2.0],
            {2: "5 cells where the header names 6", 3: "7 cells where the header names 6"},
        ),
    ],
)
def test_malformed_rows_are_reported_by_their_line_and_left_out(lines, first, kept, told):
    (rows,), warned = read(CsvReader(HEAD, ()), lines, first=first)
    assert rows["time"].tolist() == kept
    assert warned == [
        ("malformed rows", f"line {number}: {why}; such rows are left out")
        for number, why in told.items()
    ]


def test_without_stamps_a_malformed_row_still_takes_its_time():
    (rows,), warned = read(CsvReader(b"a.velocity", ()), b"1\noops\n3\n")
    np.testing.assert_array_equal(rows["velocity"], [[1.0], [np.nan], [3.0]])
    assert "time" not in rows
    assert len(warned) == 1


def test_all_ways_of_reading_agree():
    random = np.random.default_rng(0)
    table = random.normal(size=(50, 6)) * 10.0 ** random.integers(-300, 300, (50, 6))
    table[random.uniform(size=table.shape) < 0.1] = np.nan
    lines = "".join(",".join(map(repr, row)) + "\n" for row in table.tolist()).encode()
    (plain,), warned = read(CsvReader(HEAD, ()), lines)
    (padded,), _ = read(CsvReader(HEAD, ()), lines.replace(b",", b" ,", 1))
    (careful,), _ = read(CsvReader(HEAD, ()), lines + b"broken\n")
    assert warned == []
    for rows in (plain, padded, careful):
        np.testing.assert_array_equal(rows["velocity"], table[:, 1:3])
        np.testing.assert_array_equal(rows["time"], table[:, 0])


@pytest.mark.parametrize(
    ("head", "names", "reason"),
    [
        (b"hello", (), "the header names no velocity; .* they are hello"),
        (b"a.velocity,b.velocity,a.position", (), "the header has no position of joint 'b'"),
        (b"a.velocity", ("b",), "the header has no velocity of joint 'b'"),
        (b"dq1,dq2,dq3", ("a", "b"), "column 'dq3' is joint 3, and --names has 2"),
        (b"dq1,dq2,dq2", (), "the header names the velocity of 'joint_2' twice"),
        (b"a.velocity [Nm]", (), r"the header names no velocity; .* they are a.velocity \[Nm\]"),
    ],
)
def test_headers_that_do_not_define_all_columns_are_refused(head, names, reason):
    with pytest.raises(LiveError, match=reason):
        CsvReader(head, names)


def test_objects_hold_arrays_as_a_run_file_names_them():
    reader, is_header = reader_of(b' {"velocity": [1]}', ("a",))
    assert not is_header
    assert reader.names == ("a",)
    samples = [{"time": 0.1, "velocity": [1, None], "position": [3, 4.5], "else": "?"}] * 2
    (rows,), _ = read(reader, "\n".join(map(json.dumps, samples)).encode())
    np.testing.assert_array_equal(rows["velocity"], [[1.0, np.nan]] * 2)
    assert rows["position"].tolist() == [[3.0, 4.5]] * 2
    assert rows["time"].tolist() == [0.1, 0.1]
    assert set(rows) == {"time", "velocity", "position"}


def test_objects_of_other_widths_are_kept_apart_and_malformed_ones_reported():
    lines = b'{"velocity":[1,2]}\n{"velocity":[1]}\n{"velocity":[1\n[3]\n{"velocity":["a"]}\n'
    lines += b'{"velocity":{}}\n'
    parts, warned = read(JsonReader(()), lines, first=1)
    assert [rows["velocity"].shape for rows in parts] == [(1, 2), (1, 1)]
    assert [line.split(":")[0] for _, line in warned] == ["line 3", "line 4", "line 5", "line 6"]
    assert warned[1][1] == "line 4: no JSON object with a velocity; such rows are left out"
    assert warned[3][1] == ("line 6: velocity holds no numbers; such rows are left out")


class Trickle(io.RawIOBase):
    """A pipe that brings a few bytes at a time."""

    def __init__(self, content, size):
        self.content, self.size = content, size

    def read1(self, most):
        piece, self.content = self.content[: self.size], self.content[self.size :]
        return piece


@pytest.mark.parametrize("size", [1, 3, 7, 1000])
def test_lines_are_whole_and_numbered_and_one_that_never_ends_is_refused(size):
    content = b"".join(b"line %d\n" % number for number in range(1, 30)) + b"line 30"
    for lines, number in chunks(Trickle(content, size)):
        for offset, line in enumerate(lines.splitlines()):
            assert line == b"line %d" % (number + offset)
    assert number + offset == 30
    with pytest.raises(LiveError, match=f"line 1 is longer than {MAX_LINE_BYTES} bytes"):
        list(chunks(Trickle(b"x" * (MAX_LINE_BYTES + 2), 1 << 20)))


def test_little_waits_for_more_and_much_is_read_at_once(monkeypatch):
    naps = []
    monkeypatch.setattr("inspector.live.pipe.sleep", naps.append)
    list(chunks(Trickle(b"1\n" * SMALL_CHUNK_BYTES, SMALL_CHUNK_BYTES), gather=0.5))
    assert naps == [0.0, 0.0]
    list(chunks(Trickle(b"1\n2\n3\n", 2), gather=0.5))
    assert naps[2:] == [0.5, 0.5, 0.5]


@pytest.mark.parametrize(
    "text",
    [
        "time,message,a.velocity,b.velocity\n0,,1,2\n0.1,COLLISION,3,4\n",
        'time,a.velocity,b.velocity,note\n0,1,2,""\n0.1,3,4,"hit, so stop"\n',
        '"time","a.velocity","b.velocity"\n0,1,2\n0.1,3,4\n',
        "\n# a robot\n \ntime,a.velocity,b.velocity\n0,1,2\n0.1,3,4\n",
        "# time,a.velocity,b.velocity\n0,1,2\n0.1,3,4\n",
        "time,a.velocity,b.velocity\n0,1,2,\n0.1,3,4,\n",
        f"time,a.velocity,b.velocity\nms,deg/s,[rpm]\n0,{np.rad2deg(1)},{60 / np.pi}\n"
        f"100,{np.rad2deg(3)},{120 / np.pi}\n",
    ],
)
@pytest.mark.parametrize("size", [30, 1000])
def test_a_stream_is_read_as_a_file_of_its_rows(text, size, tmp_path):
    path, told = tmp_path / "live.csv", []
    path.write_text(text)
    session = SimpleNamespace(push=lambda **rows: told.append(rows), note=pytest.fail)
    session.summary = SimpleNamespace(samples=2)
    follow(Trickle(text.encode(), size), (), lambda names: nullcontext(session))
    run = read_log(path, rate=10.0).run
    for name, expected in (("velocity", [[1.0, 2.0], [3.0, 4.0]]), ("time", [0.0, 0.1])):
        found = np.concatenate([rows[name] for rows in told])
        np.testing.assert_allclose(found, expected, rtol=1e-12)
        np.testing.assert_allclose(found, getattr(run, name), rtol=1e-6)


def live(*arguments, text="", **options):
    command = [sys.executable, "-m", "inspector", "live", *map(str, arguments)]
    environment = {key: value for key, value in os.environ.items() if "DISPLAY" not in key}
    return subprocess.run(
        command, input=text, capture_output=True, text=True, env=environment, **options
    )


def csv(samples, rate=1000.0):
    rows = [f"{i / rate:.6f},{np.sin(i / rate):.7f},0.1" for i in range(samples)]
    return "\n".join(["time,a.velocity,b.velocity", *rows, ""])


def test_the_command_shows_rows_and_sums_up(tmp_path):
    text = csv(1000).replace("0.500000,", "half,", 1) + "1.2,3\n"
    done = live("--rate", 1000, "--save", tmp_path / "live.rrd", text=text)
    assert done.returncode == 0, done.stderr
    assert "line 502: could not convert string to float: 'half'" in done.stderr
    assert "999 samples, 1.00 s at 1000 Hz, written to" in done.stdout
    assert "labels by general: 7 ok" in done.stdout  # the missing one is interpolated
    assert "2 malformed rows" in done.stdout
    assert "1 missing samples" in done.stdout
    assert (tmp_path / "live.rrd").stat().st_size > 10_000


def test_input_without_samples_is_one_line_and_no_file(tmp_path):
    done = live("--rate", 1000, "--save", tmp_path / "live.rrd", text="time,a.velocity\n")
    assert done.returncode == 3
    wanted = "expected a CSV header and rows, or a JSON object per line"
    assert done.stderr == f"inspector: the input has no samples; {wanted}\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("content", "reason"),
    [(b"", "the input is empty; expected a CSV header"), (b"a,b\n1,2\n", "names no velocity")],
)
def test_invalid_input_begins_no_session(content, reason):
    with pytest.raises(LiveError, match=reason):
        follow(io.BytesIO(content), (), lambda names: pytest.fail("a session began"))


@pytest.mark.slow
@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_with_the_summary_and_a_whole_file(tmp_path, sent):
    path = tmp_path / "live.rrd"
    command = [sys.executable, "-m", "inspector", "live", "--rate", "1000", "--save", str(path)]
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    process.stdin.write(csv(700) + "0.800,1\n")  # its warning on that line shows that it runs
    process.stdin.flush()
    assert "line 702: 2 cells" in process.stderr.readline()
    process.send_signal(sent)
    out, err = process.communicate()
    assert process.returncode == 0, err
    assert "700 samples, 0.70 s at 1000 Hz" in out
    assert "Traceback" not in err
    assert path.stat().st_size > 10_000
    assert [entry.name for entry in Path(tmp_path).iterdir()] == ["live.rrd"]
