"""Signals of a log, and the column and array names that they are known by."""

import re
from collections.abc import Sequence

JOINT_SIGNALS = ("position", "velocity", "effort", "position_desired", "velocity_desired")
BASE_SIGNALS = ("base_pose", "base_velocity")
SIGNALS = (*JOINT_SIGNALS, *BASE_SIGNALS)

TIMES = ("time", "timestamp", "t", "__time", "stamp")
"""Names of a time column, in any case; the first of these that a log has is used."""

NAMED = re.compile(
    r"(?:.*/)?(?P<joint>[^/]+)[./]"
    r"(?P<signal>(?:position|velocity)(?:_desired)?|effort)"
)
"""``elbow.velocity``, ``elbow/velocity``, and PlotJuggler's ``/joint_states/elbow/velocity``."""

NUMBERED = re.compile(
    r"(?:(?:.*/)?(?P<side>actual|feedback|desired|reference)/|.*/)?"
    r"(?P<signal>positions?|velocity|velocities|efforts?)[\[.](?P<number>\d+)\]?"
    r"|(?P<ur_side>actual|target)_(?P<ur_signal>qd?)_(?P<ur_number>\d+)"
)
"""PlotJuggler's ``/state/desired/velocities[0]``, and ur_rtde's ``target_qd_0``."""

WORDS = {"q": "position", "positions": "position", "qd": "velocity", "velocities": "velocity"}
COMMANDED = ("desired", "reference", "target")

ROBOSUITE = re.compile(r"robot\d+_(?=joint_(pos|vel)$)")
"""Prefix of robosuite's arrays."""

ARRAYS = {
    **{signal: signal for signal in SIGNALS},
    **dict.fromkeys(("q", "joint_pos", "joint_position", "dof_pos"), "position"),
    **dict.fromkeys(("qd", "dq", "joint_vel", "joint_velocity", "dof_vel"), "velocity"),
    **dict.fromkeys(("tau", "torque", "joint_effort", "applied_torque"), "effort"),
    **dict.fromkeys(("q_des", "joint_pos_target", "dof_pos_target"), "position_desired"),
    **dict.fromkeys(("qd_des", "dq_des", "joint_vel_target"), "velocity_desired"),
}
"""Signals by the names of arrays, in any case: those of the run file, and of simulators."""


def column_signal(column: str) -> tuple[str, str | int] | None:
    """Signal and joint of a column, by its name.

    Args:
        column: Its name.

    Returns:
        The signal, and the joint's name or number; None for an unknown name.
    """
    if match := NAMED.fullmatch(column):
        return match["signal"], match["joint"]
    match = NUMBERED.fullmatch(column)
    if match is None:
        return None
    word = match["signal"] or match["ur_signal"]
    signal = WORDS.get(word, word.removesuffix("s"))
    if (match["side"] or match["ur_side"]) in COMMANDED:
        if signal == "effort":
            return None
        signal += "_desired"
    return signal, int(match["number"] or match["ur_number"])


def array_signal(name: str) -> str | None:
    """Signal of an array by its name, without the folders in it; None for an unknown name."""
    return ARRAYS.get(ROBOSUITE.sub("", name.rpartition("/")[2].lower()))


def listed(names: Sequence[str]) -> str:
    """The first ten of some names, and how many more there are."""
    shown = ", ".join(names[:10])
    return shown + (f" and {len(names) - 10} more" if len(names) > 10 else "")
