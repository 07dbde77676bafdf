"""The tables of a page about a run: facts, findings, links, joints."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from inspector.inspection import Inspection
from inspector.linknoise import vibrating
from inspector.report import ORIGIN, note, origin
from noisemodel.noise import REFERENCE_POWER, decibel
from noisemodel.types import Array

MOST = 20
"""Links and joints that are listed, the loudest first."""


@dataclass(frozen=True)
class Table:
    """A table with a title.

    Attributes:
        title: Empty without one.
        head: Names of the columns; all empty without a head.
        rows: Cells of each row.
        numbers: Columns that hold numbers.
        note: A sentence below the table; empty without one.
    """

    title: str
    head: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    numbers: tuple[int, ...] = ()
    note: str = ""


def facts(inspection: Inspection) -> Table:
    """List what the run is."""
    run = inspection.run
    rows = [
        ("robot", run.robot or "not named"),
        ("duration", f"{run.duration:.2f} s at {run.rate:g} Hz"),
        ("joints", str(len(run.joint_names))),
        ("model", inspection.model or "none"),
        *((key, _told(run.meta[key])) for key in ("scenario", "seed", "source") if key in run.meta),
    ]
    return Table("", ("", ""), rows)


def _told(value: object) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)


def found(inspection: Inspection) -> Iterator[Table]:
    """List findings and annotated blocks, those that there are."""
    said = note(inspection)
    if inspection.events:
        rows = [
            (
                event.label,
                f"{event.start:.2f}",
                f"{event.stop:.2f}",
                f"{event.score:.2f}",
                *_plain(origin(inspection, event)),
            )
            for event in inspection.events
        ]
        head = ("class", "from [s]", "to [s]", "score", *ORIGIN)
        yield Table("Findings", head, rows, (1, 2, 3), said)
    if inspection.run.blocks:
        annotated = [
            (
                block.label,
                f"{block.start:.2f}",
                f"{block.stop:.2f}",
                *_plain(origin(inspection, block)),
            )
            for block in inspection.run.blocks
        ]
        said = "" if inspection.events else said
        yield Table("Annotated", ("class", "from [s]", "to [s]", *ORIGIN), annotated, (1, 2), said)


def _plain(cells: tuple[str, ...]) -> tuple[str, ...]:
    """Leave Markdown's marks out."""
    return tuple(cell.replace("`", "") for cell in cells)


def parts(inspection: Inspection) -> Iterator[Table]:
    """List links and joints by what vibrates in them."""
    links = inspection.links
    if links is not None:
        peaks = links.vibration.max(axis=0, initial=0.0)
        levels = decibel(np.maximum(peaks, REFERENCE_POWER) / REFERENCE_POWER)
        when = links.time[links.vibration.argmax(axis=0)]
        yield _ranked(
            "Links",
            ("link", "share", "peak [dB re 1 pW]", "at [s]"),
            links.links,
            links.vibration.sum(axis=0),
            [(f"{level:.1f}", f"{time:.2f}") for level, time in zip(levels, when, strict=True)],
            "Sound power of the measured motion above 10 Hz, normal to the surface.",
        )
    run = inspection.run
    fast = vibrating(run.velocity.astype(np.float64), run.mask, run.rate)
    power = np.square(fast)
    peaks, when = np.abs(fast).max(axis=0), run.time[power.argmax(axis=0)]
    yield _ranked(
        "Joints",
        ("joint", "share", "rms [rad/s]", "peak [rad/s]", "at [s]"),
        run.joint_names,
        power.sum(axis=0),
        [
            (f"{rms:.3g}", f"{peak:.3g}", f"{time:.3f}")
            for rms, peak, time in zip(np.sqrt(power.mean(axis=0)), peaks, when, strict=True)
        ],
        "Measured velocity above 10 Hz; of joints that slide in [m/s].",
    )


def _ranked(
    title: str,
    head: tuple[str, ...],
    names: Sequence[str],
    power: Array,
    facts: Sequence[tuple[str, ...]],
    note: str,
) -> Table:
    """Order parts by their power, and say how many are left out."""
    share = power / (power.sum() or 1.0)
    order = np.argsort(-power, kind="stable")[:MOST]
    rows = [(names[i], f"{share[i]:.1%}", *facts[i]) for i in order]
    left = len(names) - len(order)
    note = f"{note} {left} quieter ones are left out." if left else note
    return Table(title, head, rows, tuple(range(1, len(head))), note)
