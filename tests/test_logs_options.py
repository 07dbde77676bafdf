"""Options of reading a log, saved as TOML."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inspector.errors import InspectorError
from inspector.logs.mapping import JOINT, UNITS, Entry, ReadOptions, parse_mapping

LETTERS = st.characters(codec="utf-8", exclude_categories=("Cs", "Cc"), exclude_characters="=")
NAMES = st.text(LETTERS, min_size=1)
PLAIN = NAMES.filter(lambda name: JOINT not in name)  # a pattern on one side cannot be typed
FORMAT = 'format = "noise-mapping/1"\n'


@given(
    robot=NAMES | st.just(""),
    rate=st.none() | st.floats(1e-3, 1e6),
    units=st.sampled_from(("", *UNITS)),
    joints=st.lists(NAMES).map(tuple),
    topics=st.lists(NAMES).map(tuple),
    offset=st.none() | st.floats(-1e12, 1e12),
    columns=st.lists(st.tuples(PLAIN, PLAIN), unique_by=(lambda p: p[0], lambda p: p[1])),
)
@settings(max_examples=30, deadline=None)
def test_a_saved_mapping_is_loaded_unchanged(tmp_path_factory, columns, **settings):
    entries = tuple(Entry("velocity", joint, column) for joint, column in columns)
    options = ReadOptions(entries=entries, **settings)
    path = tmp_path_factory.mktemp("saved") / "mapping.toml"
    options.save(path)
    assert ReadOptions.load(path) == options


def test_a_saved_mapping_is_readable(tmp_path):
    entries = parse_mapping(["time=clock", "position=qpos[7:]", "velocity.left.elbow=dq 2"])
    ReadOptions(robot="panda", rate=50.0, joints=("a", "b"), entries=entries).save(
        tmp_path / "m.toml"
    )
    assert (tmp_path / "m.toml").read_text() == (
        'format = "noise-mapping/1"\nrobot = "panda"\nrate = 50.0\njoints = ["a", "b"]\n\n'
        '[map]\n"time" = "clock"\n"position" = "qpos[7:]"\n"velocity.left.elbow" = "dq 2"\n'
    )


@pytest.mark.parametrize(
    ("source", "name", "columns"),
    [
        ("qpos", "qpos", [0, 1, 2, 3, 4]),
        ("qpos[3]", "qpos", [3]),
        ("qpos[1:]", "qpos", [1, 2, 3, 4]),
        ("qpos[:2]", "qpos", [0, 1]),
        ("a[0][2:4]", "a[0]", [2, 3]),
        ("odd[]", "odd[]", [0, 1, 2, 3, 4]),
    ],
)
def test_a_part_of_an_array_is_named_as_python_does(source, name, columns):
    found, part = Entry("position", "", source).part()
    assert found == name
    assert list(range(5))[part] == columns


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("rate = 3", 'not a mapping; expected format = "noise-mapping/1"'),
        ("rate = ", "not a mapping in TOML"),
        (FORMAT + "speed = 3", "unknown setting 'speed'; there are columns, force, joints, off"),
        (FORMAT + 'rate = "fast"', "rate = 'fast' is of another type"),
        (FORMAT + "rate = -1", "the rate is -1 Hz; expected 0.001 to 1e[+]09 Hz"),
        (FORMAT + "rate = 2027-01-31", "rate = 2027-01-31 is of another type"),
        (FORMAT + 'joints = "a"', "joints = 'a' is of another type"),
        (FORMAT + 'units = "miles"', "no units 'miles'; there are radians, degrees"),
        (FORMAT + "map = 3", "m.toml: "),
        (FORMAT + '[map]\nspeed = "x"', "mapping 'speed=x': expected SIGNAL"),
        (FORMAT + "[map]\nvelocity = 3", "velocity = 3 is of another"),
    ],
)
def test_an_invalid_mapping_is_an_error_of_one_line(tmp_path, text, message):
    (tmp_path / "m.toml").write_text(text)
    with pytest.raises(InspectorError, match=message) as caught:
        ReadOptions.load(tmp_path / "m.toml")
    assert "\n" not in str(caught.value)
    with pytest.raises(InspectorError, match=r"cannot be read \(No such file"):
        ReadOptions.load(tmp_path / "gone.toml")


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        (["base_pose.xyz=p"], "a base_pose is written as xyzw or wxyz"),
        (["base_velocity.local=p"], "a base_velocity is written as body or world or mujoco"),
        (["position=a", "position=b"], "'position' is mapped twice"),
    ],
)
def test_an_invalid_entry_is_named(entries, message):
    with pytest.raises(InspectorError, match=message):
        parse_mapping(entries)
