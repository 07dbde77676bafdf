import numpy as np
import pytest
from checks import one_line
from csvlogs import TIME, write

from inspector import read_log
from inspector.errors import LogError


def test_the_first_stamp_is_kept_exactly(tmp_path):
    stamps = [f"17000000001234{n:02d}567" for n in range(5)]
    path = write(tmp_path / "log.csv", {"stamp": stamps, "a.velocity": np.ones(5)})
    imported = read_log(path, rate=1e6)
    assert imported.run.meta["start"] == "1700000000.123400567"
    assert imported.remarks == (
        "log.csv: stamps are in nanoseconds",
        "time starts at 0; the first stamp, 1700000000.123400567 s, is in meta",
    )


HEAD = "time,a.velocity,b.velocity\n"
ROW = HEAD + "0,1,2\n"


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("", "log.csv: the log is empty; expected a header"),
        (HEAD, "log.csv: 0 samples; a run needs at least 2"),
        (ROW, "log.csv: 1 sample; a run needs at least 2"),
        (ROW + "0.1,1,2\n0.05,1,2\n", "row 4: time runs backwards: 0.05 comes after 0.1"),
        (ROW + "\n0.1,1,2\n0.1,1,2\n", "row 5: time stands still: 0.1 comes after 0.1"),
        (ROW + "0.1,nan,2\n", "row 3: column 'a.velocity' is empty in 50% of the rows; col"),
        (ROW + "0.1,1,-inf\n", "row 3: column 'b.velocity' holds -inf"),
        (ROW + "nan,1,2\n", "row 3: column 'time' holds 'nan', which is no time"),
        (ROW + "0.1,,2\n", r"row 3: column 'a.velocity' is empty .* \(--desired\)"),
        (ROW + ",,\n", "row 3: column 'time' is empty"),
        (ROW + "0.1,1,off\n", "row 3: column 'b.velocity' holds 'off', which is not a number"),
        ("time;a.velocity\n0;1\n0,1s;1\n", "row 3: column 'time' holds '0,1s', which is no time"),
        (ROW + "0.1,1\n", "row 3: 2 cells where the header names 3 columns"),
        (ROW + "0.1,1,2,3\n", "row 3: 4 cells where the header names 3 columns"),
        ("time,a.velocity,a.velocity\n0,1,2\n", "row 1: two columns are named 'a.velocity'"),
        (
            "time,a.velocity,/js/a/velocity\n0,1,2\n0.1,1,2\n",
            "'a.velocity' and '/js/a/velocity' both hold velocity of joint 'a'",
        ),
        ('time,"a.velocity\n0,1\n', r"row 1: the name 'a.velocity\\n0,1' cannot be printed; is a"),
        ("clock,a.velocity\n0,1\n1,1\n", "there are no stamps; give the log's rate"),
        (
            "0,1,2,3,4\n" * 2,
            "row 1: there is no header; the first row has 5 numbers.* such as --columns"
            r" time,q1,q2,dq1,dq2 \(without stamps: no time, but --rate HZ\)",
        ),
        ("0,00;1,0;\n0,04;1,0;\n", "row 1: there is no header; the first row has 2 numbers"),
        ("0.0,1.0,2.0\n\n0.1,1.0\n", "row 1: there is no header; the first row has 3 numbers"),
        ("time,speed\n0,1\n0.1,1\n", "no position or velocity of a joint; name columns"),
        ("time,a.effort\n0,1\n0.1,1\n", "no position or velocity of a joint"),
        (ROW + "0.1,1,2\n0.2,1,2\n1e9,1,2\n", "row 5: time jumps by 1e.09 s; most of"),
        (HEAD + '0,1,"2\n' + "0,1,2\n" * 40_000, r"not a CSV log \(field larger than field limit"),
    ],
)
def test_a_bad_log_is_one_line_that_names_the_row(tmp_path, body, message):
    path = tmp_path / "log.csv"
    path.write_text(body)
    with one_line(LogError, message, path):
        read_log(path)


NUMBER = np.arange(400)


@pytest.mark.parametrize(
    ("clocks", "rate"),
    [
        *(({"wall_time": 1.7 * TIME, name: TIME}, 100) for name in ("sim_time", "t", "timestamps")),
        *(({"host_time": 1.7 * TIME, name: TIME}, 100) for name in ("times", "tout")),
        ({"time": np.int64(np.rint((TIME / 5 + 1200) * 1e6))}, 500),  # no dates a long time ago
        ({"sec": NUMBER // 100, "nsec": NUMBER % 100 * 10**7, "nanosec": 0 * NUMBER}, 100),
    ],
)
def test_of_several_clocks_a_robots_own_and_the_usual_name_count(tmp_path, clocks, rate):
    path = write(tmp_path / "log.csv", clocks | {"a.velocity": TIME})
    assert read_log(path).run.rate == rate


def test_a_file_that_is_no_log_is_named(tmp_path):
    (tmp_path / "log.csv").write_bytes(b"\x89PNG\r\n\x1a\n\x00\xff\xfe")
    with pytest.raises(LogError, match="not a CSV log: not text in UTF-8"):
        read_log(tmp_path / "log.csv")
    with pytest.raises(LogError, match=r"gone.csv: cannot be read \(No such file"):
        read_log(tmp_path / "gone.csv")
    with pytest.raises(LogError, match="a folder that is neither a ROS 2 bag"):
        read_log(tmp_path)


def test_comments_in_a_long_log_are_left_out_though_they_hold_numbers(tmp_path):
    rows = [f"{n},{n / 1000},{np.sin(n / 500)},{2 * np.cos(n / 500)}" for n in range(40_000)]
    for place in (1000, 39_000):
        rows.insert(place, "#,9,9,9")
    (tmp_path / "log.csv").write_text("\n".join(["n,time,q1,dq1", *rows, ""]))
    imported = read_log(tmp_path / "log.csv")
    assert len(imported.run.time) == 40_000
    assert imported.remarks == ("log.csv: 1 column not read: n",)
