"""Comparisons of noise models as a rerun recording: one above the other, on one time axis."""

import hashlib
from pathlib import Path

import numpy as np
import rerun as rr
from rerun.blueprint import Blueprint

from inspector import colors
from inspector.recording import series, unstable
from inspector.recording.spectrogram import TOP_HZ, log_bands
from inspector.recording.stream import writing
from inspector.recording.unstable import Part
from inspector.spectrogram import spectrogram
from noisemodel import Comparisons, RobotComparison
from noisemodel.links import vibrating
from noisemodel.noise import decibel
from noisemodel.types import Array

STEP = 0.01
"""Time over which a level is taken, in [s]."""
FLOOR_DB = -60.0
"""Levels below this are drawn at it, in [dB]."""
RANGE_DB = (-25.0, 20.0)
"""What is drawn: the same for all, so that heights compare, in [dB]."""


def write(found: Comparisons, path: Path, *, overwrite: bool = False) -> None:
    """Write comparisons as one recording, whole or not at all.

    Args:
        found: One comparison or more.
        path: The file to write, by convention ``*.rrd``.
        overwrite: Whether a file that exists may be replaced.

    Raises:
        OutputError: If the file exists or cannot be written.
    """
    text = str(found)
    # The same comparison has the same id: opened again, it replaces itself in the viewer.
    identity = hashlib.sha256("\n".join([text, *(one.name for one in found)]).encode())
    with writing(path, identity.hexdigest(), overwrite=overwrite) as recording:
        recording.send_blueprint(layout(found))
        for one in found:
            _log(recording, one)
        document = rr.TextDocument(f"```\n{text}\n```", media_type="text/markdown")
        recording.log("/report", document, static=True)
        recording.send_recording_name(f"noise models: {', '.join(one.name for one in found)}")


def levels(one: RobotComparison, pressure: Array) -> tuple[Array, Array]:
    """Level of each estimate every 10 ms, relative to its own root mean square.

    Args:
        one: The comparison.
        pressure: Its pressures, or a part of them, shape (kinds, samples).

    Returns:
        Centres of the steps, shape (steps,), in [s], and levels, shape (steps, kinds), in [dB].
    """
    size = max(1, round(STEP * one.rate))
    firsts = np.arange(0, len(one.time), size)
    counts = np.diff(np.append(firsts, len(one.time)))
    power = np.add.reduceat(pressure**2, firsts, axis=1) / counts
    mean = np.mean(pressure**2, axis=1)
    level = decibel(power.T / np.where(mean > 0.0, mean, 1.0))
    return one.time[firsts] + counts / 2 / one.rate, np.maximum(level, FLOOR_DB)


def layout(found: Comparisons) -> Blueprint:
    """Lay out a recording: one tab per robot, in it events, levels and spectrograms.

    Args:
        found: The comparisons.

    Returns:
        The blueprint; all time axes are linked.
    """
    report = unstable.text("Table", "/report")
    return unstable.blueprint(unstable.tabs(*map(_robot, found), report), series.TIMELINE)


def _log(recording: rr.RecordingStream, one: RobotComparison) -> None:
    whole = np.ones(len(one.time), dtype=bool)
    parts = {
        "vibration": vibrating(one.pressure.T, whole, one.rate).T,
        "level": one.pressure,
    }
    for part, pressure in parts.items():
        time, level = levels(one, pressure)
        for index, color in enumerate(colors.of_series(len(one.kinds))):
            kind = one.kinds[index]
            path = f"{_root(one)}/{part}/{kind}"
            series.log_lines(
                recording, path, time, level[:, [index]], names=[kind], colours=[color]
            )
    for kind, pressure in zip(one.kinds, one.pressure, strict=True):
        spectrum = spectrogram(pressure, one.rate, start=float(one.time[0]), valid=whole)
        log_bands(recording, f"{_root(one)}/spectrogram/{kind}", spectrum)
    labels = tuple(dict.fromkeys(event.label for event in one.events))
    states = dict(zip(labels, colors.of_series(len(labels)), strict=True))
    stretches = [(event.start, event.stop, event.label) for event in one.events]
    series.log_lane(recording, f"{_root(one)}/events", stretches, states)


def _robot(one: RobotComparison) -> Part:
    parts = {"vibration": "above 10 Hz", "level": "whole motion"}
    levels = unstable.tabs(*(_lines(one, part, name) for part, name in parts.items()))
    spectrograms = unstable.tabs(*(_spectrogram(one, kind) for kind in one.kinds))
    lane = unstable.lanes("Events", f"{_root(one)}/events")
    height = 1.2 * len(one.kinds)
    return unstable.above((lane, 1.0), (levels, height), (spectrograms, 3.0), name=one.name)


def _lines(one: RobotComparison, part: str, name: str) -> Part:
    plots = [
        unstable.plot(
            f"{kind} [dB re its own rms]", f"{_root(one)}/{part}/{kind}", between=RANGE_DB
        )
        for kind in one.kinds
    ]
    return unstable.above(*((plot, 1.0) for plot in plots), name=name)


def _spectrogram(one: RobotComparison, kind: str) -> Part:
    top = min(TOP_HZ, one.rate / 2)
    origin = f"{_root(one)}/spectrogram/{kind}"
    return unstable.plot(f"{kind}, 0-{top:.0f} Hz", origin, between=(0.0, top), fixed=True)


def _root(one: RobotComparison) -> str:
    return f"/{rr.escape_entity_path_part(one.name)}"
