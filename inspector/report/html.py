"""A page about a run that needs no viewer: one HTML file without links to others."""

import re
from base64 import b64encode
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from inspector.analysis import Analysis
from inspector.export.sound import clip, worst_time
from inspector.reference.judging import Comparison
from inspector.report.findings import LOCALISATION, excused, localised, matched, note, spoken
from inspector.report.picture import picture, require
from inspector.verdict import Verdict
from noisemodel.files import replacing
from noisemodel.noise import REFERENCE_POWER, decibel, vibrating_pieces
from noisemodel.types import Array

AUDIBLE = "Audible are the joints' velocities above 20 Hz; their powers are added."
POLICY = "default-src 'none'; img-src data:; media-src data:; style-src 'unsafe-inline'"
"""Policy for browsers: nothing is fetched, whatever a run's names are."""
STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, sans-serif; color: #1b1f24; max-width: 62rem;
  margin: 2rem auto; padding: 0 1rem; }
h1 { margin-bottom: 0; overflow-wrap: anywhere; }
h2 { margin: 2.2rem 0 .6rem; font-size: 1.15rem; }
.verdict { font-size: 1.25rem; font-weight: 600; margin: .2rem 0 1.2rem; }
.note { color: #57606a; font-size: .9rem; margin: .3rem 0; }
.wide { overflow-x: auto; }
img { width: 100%; height: auto; }
audio { width: 100%; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: .25rem 1.2rem .25rem 0; border-bottom: 1px solid #d0d7de; }
th { font-weight: 600; }
td.number, th.number { text-align: right; }
li { margin: .2rem 0; }
"""
MOST = 20
"""Links and joints that are listed, the loudest first."""


@dataclass(frozen=True)
class Table:
    """A table: title, head and the note below may be empty; `numbers` are columns of numbers."""

    title: str
    head: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    numbers: tuple[int, ...] = ()
    note: str = ""


def write(analysis: Analysis, path: Path, *, overwrite: bool = False, **shown: Any) -> None:
    """Write the page of an inspected run, whole or not at all; see `page`."""
    require("a report")
    text = page(analysis, **shown)
    with replacing(path, overwrite=overwrite) as temporary:
        temporary.write_text(text, encoding="utf-8")


def page(
    analysis: Analysis,
    *,
    audit: str = "",
    verdict: Verdict | None = None,
    beside: Comparison | None = None,
    floor: float | None = None,
) -> str:
    """Write the page of an inspected run.

    Args:
        audit: What the log can show, a line each; may be empty.
        verdict: The verdict beside a reference; None without.
        beside: How the run compares with the reference; None without.
        floor: Level of the darkest colour of spectrograms, in [dB re 1 rad/s]; by the run if None.
    """
    html, body = document(f"{analysis.name}: {spoken(analysis.headline)}", STYLE, POLICY)
    add_text(body, "h1", analysis.name)
    add_text(body, "p", spoken(analysis.headline), "verdict")
    if verdict is not None and verdict.beside is not None:
        add_text(body, "p", f"Reference: {verdict.beside.path}, {verdict.beside.words}.", "note")
    for table in (facts(analysis), *found(analysis, verdict)):
        _add_table(body, table)
    if verdict is not None:
        _add_list(body, "Missing", [str(each) for each in verdict.missing])
        _add_list(body, "Does not count", excused(verdict))
    add_text(body, "h2", "Over time")
    image = f"data:image/png;base64,{_encoded(picture(analysis, beside, floor=floor))}"
    ET.SubElement(body, "img", src=image, alt=_described(analysis, beside))
    _add_sound(body, analysis)
    for table in parts(analysis):
        _add_table(body, table)
    _add_list(body, "What the log can show", audit.splitlines())
    _add_list(body, "Remarks", [spoken(remark) for remark in analysis.remarks])
    made = (
        f"Made by noise-inspector of an input with SHA-256 {analysis.sha256}. The noise is an"
        " estimate from the velocities of rigid links: compare it, do not quote it."
    )
    add_text(body, "p", made, "note")
    return written(html)


# --- elements of pages


def document(title: str, style: str, policy: str) -> tuple[ET.Element, ET.Element]:
    """An HTML page without content, and its body."""
    html = ET.Element("html", lang="en")
    head = ET.SubElement(html, "head")
    ET.SubElement(head, "meta", charset="utf-8")
    ET.SubElement(head, "meta", {"http-equiv": "Content-Security-Policy", "content": policy})
    ET.SubElement(head, "meta", name="viewport", content="width=device-width")
    add_text(head, "title", title)
    add_text(head, "style", style)
    return html, ET.SubElement(html, "body")


def add_text(parent: ET.Element, tag: str, text: str, kind: str = "", **more: str) -> ET.Element:
    """Add an element with a text, of a class in the style, to another one."""
    element = ET.SubElement(parent, tag, {"class": kind} if kind else {}, **more)
    # HTML has no way to write these characters.
    element.text = re.sub(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]", "\ufffd", text)
    return element


def written(html: ET.Element) -> str:
    """A page as text."""
    return f"<!DOCTYPE html>\n{ET.tostring(html, encoding='unicode', method='html')}\n"


def _add_table(body: ET.Element, table: Table) -> None:
    if table.title:
        add_text(body, "h2", table.title)
    frame = ET.SubElement(ET.SubElement(body, "div", {"class": "wide"}), "table")

    def add_row(parent: ET.Element, tag: str, cells: Sequence[str]) -> None:
        row = ET.SubElement(parent, "tr")
        for place, cell in enumerate(cells):
            add_text(row, tag, cell, "number" if place in table.numbers else "")

    if any(table.head):
        add_row(ET.SubElement(frame, "thead"), "th", table.head)
    rows = ET.SubElement(frame, "tbody")
    for cells in table.rows:
        add_row(rows, "td", cells)
    if table.note:
        add_text(body, "p", table.note, "note")


def _add_list(body: ET.Element, title: str, lines: Sequence[str]) -> None:
    if lines:
        add_text(body, "h2", title)
        items = ET.SubElement(body, "ul")
        for line in lines:
            add_text(items, "li", line.strip())


def _add_sound(body: ET.Element, analysis: Analysis) -> None:
    sound = clip(analysis.run, around=worst_time(analysis))
    add_text(body, "h2", "Sound")
    if sound is None:
        add_text(body, "p", "The log's rate is too low for audible frequencies.", "note")
        return
    source = f"data:audio/wav;base64,{_encoded(sound.data)}"
    ET.SubElement(body, "audio", controls="controls", src=source)
    span = f"From {sound.start:.2f} s to {sound.stop:.2f} s: {sound.description}."
    add_text(body, "p", f"{span} {AUDIBLE}", "note")


def _encoded(data: bytes) -> str:
    return b64encode(data).decode("ascii")


def _described(analysis: Analysis, beside: Comparison | None) -> str:
    """What the picture shows, for readers without it."""
    rows = ["classes", "noise", "its level above 10 Hz", "probability of a failure"]
    if beside is not None:
        rows[2:] = ["its level and that of the repetitions", "joints over the reference"]
    rows += ["spectrogram of the worst joint", "levels of joints"]
    rows += ["levels of links"] if analysis.links is not None else []
    return f"Over {analysis.run.duration:.2f} s: {', '.join(rows)}; the tables have the findings"


# --- tables


def facts(analysis: Analysis) -> Table:
    """List what the run is."""
    run, rows = analysis.run, list[tuple[str, str]]()
    for key in ("scenario", "seed", "source"):
        if key in run.meta:
            value = run.meta[key]
            rows.append((key, ", ".join(map(str, value if isinstance(value, list) else [value]))))
    rows[:0] = [
        ("robot", run.robot or "not named"),
        ("duration", f"{run.duration:.2f} s at {run.rate:g} Hz"),
        ("joints", str(len(run.joint_names))),
        ("model", analysis.model or "none"),
    ]
    return Table("", ("", ""), rows)


def found(analysis: Analysis, verdict: Verdict | None = None) -> Iterator[Table]:
    """List findings and annotated blocks, those that there are."""
    remark = note(analysis)
    known = {} if verdict is None else verdict.evidence
    if analysis.findings:
        findings = [
            (
                f"{spoken(event.label)}{event.novelty}",
                f"{event.start:.2f}",
                f"{event.stop:.2f}",
                f"{event.score:.2f}",
                *localised(analysis, event),
                *([str(known[event])] if event in known else []),
            )
            for event in analysis.findings
        ]
        evidence = ("evidence",) if known else ()
        head = ("class", "from [s]", "to [s]", "score", *LOCALISATION, *evidence)
        yield Table("Findings", head, findings, (1, 2, 3), remark)
    if analysis.run.blocks:
        annotated = [
            (
                spoken(block.label),
                f"{block.start:.2f}",
                f"{block.stop:.2f}",
                matched(analysis, block),
                *localised(analysis, block),
            )
            for block in analysis.run.blocks
        ]
        head = ("class", "from [s]", "to [s]", "found", *LOCALISATION)
        yield Table("Annotated", head, annotated, (1, 2), "" if analysis.findings else remark)


def parts(analysis: Analysis) -> Iterator[Table]:
    """List links and joints by what vibrates in them."""
    links = analysis.links
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
    run = analysis.run
    energy, highest, places = (np.zeros(len(run.joint_names)) for _ in range(3))
    for rows, fast in vibrating_pieces(run.velocity, run.mask, run.rate):
        power = np.square(fast)
        energy += power.sum(axis=0)
        louder = power.max(axis=0) > highest
        places = np.where(louder, rows.start + power.argmax(axis=0), places)
        highest = np.maximum(highest, power.max(axis=0))
    each = zip(
        np.sqrt(energy / len(run.time)),
        np.sqrt(highest),
        run.time[places.astype(int)],
        strict=True,
    )
    yield _ranked(
        "Joints",
        ("joint", "share", "rms [rad/s]", "peak [rad/s]", "at [s]"),
        run.joint_names,
        energy,
        [(f"{rms:.3g}", f"{peak:.3g}", f"{time:.3f}") for rms, peak, time in each],
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
    """Rows of parts by their power, and how many are left out."""
    share = power / (power.sum() or 1.0)
    order = np.argsort(-power, kind="stable")[:MOST]
    rows = [(names[i], f"{share[i]:.1%}", *facts[i]) for i in order]
    left = len(names) - len(order)
    note = f"{note} {left} quieter ones are left out." if left else note
    return Table(title, head, rows, tuple(range(1, len(head))), note)
