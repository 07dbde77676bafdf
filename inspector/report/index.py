"""A folder about many runs: a page with a row and a picture for each, the worst first."""

import hashlib
import re
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

from inspector.analysis.analyse import Analysis
from inspector.analysis.status import Status
from inspector.analysis.verdict import Verdict
from inspector.errors import InspectorError
from inspector.report.formats import WORDS, excused, failing, summary
from inspector.report.html import STYLE, add_text, document
from noisemodel.atomic import replacing

PAGE = "index.html"
PICTURES = "pictures"
POLICY = "default-src 'none'; img-src 'self' file:; style-src 'unsafe-inline'"
"""Policy for browsers: nothing but the pictures is fetched, also from a page on a disk."""
COLORS = {
    Status.INTERNAL_ERROR: "#82071e",
    Status.BAD_INPUT: "#82071e",
    Status.FINDINGS: "#cf222e",
    Status.CANNOT_TELL: "#9a6700",
    Status.OK: "#1a7f37",
}
ROWS = """
body { max-width: 80rem; }
td { vertical-align: top; }
td.run { max-width: 32rem; overflow-wrap: anywhere; }
td.run p { margin: .2rem 0; }
td.picture { width: 36rem; padding-right: 0; }
.status { font-weight: 600; }
"""


def prepare(folder: Path, *, overwrite: bool = False) -> None:
    """Make the folder before long work is done for it.

    Args:
        folder: The folder; it is created if it does not exist.
        overwrite: Whether a page in it may be replaced.

    Raises:
        InspectorError: If it cannot be made, or holds a page already.
    """
    try:
        (folder / PICTURES).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InspectorError(f"{folder}: cannot be made a folder ({error.strerror})") from error
    if (folder / PAGE).exists() and not overwrite:
        raise InspectorError(
            f"{folder / PAGE}: exists already; choose another folder, or overwrite it (--overwrite)"
        )


def draw(analysis: Analysis, path: Path, *, folder: Path) -> Path:
    """Draw a run over time into the folder.

    Args:
        analysis: The run with what was found in it.
        path: The file that it is of: the picture is named after it.
        folder: The folder.

    Returns:
        The picture.

    Raises:
        OutputError: If it cannot be written.
    """
    from inspector.report.picture import picture

    # The hash keeps runs of one name in several folders apart, in any process.
    name = re.sub(r"[^\w.-]", "_", path.stem)[:80]
    target = folder / PICTURES / f"{name}-{hashlib.sha256(str(path).encode()).hexdigest()[:8]}.png"
    with replacing(target, overwrite=True) as temporary:
        temporary.write_bytes(picture(analysis))
    return target


def write(verdicts: Sequence[Verdict], folder: Path) -> Path:
    """Write the page, whole or not at all.

    Args:
        verdicts: What was found in runs, with their pictures.
        folder: The folder.

    Returns:
        The page.

    Raises:
        OutputError: If it cannot be written.
    """
    path = folder / PAGE
    with replacing(path, overwrite=True) as temporary:
        temporary.write_text(page(verdicts), encoding="utf-8")
    return path


def page(verdicts: Sequence[Verdict]) -> str:
    """Write the page.

    Args:
        verdicts: What was found in runs; their pictures lie in the folder of the page.

    Returns:
        HTML.
    """
    html, body = document(f"Noise: {summary(verdicts)}", STYLE + ROWS, POLICY)
    add_text(body, "h1", "Noise of the joints")
    add_text(body, "p", summary(verdicts), "verdict")
    table = ET.SubElement(ET.SubElement(body, "div", {"class": "wide"}), "table")
    for verdict in sorted(verdicts, key=lambda each: each.severity):
        _add_row(table, verdict)
    return f"<!DOCTYPE html>\n{ET.tostring(html, encoding='unicode', method='html')}\n"


def _add_row(table: ET.Element, verdict: Verdict) -> None:
    row = ET.SubElement(table, "tr")
    cell = ET.SubElement(row, "td", {"class": "run"})
    add_text(cell, "p", str(verdict.path), "status")
    status = f"{WORDS[verdict.status]}{' (ignored)' if verdict.ignored else ''}"
    state = ET.SubElement(cell, "p", {"class": "status", "style": f"color: {_color(verdict)}"})
    state.text = status
    for sentence in failing(verdict):
        add_text(cell, "p", sentence)
    facts = [
        *excused(verdict),
        verdict.message,
        verdict.assumed,
        f"by {verdict.expectations}" if verdict.expectations else "",
        f"{verdict.duration:.2f} s, model {verdict.model}" if verdict.model else "",
    ]
    for fact in filter(None, facts):
        add_text(cell, "p", fact, "note")
    shown = ET.SubElement(row, "td", {"class": "picture"})
    if verdict.picture is not None:
        source = f"{PICTURES}/{verdict.picture.name}"
        link = ET.SubElement(shown, "a", href=source)
        described = f"{verdict.path} over time: classes, noise, spectrogram"
        ET.SubElement(link, "img", src=source, alt=described, loading="lazy")


def _color(verdict: Verdict) -> str:
    return COLORS[Status.CANNOT_TELL if verdict.ignored else verdict.status]
