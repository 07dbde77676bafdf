"""The layout of a JointState, compared with what rosbags reads."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from samplelogs import Talk

from inspector.logs.bags import Layout, stamp

TALK = Talk()
FLOATS = st.lists(st.floats(width=64), max_size=5)


@given(
    st.lists(st.text(st.characters(codec="utf-8", exclude_characters="\0")), max_size=4),
    FLOATS,
    FLOATS,
    FLOATS,
    st.text(st.characters(codec="ascii", exclude_characters="\0"), max_size=9),
)
@settings(max_examples=100, deadline=None)
def test_a_layout_gives_the_numbers_of_rosbags(names, position, velocity, effort, frame):
    message = TALK.joint_state(1_700_000_000_123_456_789, names, position, velocity, effort)
    message.header.frame_id = frame
    data = bytes(TALK.raw(message))
    layout = Layout.of(data)
    assert layout.fits(data)
    assert list(layout.names) == names
    assert stamp(data) == 1_700_000_000_123_456_789
    parsed = TALK.store.deserialize_cdr(data, "sensor_msgs/msg/JointState")
    for (start, stop), name in zip(layout.arrays, ("position", "velocity", "effort"), strict=True):
        assert data[start:stop] == getattr(parsed, name).tobytes()


def test_another_layout_does_not_fit():
    one, other, longer = (
        bytes(TALK.raw(TALK.joint_state(0, names, values, values)))
        for names, values in ((["ab"], [1.0]), (["ac"], [2.0]), (["ab", "c"], [1.0, 2.0]))
    )
    layout = Layout.of(one)
    assert layout.fits(bytes(TALK.raw(TALK.joint_state(5, ["ab"], [3.0], [4.0]))))
    assert not layout.fits(other)
    assert not layout.fits(longer)


def test_what_is_no_joint_state_has_no_layout():
    data = bytes(TALK.raw(TALK.joint_state(0, ["a"], np.ones(1), np.ones(1))))
    assert Layout.of(b"\x00\x00" + data[2:]) is None  # big-endian
    for length in range(len(data)):
        assert Layout.of(data[:length]) is None
    assert Layout.of(data[:12] + b"\xff" * 40) is None
