"""A scenario before and after a change as a picture: levels, and their change by joint and band."""

import io
from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np

from inspector.compare.changes import steps
from inspector.compare.pair import Pair
from inspector.errors import InspectorError
from inspector.regression.difference import CELL, Compared
from inspector.regression.statistic import ALPHA

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BEFORE, AFTER, INK = "#0072b2", "#d55e00", "#24292f"
WIDTH, DPI, ROW = 9.6, 120, 0.26
LIMIT_DB = 12.0
"""Change with the strongest colour, in [dB]."""


def drawable() -> bool:
    """Whether matplotlib is installed."""
    return find_spec("matplotlib") is not None


def require() -> None:
    """Refuse a picture before long work is done for it.

    Raises:
        InspectorError: If matplotlib is not installed.
    """
    if not drawable():
        raise InspectorError('a picture needs matplotlib; `pip install "noise-inspector[report]"`')


def picture(row: Compared, pair: Pair) -> bytes:
    """Draw what changed.

    Args:
        row: The scenario.
        pair: Two of its runs.

    Returns:
        A PNG file: findings and level of both runs over time, and the change of each joint and
        octave over all repetitions, a dot where it is significant.
    """
    from matplotlib.figure import Figure

    joints = list(dict.fromkeys(change.joint for change in row.changes if change.kind == CELL.name))
    labels = sorted({e.label for _, side in pair.sides for e in side.findings})
    heights = [ROW * max(len(labels), 1) + 0.3, 1.6, ROW * len(joints) + 0.5]
    figure = Figure(figsize=(WIDTH, sum(heights) + 1.2), dpi=DPI, layout="constrained")
    axes = figure.subplots(3, 1, height_ratios=heights)
    figure.suptitle(f"{row.name}: {row.verdict}, {row.reason}", fontsize=10, parse_math=False)
    _findings(axes[0], pair, labels)
    _level(axes[1], pair)
    axes[1].sharex(axes[0])
    axes[0].set_xlim(pair.time[0], pair.time[-1])
    _changes(figure, axes[2], row, sorted(joints))
    file = io.BytesIO()
    figure.savefig(file, format="png", metadata={"Software": None})
    return file.getvalue()


def _findings(axes: "Axes", pair: Pair, labels: list[str]) -> None:
    for place, (_, side) in enumerate(pair.sides):
        for line, label in enumerate(labels):
            spans = [(e.start, e.stop - e.start) for e in side.findings if e.label == label]
            axes.broken_barh(
                spans, (line + 0.4 * place - 0.4, 0.4), facecolor=(BEFORE, AFTER)[place]
            )
    axes.set_yticks(range(len(labels)), labels, parse_math=False)
    axes.set_ylim(max(len(labels), 1) - 0.5, -0.5)
    axes.set_title(
        "findings of both runs" if labels else "no finding in either run", fontsize=9, loc="left"
    )
    axes.tick_params(labelbottom=False)
    axes.grid(axis="x", alpha=0.3)


def _level(axes: "Axes", pair: Pair) -> None:
    time, level = steps(pair)
    for place, (name, side) in enumerate(pair.sides):
        shown = f"{'reference' if name == 'before' else 'candidate'}: {side.name}"
        axes.plot(time, level[:, place], color=(BEFORE, AFTER)[place], lw=0.9, label=shown)
    axes.set_ylabel("level [dB re 1 rad/s]")
    axes.set_xlabel("time [s]")
    axes.grid(alpha=0.3)
    for text in axes.legend(fontsize=8, loc="best").get_texts():
        text.set_parse_math(False)


def _changes(figure: "Figure", axes: "Axes", row: Compared, joints: list[str]) -> None:
    cells = [change for change in row.changes if change.kind == CELL.name]
    bands = sorted({change.band for change in cells if change.band is not None})
    change = np.full((len(joints), len(bands)), np.nan)
    for each in cells:
        if each.band is not None:
            place = joints.index(each.joint), bands.index(each.band)
            change[place] = each.change
            if min(each.p_louder, each.p_quieter) <= ALPHA:
                axes.plot(place[1], place[0], "o", color=INK, markersize=4)
    image = axes.imshow(change, cmap="RdBu_r", vmin=-LIMIT_DB, vmax=LIMIT_DB, aspect="auto")
    axes.set_yticks(range(len(joints)), joints, parse_math=False)
    axes.set_xticks(range(len(bands)), [f"{low:.0f} to {high:.0f}" for low, high in bands])
    axes.set_xlabel("octave [Hz]")
    runs = f"{len(row.reference)} and {len(row.candidate)} runs"
    axes.set_title(f"change over {runs}; dots: p ≤ {ALPHA:g}", fontsize=9, loc="left")
    figure.colorbar(image, ax=axes, pad=0.01, aspect=15, label="change [dB]")
