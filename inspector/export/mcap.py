"""Export as MCAP, for Foxglove and PlotJuggler.

/joint_states and /joint_states/desired are ROS 2 JointStates, a message for each sample, which
`inspector import` reads as well. The other topics are JSON: /noise for each sample, /level each
50 ms, /labels at the middle of each frame, /class where the class changes, /findings and
/annotations at their start, and /log with a line for each finding. Times are those of the run,
added to the first stamp in its ``meta``. MCAP has no negative times: a run that starts before 0 is
shifted.
"""

import heapq
import json
import math
from collections.abc import Iterator
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Any

import numpy as np

from inspector.errors import InspectorError
from inspector.export.content import Content
from noisemodel.types import Array

JOINT_STATE = "sensor_msgs/msg/JointState"
MEASURED, DESIRED = "/joint_states", "/joint_states/desired"
WARNING = 3
"""Level of a ``foxglove.Log``."""

NUMBER, TEXT = {"type": "number"}, {"type": "string"}
STAMP = {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}
SPAN = {"label": TEXT, "start": NUMBER, "stop": NUMBER}
NANOSECONDS = 10**9
LATEST = 2**63
"""Stamps from here on are not valid, in [ns]."""

Message = tuple[int, str, bytes]
"""Stamp in [ns], topic and serialised content."""


def write_mcap(content: Content, path: Path) -> None:
    """Write noise, labels, findings and annotations.

    Args:
        content: The exported data.
        path: The file to write.

    Raises:
        InspectorError: If the extra `mcap` is not installed.
    """
    try:
        from mcap.writer import Writer
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise InspectorError(
            f"MCAP needs the extra `mcap` ({error}); pip install 'noise-inspector[mcap]'"
        ) from error
    ros = get_typestore(Stores.ROS2_HUMBLE)
    joints = joint_signals(content)
    with path.open("wb") as stream:
        writer: Any = Writer(stream)
        writer.start(profile="ros2", library="noise-inspector")
        channels = {}
        if joints:
            definition, _ = ros.generate_msgdef(JOINT_STATE, ros_version=2)
            schema = writer.register_schema(JOINT_STATE, "ros2msg", definition.encode())
            channels = {topic: writer.register_channel(topic, "cdr", schema) for topic in joints}
        for topic, fields in _topics(content).items():
            data = json.dumps({"type": "object", "properties": fields}).encode()
            name = "foxglove.Log" if topic == "/log" else f"noise.{topic[1:]}"
            schema = writer.register_schema(name, "jsonschema", data)
            channels[topic] = writer.register_channel(topic, "json", schema)
        messages = _messages(content) + [
            _states(content, topic, *each, ros) for topic, each in joints.items()
        ]
        for stamp, topic, data in heapq.merge(*messages, key=lambda each: each[0]):
            writer.add_message(channels[topic], log_time=stamp, data=data, publish_time=stamp)
        writer.add_metadata(
            "noise-inspector",
            {"model": content.analysis.model, "extended": content.kind, "time": "s"},
        )
        writer.finish()


def joint_signals(content: Content) -> dict[str, tuple[tuple[str, ...], dict[str, Array]]]:
    """What the JointStates hold: by topic the joints, and by field an array (samples, joints).

    Args:
        content: The exported data.
    """
    run = content.analysis.run
    if content.analysis.audit is None:  # a scalar noise has no joints
        return {}
    signals = {
        MEASURED: (
            run.joint_names,
            {"position": run.position, "velocity": run.velocity, "effort": run.effort},
        ),
        DESIRED: (
            run.desired_joint_names,
            {"position": run.position_desired, "velocity": run.velocity_desired},
        ),
    }
    known = {
        topic: (
            names,
            {
                name: np.ascontiguousarray(each[run.mask], float)
                for name, each in parts.items()
                if each is not None
            },
        )
        for topic, (names, parts) in signals.items()
    }
    return {topic: (names, parts) for topic, (names, parts) in known.items() if parts}


def start_stamp(content: Content) -> int:
    """Time in the MCAP file of the run's time 0, in [ns].

    Args:
        content: The exported data.
    """
    try:
        start = int(Decimal(str(content.analysis.run.meta.get("start", 0))) * NANOSECONDS)
    except (InvalidOperation, ValueError, OverflowError):
        start = 0
    first = round(float(content.analysis.run.time[0]) * NANOSECONDS)
    return max(start if start < LATEST else 0, -first)


def _topics(content: Content) -> dict[str, dict[str, Any]]:
    """JSON properties of the messages of each topic."""
    noise = {"time": NUMBER, "simplified": NUMBER}
    topics: dict[str, dict[str, Any]] = {
        "/noise": noise if content.extended is None else noise | {"extended": NUMBER},
        "/level": {"level": NUMBER},
    }
    if content.analysis.labels is not None:
        scores = dict.fromkeys(content.analysis.labels.classes, NUMBER)
        parts = {"failure": NUMBER, "scores": {"type": "object", "properties": scores}}
        if content.analysis.alarm is not None:
            parts["alarm"] = NUMBER
        topics |= {"/labels": SPAN | parts, "/class": {"label": TEXT}}
    if content.analysis.findings:
        numbers = {"level": {"type": "integer"}, "line": {"type": "integer"}}
        texts = dict.fromkeys(("message", "name", "file"), TEXT)
        topics["/findings"] = SPAN | {"score": NUMBER}
        topics["/log"] = {"timestamp": STAMP} | numbers | texts
    if content.analysis.run.blocks:
        topics["/annotations"] = SPAN
    return topics


def _messages(content: Content) -> list[Iterator[Message]]:
    """JSON messages of each topic in order of time."""
    found = content.analysis.findings
    parts = {
        "/noise": _noise(content),
        "/level": _levels(content),
        "/labels": _frames(content),
        "/class": _classes(content),
        "/findings": _spans(found, "score"),
        "/annotations": _spans(content.analysis.run.blocks),
        "/log": _lines(content),
    }
    return [_serialised(topic, rows, start_stamp(content)) for topic, rows in parts.items()]


def _serialised(topic: str, rows: "Iterator[Row]", zero: int) -> Iterator[Message]:
    for time, message in rows:
        yield _stamp(zero, time), topic, json.dumps(message, allow_nan=False).encode()


def _stamp(zero: int, time: float) -> int:
    return max(0, zero + round(time * NANOSECONDS))


Row = tuple[float, dict[str, Any]]
"""Time in [s], and a message."""


def _noise(content: Content) -> Iterator[Row]:
    names = ["time", "simplified"]
    columns = [content.time.tolist(), content.simplified.tolist()]
    if content.extended is not None:
        names.append("extended")
        columns.append(content.extended.tolist())
    for row in zip(*columns, strict=True):
        yield row[0], dict(zip(names, row, strict=True))


def _levels(content: Content) -> Iterator[Row]:
    """The level of the noise above 10 Hz, where it is known."""
    start, level = content.analysis.noise_level
    for time, each in zip(start.tolist(), level[:, 0].tolist(), strict=True):
        if not math.isnan(each):
            yield time, {"level": each}


def _frames(content: Content) -> Iterator[Row]:
    labels, alarm = content.analysis.labels, content.analysis.alarm
    if labels is None:
        return
    rows = zip(labels.start.tolist(), labels.stop.tolist(), labels.debounced.tolist(), strict=True)
    for (start, stop, label), scores in zip(rows, labels.scores.tolist(), strict=True):
        message = {"label": label, "start": start, "stop": stop}
        message |= {} if alarm is None else {"alarm": alarm}
        each = dict(zip(labels.classes, scores, strict=True))
        failure = 1.0 - each["ok"]
        yield (start + stop) / 2, message | {"failure": failure, "scores": each}


def _classes(content: Content) -> Iterator[Row]:
    """The class where it changes, and none where frames end."""
    lane, end = content.analysis.lane, None
    for start, stop, label in lane:
        if end is not None and start > end:
            yield end, {"label": ""}
        yield start, {"label": label}
        end = stop
    if end is not None:
        yield end, {"label": ""}


def _spans(spans: Any, *more: str) -> Iterator[Row]:
    for each in spans:
        yield each.start, {name: getattr(each, name) for name in ("label", "start", "stop", *more)}


def _lines(content: Content) -> Iterator[Row]:
    """A ``foxglove.Log`` for each finding."""
    for each in content.analysis.findings:
        sec, nsec = divmod(_stamp(start_stamp(content), each.start), NANOSECONDS)
        yield (
            each.start,
            {
                "timestamp": {"sec": sec, "nsec": nsec},
                "level": WARNING,
                "line": 0,
                "message": f"{each.label} from {each.start:.2f} s to {each.stop:.2f} s",
                "name": "noise-inspector",
                "file": "",
            },
        )


def _states(
    content: Content, topic: str, names: tuple[str, ...], parts: dict[str, Array], ros: Any
) -> Iterator[Message]:
    """A JointState for each sample."""
    state, header, time = (
        ros.types[kind]
        for kind in (JOINT_STATE, "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    )
    columns = {name: parts.get(name) for name in ("position", "velocity", "effort")}
    zero, none = start_stamp(content), np.zeros(0)
    for sample, at in enumerate(content.time.tolist()):
        stamp = _stamp(zero, at)
        sec, nanosec = divmod(stamp, NANOSECONDS)
        message = state(
            header=header(stamp=time(sec=sec, nanosec=nanosec), frame_id=""),
            name=list(names),
            **{name: none if rows is None else rows[sample] for name, rows in columns.items()},
        )
        yield stamp, topic, ros.serialize_cdr(message, JOINT_STATE)
