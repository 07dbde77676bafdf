"""Export as MCAP with JSON messages, for Foxglove and PlotJuggler.

Topics: /noise for each sample, /labels at the middle of each frame, /findings and /annotations at
their start. Times are those of the run, added to the first stamp in its ``meta``. MCAP has no
negative times: a run that starts before 0 is shifted.
"""

import heapq
import json
from collections.abc import Iterator
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Any

from inspector.errors import InspectorError
from inspector.export.content import Content

NUMBER, TEXT = {"type": "number"}, {"type": "string"}
SPAN = {"label": TEXT, "start": NUMBER, "stop": NUMBER}
NANOSECONDS = 10**9
LATEST = 2**63
"""Stamps from here on are not valid, in [ns]."""

Message = tuple[int, str, dict[str, Any]]


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
    except ImportError as error:
        raise InspectorError(
            f"MCAP needs the extra `mcap` ({error}); pip install 'noise-inspector[mcap]'"
        ) from error
    with path.open("wb") as stream:
        writer: Any = Writer(stream)
        writer.start(profile="", library="noise-inspector")
        channels = {
            topic: writer.register_channel(
                topic=topic,
                message_encoding="json",
                schema_id=writer.register_schema(
                    name=f"noise.{topic[1:]}",
                    encoding="jsonschema",
                    data=json.dumps({"type": "object", "properties": fields}).encode(),
                ),
            )
            for topic, fields in _topics(content).items()
        }
        for stamp, topic, message in heapq.merge(*_messages(content), key=lambda each: each[0]):
            data = json.dumps(message, allow_nan=False).encode()
            writer.add_message(channels[topic], log_time=stamp, data=data, publish_time=stamp)
        writer.add_metadata(
            "noise-inspector",
            {"model": content.analysis.model, "extended": content.kind, "time": "s"},
        )
        writer.finish()


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
        "/noise": noise if content.extended is None else noise | {"extended": NUMBER}
    }
    if content.analysis.labels is not None:
        scores = dict.fromkeys(content.analysis.labels.classes, NUMBER)
        topics["/labels"] = SPAN | {"scores": {"type": "object", "properties": scores}}
    if content.analysis.findings:
        topics["/findings"] = SPAN | {"score": NUMBER}
    if content.analysis.run.blocks:
        topics["/annotations"] = SPAN
    return topics


def _messages(content: Content) -> Iterator[Iterator[Message]]:
    """Messages of each topic in order of time."""
    zero = start_stamp(content)

    def stamp(time: float) -> int:
        return max(0, zero + round(time * NANOSECONDS))

    def spans(topic: str, found: Any, *more: str) -> Iterator[Message]:
        for each in found:
            names = ("label", "start", "stop", *more)
            yield stamp(each.start), topic, {name: getattr(each, name) for name in names}

    yield _noise(content, stamp)
    yield _frames(content, stamp)
    yield spans("/findings", content.analysis.findings, "score")
    yield spans("/annotations", content.analysis.run.blocks)


def _noise(content: Content, stamp: Any) -> Iterator[Message]:
    names = ["time", "simplified"]
    columns = [content.time.tolist(), content.simplified.tolist()]
    if content.extended is not None:
        names.append("extended")
        columns.append(content.extended.tolist())
    for row in zip(*columns, strict=True):
        yield stamp(row[0]), "/noise", dict(zip(names, row, strict=True))


def _frames(content: Content, stamp: Any) -> Iterator[Message]:
    if content.analysis.labels is None:
        return
    labels = content.analysis.labels
    rows = zip(labels.start.tolist(), labels.stop.tolist(), labels.debounced.tolist(), strict=True)
    for (start, stop, label), scores in zip(rows, labels.scores.tolist(), strict=True):
        message = {"label": label, "start": start, "stop": stop}
        each = dict(zip(labels.classes, scores, strict=True))
        yield stamp((start + stop) / 2), "/labels", message | {"scores": each}
