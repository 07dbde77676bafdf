"""Text of any kind where settings, labels and states are expected: one line, and within limits."""

import os

import numpy as np
import pytest
from checks import memory_below, one_line

import noiseclassifier as nc
from inspector import training, verdict
from inspector.errors import InspectorError
from inspector.export import read_labels
from inspector.live import LiveError, LiveSession
from inspector.live.pipe import reader_of
from inspector.logs.mapping import ReadOptions
from inspector.logs.names import column_signal, time_column
from inspector.logs.read import read_log
from inspector.reference import store
from inspector.text import counted, natural, plain, toml_shown
from noiseclassifier import jsontext, noisytest
from noiseclassifier.scenarios import DatasetError
from noiseclassifier.scenarios.dataset import Folder
from noisemodel import Run

TIME = np.arange(40) / 100
RUN = Run(time=TIME, velocity=np.ones((40, 1)), joint_names=("a",))


def read_state(path):
    with verdict.kept(path, {}):
        pass


def read_tuning(path):
    with training.opened(path, {}, [{"C": 1.0}]):
        pass


READERS = {
    "labels.toml": lambda path: read_labels(path, RUN),
    "labels.csv": lambda path: read_labels(path, RUN),
    "labels.txt": lambda path: read_labels(path, RUN),
    "reference.toml": store.Reference.load,
    "mapping.toml": ReadOptions.load,
    "state": read_state,
    "tuned.jsonl": read_tuning,
    "noisytest.toml": noisytest.read_annotations,
    "noisytest.log": nc.read_log,
    "dataset.json": lambda path: Folder.opened(path.parent),
}
EXPECTED = (InspectorError, nc.ModelsError, DatasetError)


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize("kind", ["zero", "pipe", "3 GB"])
def test_a_file_without_end_is_one_line(tmp_path, name, kind):
    path = tmp_path / name
    if kind == "zero":
        path.symlink_to("/dev/zero")
    elif kind == "pipe":
        os.mkfifo(path)
    else:
        path.touch()
        os.truncate(path, 3 * 10**9)
    with one_line(EXPECTED):
        READERS[name](path)


def test_a_line_without_end_is_no_row_of_a_log(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time,a.velocity\n" + "".join(f"{at},1\n" for at in TIME))
    os.truncate(path, 3 * 10**9)
    with pytest.raises(InspectorError, match="a line of more than 4194304 characters"):
        read_log(path)


@pytest.mark.parametrize("name", [each for each in READERS if each.endswith("toml")])
@pytest.mark.parametrize(
    "text",
    [
        "x = " + "[" * 100_000,
        "x = " + "{a=" * 5000,
        "x = " + "9" * 5000,
        "a." * 100_000 + "b = 1",
        f"[{'a. ' * 20_000}b]",
        '"a" . ' * 20_000 + "b = 1",
        "x = '\ud800'",
    ],
    ids=lambda text: text[:8],
)
def test_toml_that_takes_much_memory_or_stack_is_one_line(tmp_path, name, text):
    path = tmp_path / name
    path.write_bytes(text.encode(errors="surrogatepass"))
    with memory_below(200e6), one_line(EXPECTED):
        READERS[name](path)


def test_keys_and_numbers_that_people_write_are_no_long_keys():
    text = "a.b.c = 1\nranges = [" + ", ".join(f"[{n}.0, {n}.5]" for n in range(5000)) + "]\n"
    assert jsontext.from_toml(text)["a"] == {"b": {"c": 1}}


@pytest.mark.parametrize("sign", ["", "-"])
def test_integers_have_up_to_twenty_digits(sign):
    most, more = f"{sign}{'9' * 20}", f"{sign}1{'0' * 20}"
    assert jsontext.from_json(f"[{most}]") == [int(most)]
    assert jsontext.from_toml(f"a = [{{b = {most}}}]") == {"a": [{"b": int(most)}]}
    for read, text in ((jsontext.from_json, f"[{more}]"), (jsontext.from_toml, f"a = [{more}]")):
        with pytest.raises(ValueError, match=r"^an integer of more than 20 digits$"):
            read(text)


def test_a_key_has_up_to_a_hundred_parts():
    parts = [f"k{number}" for number in range(101)]
    for separator in (".", " . "):
        assert jsontext.from_toml(f"{separator.join(parts[:100])} = 1")
        with pytest.raises(ValueError, match=r"^a key of more than 100 parts$"):
            jsontext.from_toml(f"{separator.join(parts)} = 1")


def test_a_text_may_be_of_64_mib_and_toml_of_16_and_no_more(monkeypatch, tmp_path):
    path = tmp_path / "text.json"
    with path.open("wb") as file:
        file.truncate(2**26 + 1)
    with pytest.raises(ValueError, match=r"^67108865 bytes, the limit is 67108864$"):
        jsontext.text_of(path)
    with pytest.raises(ValueError, match=r"^16777217 characters, the limit is 16777216$"):
        jsontext.from_toml("#" * (2**24 + 1))
    monkeypatch.setattr(jsontext, "MAX_CHARACTERS", 9)
    monkeypatch.setattr(jsontext, "MAX_TOML", 9)
    path.write_bytes(b"\xef\xbb\xbf[1, 2]")  # a byte order mark and six characters
    assert jsontext.text_of(path) == "[1, 2]"
    assert jsontext.from_json("[1, 2, 3]") == [1, 2, 3]
    for read in (jsontext.from_json, jsontext.from_toml):
        with pytest.raises(ValueError, match=r"^10 characters, the limit is 9$"):
            read("[1,  2, 3]")


def test_values_are_shown_about_as_they_stand_in_toml():
    text = 'a = {b = [true, false], c = 1979-05-27, d = 07:32:00, e = "x", f = 1.5}'
    shown = "{b = [true, false], c = 1979-05-27, d = 07:32:00, e = 'x', f = 1.5}"
    assert toml_shown(jsontext.from_toml(text)["a"]) == shown


@pytest.mark.parametrize("settings", ["[" * 100_000, "[]", "9" * 5000, '{"format": NaN}', "\xff"])
def test_settings_of_a_data_set_that_are_none_are_one_line(tmp_path, settings):
    (tmp_path / "dataset.json").write_text(settings, encoding="latin-1")
    with one_line(DatasetError, "damaged|cannot be read|made with format"):
        Folder.opened(tmp_path)


@pytest.mark.parametrize("name", ["a" * 10_000, "[" * 100_000, "q" + "9" * 5000, "a_" * 50_000])
def test_a_long_name_is_that_of_no_signal_and_decided_at_once(name):
    assert column_signal(name) is None
    assert time_column([name]) == ""
    with pytest.raises(LiveError, match="names no velocity") as caught:
        reader_of(f"time,{name}".encode(), ())
    assert len(str(caught.value)) < 300


def test_cells_are_quoted_only_as_far_as_they_can_be_read(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(f"time,a.velocity\n0,1\n0.01,{'x' * 10_000}\n")
    with pytest.raises(InspectorError, match="row 3: column 'a.velocity' holds 'x") as caught:
        read_log(path)
    assert len(str(caught.value)) < 300


def test_a_live_row_of_more_joints_than_a_run_may_have_is_refused(tmp_path):
    with (
        pytest.raises(LiveError, match="100000 joints, the limit is 1000 .--limit joints=N"),
        LiveSession(100.0, save=tmp_path / "a.rrd", library={}) as session,
    ):
        session.push(velocity=np.ones(100_000))


def test_numbers_are_counted_rounded_and_sorted_as_people_write_them():
    counts = [counted(number, "finding") for number in (0, 1, 2)]
    assert counts == ["0 findings", "1 finding", "2 findings"]
    rounded = [plain(value) for value in (0.01234, 31.25, 3542.0, 98765.0)]
    assert rounded == ["0.0123", "31.2", "3540", "98800"]
    assert plain(12345.6, 4) == "12350"
    names = ["pick-10", "²1", "pick-9", "a²"]
    assert sorted(names, key=natural) == ["a²", "pick-9", "pick-10", "²1"]
