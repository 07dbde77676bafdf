"""Draw the noise models of all robots for docs/noise.md: terms, correlation, distance."""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

import noisemodel as nm
from noisemodel.compare import TERMS, medians

HERE = Path(__file__).parent
KINDS = ("simplified", "C", "paper", "mean", "rms", "normal")
REFERENCE = KINDS.index("normal")
# Of A, B and C: dark, middle and light, so that they differ in grey too.
TERM_COLORS = ("#3b3b6d", "#d98c4a", "#f2e3c4")
CURVES = ("#d55e00", "#0072b2", "#000000", "#009e73", "#cc79a7")
MARKERS, LINES = "ovs^D", ("-", "--", "-", ":", "-.")
ROBOT, AROUND, BELOW = 0.17, 1.3, 3.0  # heights of a robot, the rest above, and below, in [inch]
# Distance of two independent noises with the same mean spectrum, in [dB].
INDEPENDENT_DB = 10.0 / np.log(10.0) * np.pi / np.sqrt(3.0)
# Centres of thirds of octaves, from 20 to 5120 Hz, in [Hz].
THIRDS = 20.0 * 2.0 ** (np.arange(25) / 3.0)


def main(robots: list[str]) -> None:
    """Write the picture of some robots; of all of example-robot-data by default."""
    found = list(nm.compare(robots or list(nm.ROBOTS), kinds=KINDS, jobs=2))
    # Robots with a fixed base first, those on top for which A and B count least.
    found.sort(key=lambda one: (one.floating_base, -one.terms.sum(axis=0)[2]))
    rows = ROBOT * max(len(found), 6) + AROUND
    figure = plt.figure(figsize=(10.0, rows + BELOW), layout="constrained")
    upper, lower = figure.subfigures(2, 1, height_ratios=[rows, BELOW])
    left, right = upper.subplots(1, 2, sharey=True)
    draw_terms(left, found)
    draw_correlations(right, found)
    for panel, floating in zip(lower.subplots(1, 2, sharey=True), (False, True), strict=True):
        draw_distances(panel, [one for one in found if one.floating_base == floating])
        panel.set_title(f"{'floating' if floating else 'fixed'} base", fontsize=9)
    figure.savefig(HERE / "pictures" / "noise-models.png", dpi=100)


def draw_terms(panel: Axes, found: list[nm.Comparison]) -> None:
    """Draw the shares of A, B and C in the power of each robot."""
    terms = np.array([one.terms.sum(axis=0) for one in found])
    starts, places = np.cumsum(terms, axis=1) - terms, np.arange(len(found))
    for index, (term, color) in enumerate(zip(TERMS, TERM_COLORS, strict=True)):
        panel.barh(places, terms[:, index], left=starts[:, index], color=color, label=term)
    names = [f"{one.name} (floating)" if one.floating_base else one.name for one in found]
    panel.set_yticks(places, names, fontsize=7)
    panel.set(xlim=(0.0, 1.0), ylim=(len(found) - 0.4, -0.6))
    panel.set_xlabel("share of the paper's terms A, B, C in its power")
    panel.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, frameon=False)


def draw_correlations(panel: Axes, found: list[nm.Comparison]) -> None:
    """Draw the correlation of each kind with the reference."""
    for index, (color, marker) in enumerate(zip(CURVES, MARKERS, strict=True)):
        values = [one.correlation[index, REFERENCE] for one in found]
        panel.plot(values, np.arange(len(found)), marker, color=color, label=KINDS[index])
    panel.grid(alpha=0.4)
    panel.set_xlabel("correlation of the envelope with 'normal'")
    panel.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=5, frameon=False)


def draw_distances(panel: Axes, found: list[nm.Comparison]) -> None:
    """Draw the distance of each kind to the reference over frequency, as medians of robots."""
    for index, (color, line) in enumerate(zip(CURVES, LINES, strict=True)):
        rows = []
        for one in found:
            squares = one.distance_by_frequency[index, REFERENCE] ** 2
            third = np.rint(3.0 * np.log2(np.maximum(one.frequency, 1.0) / THIRDS[0]))
            inside = [third == place for place in range(len(THIRDS))]
            rows.append([np.sqrt(squares[at].mean()) if at.any() else np.nan for at in inside])
        distance = medians(np.array(rows)) if rows else np.full(len(THIRDS), np.nan)
        panel.plot(THIRDS, distance, color=color, ls=line, label=KINDS[index])
    panel.axhline(INDEPENDENT_DB, color="grey", lw=0.8, label="independent noises")
    panel.set(xscale="log", xlabel="frequency [Hz]", ylabel="distance to 'normal' [dB]")
    panel.grid(alpha=0.4)
    panel.legend(ncols=3, frameon=False, fontsize=8)


if __name__ == "__main__":
    main(sys.argv[1:])
