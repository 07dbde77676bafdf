import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from inspector.errors import InspectorError
from inspector.labelfiles import FORMATS, read_labels, write_labels
from noiseclassifier import Event, noisytest
from noisemodel import Block, Run, RunError

SUFFIXES = [each.suffix for each in FORMATS.values()]

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
@example(run=run_with(Block(0.1 + 0.2, 1 / 3, " a,\"b\"; 'c' "), Block(1e-300, 0.1, "\\")))
def test_labels_written_and_read_again_are_equal(folder, suffix, run):
    assert there_and_back(folder, run, suffix) == run.blocks


@settings(deadline=None, max_examples=60)
@given(run=annotated_runs())
@example(run=run_with(Block(0.5, 1.0, 'say "\\u0041" \\')))
def test_labels_written_and_read_by_noisytest_are_equal(folder, run):
    if any(block.stop == -1.0 for block in run.blocks):
        with pytest.raises(InspectorError, match="stops at -1 s, the end of the recording"):
            there_and_back(folder, run, ".toml")
    else:
        assert there_and_back(folder, run, ".toml") == run.blocks


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_an_empty_list_of_labels_is_written_and_read(folder, suffix):
    assert there_and_back(folder, run_with(), suffix) == ()


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_findings_that_do_not_overlap_become_blocks(folder, suffix):
    events = [Event("impact", 0.1, 0.5, 1 / 3), Event("oscillations", 0.7, 1.1, 2.0)]
    blocks = there_and_back(folder, run_with(), suffix, events)
    assert blocks == (Block(0.1, 0.5, "impact"), Block(0.7, 1.1, "oscillations"))


def test_findings_keep_their_scores_in_csv(tmp_path):
    write_labels([Event("impact", 0.1, 0.5, 1 / 3)], tmp_path / "found.csv")
    assert (tmp_path / "found.csv").read_text() == (
        "start,stop,label,score\n0.1,0.5,impact,0.3333333333333333\n"
    )


def test_noisytest_reads_what_is_written_for_it(tmp_path):
    blocks = (Block(0.1, 0.5, "ok"), Block(1 / 3 + 1, 2.0, "impact"))
    write_labels(blocks, tmp_path / "labels.toml")
    read = noisytest.read_annotations(tmp_path / "labels.toml")
    assert [tuple(each) for each in read] == [(b.start, b.stop, b.label) for b in blocks]


def test_noisytests_stop_of_minus_1_is_the_end_of_the_run(tmp_path):
    text = '[data]\nchunk_ranges = [[0, 1.5], [2, -1]]\nchunk_labels = ["ok", "impact"]\n'
    (tmp_path / "labels.toml").write_text(text)
    blocks = read_labels(tmp_path / "labels.toml", run_with())
    assert blocks == (Block(0.0, 1.5, "ok"), Block(2.0, 10.0, "impact"))


def test_audacitys_own_files_are_read(tmp_path):
    text = "1.000000\t2.500000\timpact\r\n\\\t100.0\t2000.0\r\n0.000000\t0.500000\tok\r\n"
    (tmp_path / "track.txt").write_bytes(text.encode())
    blocks = read_labels(tmp_path / "track.txt", run_with())
    assert blocks == (Block(0.0, 0.5, "ok"), Block(1.0, 2.5, "impact"))


def test_a_spreadsheets_csv_is_read(tmp_path):
    text = "\ufeffLabel,Start,Stop,by whom\r\nok,0,0.5,\r\n\r\nimpact,1,2.5,me\r\n"
    (tmp_path / "labels.csv").write_bytes(text.encode())
    blocks = read_labels(tmp_path / "labels.csv", run_with())
    assert blocks == (Block(0.0, 0.5, "ok"), Block(1.0, 2.5, "impact"))


def test_a_format_can_be_named_in_place_of_the_suffix(tmp_path):
    run = run_with(Block(0.0, 1.0, "ok"))
    write_labels(run.blocks, tmp_path / "labels", format_name="noisytest")
    assert read_labels(tmp_path / "labels", run, format_name="noisytest") == run.blocks


def test_all_labels_that_a_run_accepts_can_be_written(folder):
    """A block may begin and end up to a sample outside of the run, and overlap by one."""
    blocks = (Block(-0.0099, 5.0, "ok"), Block(4.991, 10.0099, "impact"))
    assert there_and_back(folder, run_with(*blocks), ".csv") == blocks
    with pytest.raises(RunError, match="outside of"):
        run_with(Block(-0.0101, 5.0, "ok"))
