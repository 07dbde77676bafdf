"""Files for other tools: noise, labels and scores as MCAP, CSV and Parquet; label files.

/joint_states and /joint_states/desired of an MCAP are ROS 2 JointStates, a message for each sample,
which `inspector import` reads as well. The other topics are JSON: /noise for each sample, /level
each 50 ms, /labels at the middle of each frame, /findings and /annotations at their start. Times
are the run's, added to the first stamp in its ``meta``. MCAP has no negative times: a run that
starts before 0 is shifted.

Label files hold annotated blocks, read and written, or findings, written, in the format of their
suffix:

- *noisytest*: TOML with ``chunk_ranges`` and ``chunk_labels`` in a table ``data``; a stop of -1 is
  the end of the recording, so that no other label may stop there;
- *csv*: columns start, stop and label, in any order; findings also have a score;
- *audacity*: a line for each label, with start, stop and text between tabs.

Their times are the run's, in [s]; numbers are written with all digits.
"""

import csv
import heapq
import io
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from decimal import Decimal, InvalidOperation
from itertools import repeat
from math import inf, isfinite, isnan
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import noiseclassifier as nc
import noisemodel as nm
from inspector.analysis import Analysis, analyse, estimate, robot_known
from inspector.audit import summary
from inspector.errors import InspectorError, OptionError
from inspector.library import Library
from inspector.text import cell, counted, uncell
from noiseclassifier import Event
from noiseclassifier.errors import AnnotationError
from noiseclassifier.jsontext import text_of
from noiseclassifier.noisytest import END, parse_annotations
from noisemodel import Block, Run
from noisemodel.files import refuse_existing, replacing, write_whole
from noisemodel.types import Array, Real


@dataclass(frozen=True, eq=False)
class Content:
    """The noise and the analysis of a run; gaps are left out."""

    analysis: Analysis
    time: Array  # of each sample, shape (samples,), in [s]
    simplified: Array  # simplified noise, shape (samples,), in [rad/s]
    extended: Array | None  # sound power of all links, shape (samples,), in [W]
    kind: str  # of the extended noise
    remarks: tuple[str, ...]  # what is missing and why, a sentence each

    def __str__(self) -> str:
        """The content in a line."""
        labels = self.analysis.labels
        parts = [
            f"{len(self.time)} samples of noise{'' if self.extended is None else ' of two kinds'}",
            counted(0 if labels is None else len(labels), "frame"),
            counted(len(self.analysis.findings), "finding"),
            counted(len(self.analysis.run.blocks), "annotated block"),
        ]
        return ", ".join(parts)


def collect(run: nm.Run, library: Library, *, kind: str = "normal") -> Content:
    """Analyse a run and compute its noise."""
    if kind not in nm.KINDS:
        raise nm.UnknownKindError(kind, tuple(nm.KINDS))
    analysis = analyse(run, library)
    run, extended = analysis.run, None
    missing = [*analysis.notes, *summary(analysis.audit, classes=False)]
    if analysis.labels is None:
        missing.append(f"No labels: {analysis.reason}.")
    if not robot_known(run) or run.position is None:
        missing.append("No extended noise: that takes a robot and positions.")
    else:
        try:
            extended = estimate(run, kind).power.sum(axis=1)[run.mask]
        except nm.GeometryError as error:
            missing.append(f"No extended noise: {error}.")
    simplified = analysis.noise[run.mask]
    return Content(analysis, run.time[run.mask], simplified, extended, kind, tuple(missing))


# Units of the columns that have one.
UNITS = {"time": "s", "simplified": "rad/s", "extended": "W", "frame_start": "s", "frame_stop": "s"}


def arrow_table(content: Content) -> Any:
    """Exported data as an Arrow table.

    Columns are time, simplified, extended (with a robot), annotated (with blocks), and with labels
    finding, and frame_start, frame_stop, label and a score_<class> each: from the frame whose
    middle is nearest, and null before the first and after the last frame's share.
    """
    import pyarrow as pa

    time, labels = content.time, content.analysis.labels
    found: dict[str, Any] = {"time": time, "simplified": content.simplified}
    if content.extended is not None:
        found["extended"] = content.extended
    blocks = content.analysis.run.blocks
    spans: dict[str, Sequence[Block | Event]] = {"annotated": blocks} if blocks else {}
    spans |= {} if labels is None else {"finding": content.analysis.findings}
    for name, each in spans.items():
        words: list[str | None] = [None] * len(time)
        for span in each:
            first, last = np.searchsorted(time, (span.start, span.stop))
            words[first:last] = [span.label] * int(last - first)
        found[name] = pa.array(words, pa.string())
    if labels is not None:
        middles = (labels.start + labels.stop) / 2
        steps = np.diff(middles) if len(middles) > 1 else labels.stop - labels.start
        nearest = np.searchsorted((middles[1:] + middles[:-1]) / 2, time)
        outside = np.abs(time - middles[nearest]) > np.median(steps) / 2 + 1e-6
        scores = zip(labels.classes, labels.scores.T, strict=True)
        framed = {
            "frame_start": labels.start,
            "frame_stop": labels.stop,
            "label": labels.debounced.astype(object),
            **{f"score_{name}": each for name, each in scores},
        }
        found |= {name: pa.array(each[nearest], mask=outside) for name, each in framed.items()}
    columns = {name: pa.array(values) for name, values in found.items()}
    units = {name: {"unit": unit} for name, unit in UNITS.items()}
    fields = [pa.field(name, c.type, metadata=units.get(name)) for name, c in columns.items()]
    about = {"format": "noise-export/1", "model": content.analysis.model, "extended": content.kind}
    return pa.table(list(columns.values()), pa.schema(fields, metadata=about))


def write_parquet(content: Content, path: Path) -> None:
    """Write the table as Parquet."""
    from pyarrow import parquet

    with path.open("wb") as file:  # its own errors lack the number
        parquet.write_table(arrow_table(content), file, compression="zstd")


def write_csv(content: Content, path: Path) -> None:
    """Write the table as CSV, numbers with all digits."""
    import pyarrow.csv

    table = arrow_table(content)
    for place, name in enumerate(table.column_names):
        if name in ("label", "annotated", "finding"):
            cells = [None if each is None else cell(each) for each in table[name].to_pylist()]
            table = table.set_column(place, name, [cells])
    with path.open("w", newline="", encoding="utf-8") as file:
        # Arrow would quote all names, which not every reader of CSV accepts.
        csv.writer(file, lineterminator="\n").writerow(table.column_names)
    with path.open("ab") as stream:
        pyarrow.csv.write_csv(table, stream, pyarrow.csv.WriteOptions(include_header=False))


JOINT_STATE = "sensor_msgs/msg/JointState"
MEASURED, DESIRED = "/joint_states", "/joint_states/desired"
NUMBER, TEXT = {"type": "number"}, {"type": "string"}
SPAN = {"label": TEXT, "start": NUMBER, "stop": NUMBER}
NANOSECONDS = 10**9
LATEST = 2**63  # stamps from here on are not valid, in [ns]
Row = tuple[float, dict[str, Any]]  # time in [s], and the fields of a message


def write_mcap(content: Content, path: Path) -> None:
    """Write noise, labels, findings and annotations."""
    try:
        from mcap.writer import Writer
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        advice = "pip install 'noise-inspector[mcap]'"
        raise InspectorError(f"MCAP needs the extra `mcap` ({error}); {advice}") from error
    ros, zero = get_typestore(Stores.ROS2_HUMBLE), _start_stamp(content)
    kinds = (JOINT_STATE, "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    state, header, clock = (ros.types[kind] for kind in kinds)
    run, topics = content.analysis.run, _topics(content)
    desired = run.position_desired, run.velocity_desired, None
    joints = {MEASURED: _states(content, run.joint_names, run.position, run.velocity, run.effort)}
    if any(each is not None for each in desired):
        joints[DESIRED] = _states(content, run.desired_joint_names, *desired)

    def stamp_of(sent: tuple[Row, str]) -> int:
        """Time in the file of a message with its topic, in [ns]."""
        return max(0, zero + round(sent[0][0] * NANOSECONDS))

    with path.open("wb") as stream:
        writer: Any = Writer(stream)
        writer.start(profile="ros2", library="noise-inspector")
        definition, _ = ros.generate_msgdef(JOINT_STATE, ros_version=2)
        schema = writer.register_schema(JOINT_STATE, "ros2msg", definition.encode())
        channels = {topic: writer.register_channel(topic, "cdr", schema) for topic in joints}
        for topic, (fields, _) in topics.items():
            data = json.dumps({"type": "object", "properties": fields}).encode()
            schema = writer.register_schema(f"noise.{topic[1:]}", "jsonschema", data)
            channels[topic] = writer.register_channel(topic, "json", schema)
        messages = {topic: rows for topic, (_, rows) in topics.items()} | joints
        rows = (zip(each, repeat(topic)) for topic, each in messages.items())
        for sent in heapq.merge(*rows, key=stamp_of):
            (_, message), topic = sent
            stamp = stamp_of(sent)
            if topic in joints:
                sec, nanosec = divmod(stamp, NANOSECONDS)
                head = header(stamp=clock(sec=sec, nanosec=nanosec), frame_id="")
                data = bytes(ros.serialize_cdr(state(header=head, **message), JOINT_STATE))
            else:
                data = json.dumps(message, allow_nan=False).encode()
            writer.add_message(channels[topic], log_time=stamp, data=data, publish_time=stamp)
        about = {"model": content.analysis.model, "extended": content.kind, "time": "s"}
        writer.add_metadata("noise-inspector", about)
        writer.finish()


def _states(content: Content, names: Sequence[str], *signals: Real | None) -> Iterator[Row]:
    """A JointState for each sample, of the positions, velocities and efforts that there are."""
    mask, none, joints = content.analysis.run.mask, np.zeros((len(content.time), 0)), list(names)
    columns = [
        none if each is None else np.ascontiguousarray(each[mask], float) for each in signals
    ]
    for time, position, velocity, effort in zip(content.time.tolist(), *columns, strict=True):
        yield time, {"name": joints, "position": position, "velocity": velocity, "effort": effort}


def _start_stamp(content: Content) -> int:
    """Time in the MCAP file of the run's time 0, in [ns]."""
    start = 0
    with suppress(InvalidOperation, ValueError, OverflowError):
        start = int(Decimal(str(content.analysis.run.meta.get("start", 0))) * NANOSECONDS)
    first = round(float(content.analysis.run.time[0]) * NANOSECONDS)
    return max(start if start < LATEST else 0, -first)


def _topics(content: Content) -> dict[str, tuple[dict[str, Any], Iterator[Row]]]:
    """JSON properties of the messages of each topic, and the messages in order of time."""
    analysis = content.analysis
    noise = {"time": content.time, "simplified": content.simplified}
    if content.extended is not None:
        noise["extended"] = content.extended
    samples = zip(*(each.tolist() for each in noise.values()), strict=True)
    (start, level), number = analysis.vibration_level, {"level": NUMBER}
    levels = zip(start.tolist(), level[:, 0].tolist(), strict=True)
    topics: dict[str, tuple[dict[str, Any], Iterator[Row]]] = {
        "/noise": (
            dict.fromkeys(noise, NUMBER),
            ((row[0], dict(zip(noise, row, strict=True))) for row in samples),
        ),
        "/level": (number, ((at, {"level": each}) for at, each in levels if not isnan(each))),
    }
    if analysis.labels is not None:
        scores = dict.fromkeys(analysis.labels.classes, NUMBER)
        parts = {"failure": NUMBER, "scores": {"type": "object", "properties": scores}}
        parts |= {} if analysis.alarm is None else {"alarm": NUMBER}
        topics["/labels"] = SPAN | parts, _frames(analysis.labels, analysis.alarm)
    if analysis.findings:
        topics["/findings"] = SPAN | {"score": NUMBER}, _spans(analysis.findings, "score")
    if analysis.run.blocks:
        topics["/annotations"] = SPAN, _spans(analysis.run.blocks)
    return topics


def _frames(labels: nc.Labels, alarm: float | None) -> Iterator[Row]:
    rows = zip(labels.start.tolist(), labels.stop.tolist(), labels.debounced.tolist(), strict=True)
    for (start, stop, label), scores in zip(rows, labels.scores.tolist(), strict=True):
        message = {"label": label, "start": start, "stop": stop}
        message |= {} if alarm is None else {"alarm": alarm}
        each = dict(zip(labels.classes, scores, strict=True))
        yield (start + stop) / 2, message | {"failure": 1.0 - each["ok"], "scores": each}


def _spans(spans: Any, *more: str) -> Iterator[Row]:
    for each in spans:
        yield each.start, {name: getattr(each, name) for name in ("label", "start", "stop", *more)}


# Writers by suffix.
WRITERS: dict[str, Callable[[Content, Path], None]] = {
    ".mcap": write_mcap,
    ".csv": write_csv,
    ".parquet": write_parquet,
}


def export(
    run: nm.Run, path: Path, library: Library, *, kind: str = "normal", overwrite: bool = False
) -> Content:
    """Write noise, labels and scores of a run to a file, ``.mcap``, ``.csv`` or ``.parquet``.

    Args:
        kind: Kind of the extended noise, see ``noisemodel.extended``.
    """
    write = WRITERS.get(path.suffix.lower())
    if write is None:
        known = ", ".join(WRITERS)
        raise OptionError(f"{path}: no format of exports has this suffix; there are {known}")
    refuse_existing(path, overwrite=overwrite)
    content = collect(run, library, kind=kind)
    with replacing(path, overwrite=overwrite) as temporary:
        write(content, temporary)
    return content


# --- label files

COLUMNS = ("start", "stop", "label")
Span = Block | Event
# A label of a file, to infinity if it lasts to the end of the run, and its place: "line 3".
Entry = tuple[Block, str]


def write_labels(spans: Sequence[Span], path: Path, *, overwrite: bool = False) -> None:
    """Write annotated blocks or findings to a file, in the format of its suffix."""
    write_whole(path, format_of(path).render(spans, path), overwrite=overwrite)


def read_labels(path: Path, run: Run) -> tuple[Block, ...]:
    """Annotated blocks of a run, read from a file and checked, in order of time."""
    chosen = format_of(path)
    try:
        return _checked(sorted(chosen.parse(text_of(path))), run)
    except OSError as error:
        raise InspectorError(f"{path}: cannot be read ({error.strerror})") from error
    except AnnotationError as error:
        where = error.where and f", {error.where}"
        raise InspectorError(f"{path}{where}: {error.problem}") from error
    except ValueError as error:
        raise InspectorError(f"{path}: not a file of labels: {error}") from error


def _checked(entries: Sequence[Entry], run: Run) -> tuple[Block, ...]:
    """The blocks of a run, which lie within it and overlap by a sample at most."""
    begin, last = float(run.time[0]), float(run.time[-1])
    step = (last - begin) / (len(run.time) - 1)
    earliest, latest = begin - step, last + 2 * step
    blocks = list[Block]()
    for block, where in entries:
        label = block.label
        if block.stop == inf:
            block = replace(block, stop=last + step)
        if not label or not label.isprintable():
            raise AnnotationError(f"{label!r} is empty or cannot be printed", where)
        if not earliest <= block.start < block.stop <= latest:
            of_run = f"is empty, or lies outside of the run, {earliest:g} s to {latest:g} s"
            lasts = f"{label!r} from {block.start:g} s to {block.stop:g} s"
            raise AnnotationError(f"{lasts} {of_run}", where)
        if blocks and block.start < blocks[-1].stop - step:
            stops = f"{blocks[-1].label!r} stops at {blocks[-1].stop:g} s"
            problem = f"blocks overlap: {label!r} starts at {block.start:g} s, before {stops}"
            raise AnnotationError(problem, where)
        blocks.append(block)
    return tuple(sorted(blocks))


def _time(text: str, where: str) -> float:
    """A finite time parsed from text, in [s]."""
    with suppress(ValueError):
        if isfinite(value := float(text)):
            return value
    raise AnnotationError(f"{text!r} is not a time in seconds", where)


def _render_audacity(spans: Sequence[Span], _path: Path) -> str:
    return "".join(f"{span.start!r}\t{span.stop!r}\t{span.label}\n" for span in spans)


def _parse_audacity(text: str) -> Iterator[Entry]:
    for row, line in enumerate(text.split("\n"), start=1):
        where, cells = f"line {row}", line.removesuffix("\r").split("\t", maxsplit=2)
        if cells == [""] or cells[0] == "\\":  # frequencies of a spectral selection
            continue
        if len(cells) != 3:
            expected = "expected start, stop and label between tabs"
            raise AnnotationError(f"{expected}, not {line[:80]!r}", where)
        start, stop, label = cells
        yield Block(_time(start, where), _time(stop, where), label), where


def _render_csv(spans: Sequence[Span], _path: Path) -> str:
    text = io.StringIO(newline="")
    scored = [span for span in spans if isinstance(span, Event)]
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow((*COLUMNS, "score") if scored else COLUMNS)
    for each in scored or spans:
        score = [repr(each.score)] if isinstance(each, Event) else []
        writer.writerow([repr(each.start), repr(each.stop), cell(each.label), *score])
    return text.getvalue()


def _parse_csv(text: str) -> Iterator[Entry]:
    rows = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        header = [name.strip().lower() for name in next(rows, [])]
        if missing := [name for name in COLUMNS if name not in header]:
            expected = f"expected {', '.join(COLUMNS)}"
            raise AnnotationError(f"there is no column {missing[0]!r}; {expected}", "line 1")
        for cells in rows:
            where = f"line {rows.line_num}"
            if cells and len(cells) != len(header):
                there = f"{len(cells)} cells where the header names {len(header)} columns"
                raise AnnotationError(there, where)
            if cells:
                start, stop, label = (cells[header.index(name)] for name in COLUMNS)
                yield Block(_time(start, where), _time(stop, where), uncell(label)), where
    except csv.Error as error:
        raise AnnotationError(f"not CSV ({error})", f"line {rows.line_num}") from error


def _render_noisytest(spans: Sequence[Span], path: Path) -> str:
    for span in spans:
        if span.stop == END:
            means = "the end of the recording in NoisyTest; use another format"
            raise InspectorError(f"{path}: label {span.label!r} stops at -1 s, {means}")
    # Both numbers of a range have a decimal point: NoisyTest's TOML reader takes no mixed ones.
    ranges = "".join(f"    [{float(each.start)!r}, {float(each.stop)!r}],\n" for each in spans)
    labels = "".join(f"    {json.dumps(each.label, ensure_ascii=False)},\n" for each in spans)
    return f"[data]\nchunk_ranges = [\n{ranges}]\nchunk_labels = [\n{labels}]\n"


def _parse_noisytest(text: str) -> Iterator[Entry]:
    for count, block in enumerate(parse_annotations(text), start=1):
        yield Block(*block), f"chunk {count}"


class Format(NamedTuple):
    """A format of label files: its name, what writes labels, and what reads them."""

    name: str
    render: Callable[[Sequence[Span], Path], str]
    parse: Callable[[str], Iterator[Entry]]


# All formats by suffix.
FORMATS = {
    ".toml": Format("noisytest", _render_noisytest, _parse_noisytest),
    ".csv": Format("csv", _render_csv, _parse_csv),
    ".txt": Format("audacity", _render_audacity, _parse_audacity),
}


def format_of(path: Path) -> Format:
    """Format of a file by its suffix."""
    if found := FORMATS.get(path.suffix.lower()):
        return found
    known = ", ".join(f"{suffix} ({each.name})" for suffix, each in FORMATS.items())
    raise OptionError(f"{path}: no format of labels has this suffix; there are {known}")
