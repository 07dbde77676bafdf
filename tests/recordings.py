"""Read recordings back, for the tests."""

import re
from pathlib import Path

import numpy as np
import pyarrow as pa
import rerun as rr
from rerun.chunk import RrdReader

from noiseclassifier import Labels
from noisemodel import Block, Run

rr.set_strict_mode(True)  # wrong arguments are errors
CLASSES = ("ok", "impact", "highaccelerations", "oscillations")
LINE = {"Scalars:scalars", "SeriesLines:names", "SeriesLines:colors", "SeriesLines:widths"}
LINE |= {"SeriesLines:aggregation_policy"}
POINTS = {"Scalars:scalars"} | {
    f"SeriesPoints:{part}" for part in ("names", "colors", "markers", "marker_sizes")
}
BAND = {f"Measurements:{part}" for part in ("names", "colors", "widths", "values", "variances")}
LABELS = {f"Points2D:{part}" for part in ("positions", "labels", "colors", "radii", "show_labels")}
STRIP = {f"LineStrips2D:{part}" for part in ("strips", "colors", "radii")}
MOTION = {f"Transform3D:{part}" for part in ("translation", "quaternion")}
MOTION |= {"Transform3D:parent_frame", "Transform3D:child_frame"}
MESH = {f"Asset3D:{part}" for part in ("blob", "media_type", "albedo_factor")}
MESH |= {"CoordinateFrame:frame"}
# The components of each entity that every recording has.
EVERY = {
    r"/span": LINE,
    r"/verdict/band": STRIP,
    r"/verdict/words": LABELS,
    r"/events": {"TextLog:text", "TextLog:level", "TextLog:color"},
    r"/report": {"TextDocument:text", "TextDocument:media_type"},
}


def panda(scale: float = 1.0, *, seconds: float = 3.0, rate: float = 5000.0, **changes) -> Run:
    """A Panda that swings, faster by ``scale``, and rattles at 120 Hz from 0.5 s to 1 s."""
    time = np.arange(round(seconds * rate)) / rate
    phase = 2 * np.pi * np.linspace(0.2, 0.5, 7) * time[:, None]
    rattle = 0.1 * np.sin(2 * np.pi * 120 * time) * ((time >= 0.5) & (time < 1.0))
    fields = {
        "time": time,
        "velocity": scale * (np.cos(phase) + rattle[:, None]),
        "position": 0.1 * np.sin(phase),
        "joint_names": tuple(f"panda_joint{i}" for i in range(1, 8)),
        "robot": "panda",
        "blocks": (Block(0.2, 1.0, "ok"), Block(1.0, 1.5, "oscillations")),
    }
    return Run(**(fields | changes))


def read(path: Path, entity: str, component: str):
    """Read a component back in order of time: times in [s] (None if static), values."""
    rows = []
    for chunk in RrdReader(path).store().stream().filter(content=entity, components=component):
        batch = chunk.to_record_batch()
        if component in batch.schema.names:
            values = batch.column(component).to_pylist()
            times = [None] * len(values)
            if not chunk.is_static:
                times = batch.column("time").cast(pa.int64()).to_pylist()
            rows += zip(times, values, strict=True)
    timed = sorted((row for row in rows if row[0] is not None), key=lambda row: row[0])
    if not timed:
        return None, [value for _, value in rows]
    return np.array([time for time, _ in timed]) / 1e9, [value for _, value in timed]


def motion(path: Path, frame: str, origin: str = "/robot"):
    """Times in [s] at which a frame of a robot moves, and its poses there, shape (samples, 7)."""
    parts = ("child_frame", "translation", "quaternion")
    (time, frames), (_, places), (_, turns) = (
        read(path, f"{origin}/motion", f"Transform3D:{part}") for part in parts
    )
    own = [each[0] == frame for each in frames]
    return time[own], np.hstack((np.array(places)[own, 0], np.array(turns)[own, 0]))


def entities(path: Path):
    """Paths of all entities."""
    return set(RrdReader(path).store().schema().entity_paths())


def layout(path: Path):
    """What the layout of a recording says: entity, component, and value of each."""
    reader = RrdReader(path)
    (blueprint,) = reader.blueprints()
    for chunk in reader.store(store=blueprint).stream():
        batch = chunk.to_record_batch()
        for name in (each for each in batch.schema.names if ":" in each):
            yield str(chunk.entity_path), name, batch.column(name).to_pylist()[0]


def settings(path: Path, prefix: str):
    """Values of the layout whose component begins so, by what follows."""
    return {
        name.removeprefix(prefix): value
        for _, name, value in layout(path)
        if name.startswith(prefix)
    }


def properties(path: Path):
    """What a recording says of its runs."""
    found = {}
    for chunk in RrdReader(path).stream():
        if chunk.entity_path == "/__properties/inspector":
            batch = chunk.to_record_batch()
            found |= {name: batch.column(name).to_pylist()[0] for name in batch.schema.names}
    return found


def stretches(path: Path, entity: str):
    """Starts and stops of what is shaded, in [s]."""
    time, values = read(path, entity, "Measurements:values")
    known = np.array([np.isfinite(value).all() for value in values])
    return time[known].reshape(-1, 2).round(6).tolist()


def check_columns(path: Path, columns: dict[str, set[str]]) -> None:
    """Check that all entities match a pattern, here or in ``EVERY``, and each pattern an entity."""
    columns = EVERY | columns
    schema = RrdReader(path).store().schema()
    found = {}
    for column in schema.component_columns():
        found.setdefault(column.entity_path, set()).add(column.component)
    seen = set()
    for entity, components in found.items():
        if re.fullmatch(r"/|/__properties.*", entity):
            continue
        patterns = [pattern for pattern in columns if re.fullmatch(pattern, entity)]
        assert patterns, entity
        assert components == columns[patterns[0]], entity
        seen.add(patterns[0])
    assert seen == set(columns)
    assert {column.name for column in schema.index_columns()} == {"time"}


def some_labels(failing):
    """Labels of frames of 0.4 s, of which a slice is impacts."""
    start = np.arange(0, 2.6, 0.1)
    label = np.array(["ok"] * len(start), dtype="U20")
    label[failing] = "impact"
    scores = np.tile([0.7, 0.1, 0.1, 0.1], (len(start), 1))
    return Labels(start=start, stop=start + 0.4, label=label, scores=scores, classes=CLASSES)
