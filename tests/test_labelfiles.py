"""Label files: written and read again, damaged, and by commands."""

import numpy as np
import pytest
from checks import one_line
from commandline import call, printed
from hypothesis import example, given, settings
from hypothesis import strategies as st

from inspector.errors import InspectorError
from inspector.export import read_labels, write_labels
from inspector.library import demo_run
from noiseclassifier import Event
from noisemodel import Block, OutputError, Run, RunError

words = st.text(min_size=1, max_size=12).filter(str.isprintable)
times = st.floats(-1e6, 1e6, allow_nan=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("labels")


@st.composite
def annotated_runs(draw):
    """Runs with blocks that begin and end anywhere, at any floats."""
    begin = draw(st.sampled_from([0.0, -3.0, 1e5]) | times)
    time = begin + np.arange(200) / draw(st.sampled_from([3.0, 30.0, 1000.0]))
    edges = sorted(draw(st.lists(st.floats(time[0], time[-1]), max_size=12, unique=True)))
    pairs = list(zip(edges[::2], edges[1::2], strict=False))
    labels = draw(st.lists(words, min_size=len(pairs), max_size=len(pairs)))
    blocks = [Block(*pair, label) for pair, label in zip(pairs, labels, strict=True)]
    return Run(time=time, velocity=np.zeros((200, 1)), joint_names=("elbow",), blocks=blocks)


def there_and_back(folder, run, suffix, spans=None):
    path = folder / f"labels{suffix}"
    write_labels(run.blocks if spans is None else spans, path, overwrite=True)
    return read_labels(path, run)


def run_with(*blocks, seconds=10.0):
    time = np.arange(round(100 * seconds)) / 100
    velocity = np.zeros((len(time), 1))
    return Run(time=time, velocity=velocity, joint_names=("elbow",), blocks=blocks)


@pytest.mark.parametrize("suffix", [".csv", ".txt"])
@settings(deadline=None, max_examples=60)
@given(run=annotated_runs())
@example(run=run_with())
@example(run=run_with(Block(0.1 + 0.2, 1 / 3, " a,\"b\"; 'c' "), Block(1e-300, 0.1, "\\")))
def test_labels_written_and_read_again_are_equal(folder, suffix, run):
    assert there_and_back(folder, run, suffix) == run.blocks


@settings(deadline=None, max_examples=60)
@given(run=annotated_runs())
@example(run=run_with())
@example(run=run_with(Block(0.5, 1.0, 'say "\\u0041" \\')))
def test_labels_written_and_read_by_noisytest_are_equal(folder, run):
    if any(block.stop == -1.0 for block in run.blocks):
        with pytest.raises(InspectorError, match="stops at -1 s, the end of the recording"):
            there_and_back(folder, run, ".toml")
    else:
        assert there_and_back(folder, run, ".toml") == run.blocks


def test_findings_keep_their_scores_in_csv(tmp_path):
    write_labels([Event("impact", 0.1, 0.5, 1 / 3)], tmp_path / "found.csv")
    assert (tmp_path / "found.csv").read_text() == (
        "start,stop,label,score\n0.1,0.5,impact,0.3333333333333333\n"
    )


@pytest.mark.parametrize(
    ("name", "text", "blocks"),
    [
        (
            "labels.toml",
            '[data]\nchunk_ranges = [[0, 1.5], [2, -1]]\nchunk_labels = ["ok", "impact"]\n',
            ((0.0, 1.5, "ok"), (2.0, 10.0, "impact")),
        ),
        (
            "audacity.txt",
            "1.000000\t2.500000\timpact\r\n\\\t100.0\t2000.0\r\n0.000000\t0.500000\tok\r\n",
            ((0.0, 0.5, "ok"), (1.0, 2.5, "impact")),
        ),
        (
            "spreadsheet.csv",
            "\ufeffLabel,Start,Stop,by whom\r\nok,0,0.5,\r\n\r\nimpact,1,2.5,me\r\n",
            ((0.0, 0.5, "ok"), (1.0, 2.5, "impact")),
        ),
    ],
)
def test_files_that_other_tools_write_are_read(tmp_path, name, text, blocks):
    assert reading(tmp_path, name, text) == tuple(Block(*each) for each in blocks)


def test_all_labels_that_a_run_accepts_can_be_written(folder):
    """A block may begin and end up to a sample outside of the run, and overlap by one."""
    blocks = (Block(-0.0099, 5.0, "ok"), Block(4.991, 10.0099, "impact"))
    assert there_and_back(folder, run_with(*blocks), ".csv") == blocks
    with pytest.raises(RunError, match="outside of"):
        run_with(Block(-0.0101, 5.0, "ok"))


def toml(ranges, labels):
    return f"[data]\nchunk_ranges = {ranges}\nchunk_labels = {labels}\n"


RUN = run_with()


def reading(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_labels(path, RUN)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("l.txt", "0\t1\tok\n1\tok\n", "line 2: expected start, stop and label between tabs"),
        ("l.txt", "0\t1\tok\n\n2,5\t3\tok\n", r"line 3: '2,5' is not a time in seconds"),
        ("l.txt", "nan\t1\tok\n", "line 1: 'nan' is not a time"),
        ("l.txt", "3\t2\tok\n", "line 1: 'ok' from 3 s to 2 s is empty, or lies outside of"),
        ("l.txt", "3\t3\tclick\n", "line 1: 'click' from 3 s to 3 s is empty, or lies"),
        ("l.txt", "3\t4\t\n", "line 1: '' is empty or cannot be printed"),
        ("l.txt", "3\t4\ta\tb\n", r"line 1: 'a\\tb' is empty or cannot be printed"),
        ("l.txt", "3\t12\tok\n", "line 1: 'ok' from 3 s to 12 s .* the run, -0.01 s to 10.01 s"),
        ("l.txt", "-1\t2\tok\n", "line 1: 'ok' from -1 s to 2 s is .* outside of the run"),
        ("l.txt", "3\t5\tb\n1\t4\ta\n", "line 1: blocks overlap: 'b' starts at 3 s, before 'a'"),
        ("l.txt", b"\xff\xfe\x00", "not text in UTF-8"),
        ("l.csv", "", "line 1: there is no column 'start'; expected start, stop, label"),
        ("l.csv", "start,end,label\n", "line 1: there is no column 'stop'"),
        ("l.csv", "start,stop,label\n1,2\n", "line 2: 2 cells where the header names 3 columns"),
        ("l.csv", 'start,stop,label\n1,2,"a\nb"\n', "line 3: .* is empty or cannot be printed"),
        ("l.csv", 'start,stop,label\n1,2,"a\n', "line 2: not CSV"),
        ("l.csv", "start,stop,label\n1,2,a\n1.5,3,b\n", "line 3: .* overlap: 'b' .* before 'a'"),
        ("l.toml", "[data\n", r"not TOML \(.*line 1"),
        ("l.toml", toml([[0, 1], [2]], ["ok", "ok"]), r"chunk 2: \[2\] with label 'ok', expected"),
        ("l.toml", toml("[[nan, true]]", ["ok"]), "chunk 1: .* expected"),
        ("l.toml", toml([[0, 5], [4, -1]], ["ok", "impact"]), "chunk 2: .* 'ok' stops at 5 s"),
    ],
)
def test_damaged_labels_are_refused_with_their_place(tmp_path, name, content, message):
    with one_line(InspectorError, message, tmp_path / name):
        reading(tmp_path, name, content)


def test_unknown_formats_are_refused_with_the_known_ones(tmp_path):
    message = r"no format of labels has this suffix; there are \.toml"
    with pytest.raises(InspectorError, match=message):
        read_labels(tmp_path / "labels.xlsx", RUN)
    with pytest.raises(InspectorError, match=r"there are \.toml \(noisytest\), \.csv \(csv\)"):
        write_labels((), tmp_path / "labels")
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten_or_written_in_part(tmp_path):
    path = tmp_path / "labels.csv"
    path.write_text("mine")
    with pytest.raises(OutputError, match="exists already"):
        write_labels([Block(0.0, 1.0, "ok")], path)
    assert path.read_text() == "mine"
    with pytest.raises(InspectorError, match="the end of the recording in NoisyTest"):
        write_labels([Block(-2.0, -1.0, "ok")], tmp_path / "labels.toml")
    assert list(tmp_path.iterdir()) == [path]
    write_labels([Block(0.0, 1.0, "ok")], path, overwrite=True)
    assert path.read_text() == "start,stop,label\n0.0,1.0,ok\n"


def test_annotated_blocks_are_written_and_read_by_the_command(tmp_path):
    labels = tmp_path / "labels.txt"
    out = printed("export", demo_run(), "--labels", "annotated", "-o", labels)
    assert "labels.txt: 4 labels" in out
    demo, bare = Run.load(demo_run()), tmp_path / "bare.npz"
    Run(time=demo.time, velocity=demo.velocity, joint_names=demo.joint_names).save(bare)
    printed("export", bare, "--annotate", labels, "-o", tmp_path / "n.npz")
    assert Run.load(tmp_path / "n.npz").blocks == demo.blocks


def test_findings_are_written_by_the_command_and_nothing_is_replaced_unasked(tmp_path):
    found, still = tmp_path / "found.txt", tmp_path / "still.npz"
    run_with(seconds=30).save(still)
    assert call("export", still, "--labels", "findings", "-o", found)[0] == 0
    assert found.read_text() == ""
    options = "export", demo_run(), "--labels", "findings", "-o", found
    assert "exists already" in call(*options)[2]
    assert call(*options, "--overwrite")[0] == 0
    lines = found.read_text().splitlines()
    assert {line.split("\t")[2] for line in lines} >= {"impact"}
