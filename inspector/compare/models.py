"""Comparisons of noise models as CSV, and as a picture of terms, correlation and distance."""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from inspector.report.picture import require
from inspector.text import cell
from noisemodel import Comparison, Comparisons
from noisemodel.compare import TERMS, medians
from noisemodel.files import replacing
from noisemodel.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def write_csv(found: Comparisons, path: Path, *, overwrite: bool = False) -> None:
    """Write a row for each robot and kind, with the columns of ``Comparisons.to_arrow``."""
    table = found.to_arrow()
    with (
        replacing(path, overwrite=overwrite) as temporary,
        temporary.open("w", newline="", encoding="utf-8") as file,
    ):
        writer = csv.DictWriter(file, table.column_names, lineterminator="\n")
        writer.writeheader()
        for row in table.to_pylist():
            writer.writerow({name: _cell(name, value) for name, value in row.items()})


def _cell(name: str, value: str | bool | int | float) -> str | int:
    """Print a number as the CSV of earlier versions did."""
    if isinstance(value, float):
        return f"{value:g}" if name == "rate_hz" else f"{value:.4f}"
    if isinstance(value, str):
        return cell(value)
    return int(value) if isinstance(value, bool) else value


# Of A, B and C: dark, middle and light, so that they differ in grey too.
TERM_COLORS = ("#3b3b6d", "#d98c4a", "#f2e3c4")
CURVES = ("#d55e00", "#0072b2", "#000000", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")
MARKERS = "ovs^DPX"
LINES = ("-", "--", "-", ":", "-.", (0, (1, 1)), (0, (5, 1)))
ROBOT = 0.17  # height of a robot, in [inch]
# Distance of two independent noises with the same mean spectrum, in [dB].
INDEPENDENT_DB = 10.0 / np.log(10.0) * np.pi / np.sqrt(3.0)
# Centres of thirds of octaves, from 20 to 5120 Hz, in [Hz].
THIRDS = 20.0 * 2.0 ** (np.arange(25) / 3.0)
ACROSS, MARGIN, BELOW = 10.0, 1.3, 3.0
DPI = 100


def draw(found: Comparisons, path: Path, *, overwrite: bool = False) -> None:
    """Draw what was found as a PNG file."""
    require()
    from matplotlib.figure import Figure

    # Robots with a fixed base first, those on top for which A and B count least.
    order = sorted(found, key=lambda one: (one.floating_base, -_terms(one)[2]))
    rows = ROBOT * max(len(order), 6)
    figure = Figure(figsize=(ACROSS, rows + MARGIN + BELOW), dpi=DPI, layout="constrained")
    parts = figure.subfigures(2, 1, squeeze=False, height_ratios=[rows + MARGIN, BELOW])
    upper, lower = parts[:, 0]
    left, right = upper.subplots(1, 2, sharey=True)
    _shares(left, order)
    _correlations(right, order)
    _spectra(lower, order)
    with replacing(path, overwrite=overwrite) as temporary:
        figure.savefig(temporary, format="png")


def _shares(panel: "Axes", found: Sequence[Comparison]) -> None:
    terms = np.array([_terms(one) for one in found])
    starts = np.cumsum(terms, axis=1) - terms
    for index, (term, color) in enumerate(zip(TERMS, TERM_COLORS, strict=True)):
        panel.barh(
            np.arange(len(found)),
            terms[:, index],
            left=starts[:, index],
            color=color,
            edgecolor="black",
            linewidth=0.3,
            label=term,
        )
    names = [f"{one.name} (floating)" if one.floating_base else one.name for one in found]
    panel.set_yticks(np.arange(len(found)), names, fontsize=7)
    panel.set_ylim(len(found) - 0.4, -0.6)
    panel.set_xlim(0.0, 1.0)
    panel.set_xlabel("share of the paper's terms A, B, C in its power")
    _legend(panel)


def _correlations(panel: "Axes", found: Sequence[Comparison]) -> None:
    kinds, reference = found[0].kinds, found[0].reference
    for number, index in enumerate(_others(found)):
        panel.plot(
            [one.correlation[index, reference] for one in found],
            np.arange(len(found)),
            MARKERS[number],
            color=CURVES[number],
            markerfacecolor="none" if number % 2 else CURVES[number],
            markersize=4.5,
            label=kinds[index],
        )
    panel.set_xlim(right=1.05)
    panel.grid(alpha=0.4)
    panel.set_xlabel(f"correlation of the envelope with {kinds[reference]!r}")
    _legend(panel)


def _spectra(figure: "Figure", found: Sequence[Comparison]) -> None:
    """Draw distance over frequency, fixed and floating bases side by side where there are both."""
    groups = [[one for one in found if one.floating_base == floating] for floating in (False, True)]
    groups = [group for group in groups if group]
    panels = figure.subplots(1, len(groups), sharey=True, squeeze=False)[0]
    kinds, reference = found[0].kinds, found[0].reference
    for panel, group in zip(panels, groups, strict=True):
        for number, index in enumerate(_others(found)):
            distance = medians([_by_third(one, index) for one in group])
            panel.plot(THIRDS, distance, color=CURVES[number], ls=LINES[number], label=kinds[index])
        base = "floating base" if group[0].floating_base else "fixed base"
        panel.set_title(f"{base}, median of {len(group)}", fontsize=9)
        panel.set_xscale("log")
        panel.axhline(INDEPENDENT_DB, color="grey", lw=0.8, label="independent noises")
        panel.grid(alpha=0.4)
        panel.set_xlabel("frequency [Hz]")
    panels[0].set_ylabel(f"distance to {kinds[reference]!r} [dB]")
    panels[0].set_ylim(0.0, 1.35 * panels[0].get_ylim()[1])
    for panel in panels:
        panel.legend(loc="upper center", ncols=3, frameon=False, fontsize=8)


def _legend(panel: "Axes") -> None:
    panel.legend(
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=7,
        frameon=False,
        fontsize=8,
        handlelength=1.2,
        columnspacing=1.0,
    )


def _by_third(one: Comparison, kind: int) -> Array:
    """Distance to the reference in each third of an octave, in [dB]; nan where there is none."""
    squares = one.distance_by_frequency[kind, one.reference] ** 2
    third = np.rint(3.0 * np.log2(np.maximum(one.frequency, 1.0) / THIRDS[0]))
    inside = [third == index for index in range(len(THIRDS))]
    return np.array([np.sqrt(squares[at].mean()) if at.any() else np.nan for at in inside])


def _others(found: Sequence[Comparison]) -> list[int]:
    return [index for index in range(len(found[0].kinds)) if index != found[0].reference]


def _terms(one: Comparison) -> Array:
    return np.asarray(one.terms.sum(axis=0))
