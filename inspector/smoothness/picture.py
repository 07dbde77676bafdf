"""Histograms of the scores of episodes, a colour for each input."""

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from inspector.errors import InspectorError
from inspector.smoothness.scores import SCORES, Episode, Score
from noisemodel.atomic import replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")
COLUMNS, BINS, DPI = 3, 20, 100
WIDTH, HEIGHT = 3.6, 2.4
"""Of one histogram, in [inch]."""
SPREAD = 20.0
"""Ratio of the largest to the median of positive values beyond which the axis is logarithmic."""


def require() -> None:
    """Refuse a picture before long work is done for it.

    Raises:
        InspectorError: If matplotlib is not installed.
    """
    if find_spec("matplotlib") is None:
        raise InspectorError('a picture needs matplotlib; `pip install "noise-inspector[report]"`')


def draw(episodes: Sequence[Episode], path: Path, *, overwrite: bool = False) -> None:
    """Draw a histogram of each score that an episode has, as a PNG file.

    Args:
        episodes: The episodes.
        path: The file to write.
        overwrite: Whether a file that exists may be replaced.

    Raises:
        InspectorError: If matplotlib is not installed, or no episode has a score.
        OutputError: If the file exists or cannot be written.
    """
    require()
    from matplotlib.figure import Figure

    shown = [
        score
        for score in SCORES.values()
        if any(episode.scores[score.name] is not None for episode in episodes)
    ]
    if not shown:
        raise InspectorError(f"{path}: there are no scores to draw")
    rows = -(-len(shown) // COLUMNS)
    figure = Figure(figsize=(COLUMNS * WIDTH, rows * HEIGHT + 0.4), dpi=DPI, layout="constrained")
    axes = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
    for one, score in zip(axes, shown, strict=False):
        _histogram(one, episodes, score)
    for one in axes[len(shown) :]:
        one.set_axis_off()
    handles, labels = axes[0].get_legend_handles_labels()
    if len(labels) > 1:
        figure.legend(handles, labels, loc="outside upper left", ncols=COLUMNS, frameon=False)
    with replacing(path, overwrite=overwrite) as temporary:
        figure.savefig(temporary, format="png")


def _histogram(axes: "Axes", episodes: Sequence[Episode], score: Score) -> None:
    sources = sorted({episode.source for episode in episodes})
    together = len(sources) > len(COLORS)
    groups: dict[str, list[float]] = {source: [] for source in ([""] if together else sources)}
    for episode in episodes:
        value = episode.scores[score.name]
        if value is not None:
            groups["" if together else episode.source].append(value)
    values = np.concatenate([np.array(group) for group in groups.values()])
    positive = bool((values > 0).all()) and values.max() > SPREAD * np.median(values)
    low, high = float(values.min()), float(values.max())
    if low == high:
        low, high = low - 0.5 * (abs(low) or 1.0), high + 0.5 * (abs(high) or 1.0)
        positive = False
    edges = np.geomspace(low, high, BINS + 1) if positive else np.linspace(low, high, BINS + 1)
    for (name, group), color in zip(groups.items(), COLORS, strict=False):
        axes.hist(group, edges.tolist(), color=color, alpha=0.6, label=name)
    if positive:
        axes.set_xscale("log")
    better = "right" if score.smooth > 0 else "left"
    unit = f" [{score.unit}]" if score.unit else ""
    axes.set_title(score.meaning, fontsize=8)
    axes.set_xlabel(f"{score.title}{unit}; smoother to the {better}", fontsize=8)
    axes.set_ylabel("episodes", fontsize=8)
    axes.locator_params(axis="y", integer=True)
    axes.tick_params(labelsize=7)
