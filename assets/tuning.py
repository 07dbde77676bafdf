"""Draw the results of `inspector tune` for docs/paper.md: accuracy along each setting."""

import json
import sys
from pathlib import Path

import matplotlib.pyplot as plt

HERE = Path(__file__).parent
MEASURES = ("balanced_accuracy", "subset_accuracy")


def main(results: Path) -> None:
    """Write the picture of a results file: each setting, with the others at the best point."""
    header, *points = map(json.loads, results.read_text().splitlines())
    best = max(points, key=lambda point: [point[name] for name in MEASURES])
    settings = list(header["grid"])
    figure, row = plt.subplots(
        1, len(settings), squeeze=False, sharey=True, layout="constrained",
        figsize=(4.0 * len(settings), 3.4),
    )  # fmt: skip
    for axes, name in zip(row[0], settings, strict=True):
        others = {key: best[key] for key in settings if key != name}
        along = [point for point in points if others.items() <= point.items()]
        values = [point[name] for point in along]
        for measure in MEASURES:
            shares = [point[measure] for point in along]
            axes.plot(values, shares, ".-", label=measure.replace("_", " "))
        axes.axvline(best[name], color="0.6", ls=":")
        if not isinstance(values[0], str) and 0 < 100 * min(values) <= max(values):
            axes.set_xscale("log")
        axes.set_xlabel(f"{name}, best: {best[name]}")
        axes.grid(alpha=0.4)
    row[0][0].set_ylabel("share of frames, or mean recall")
    row[0][0].legend(fontsize=8)
    figure.suptitle("accuracy along each setting, others at the best")
    figure.savefig(HERE / "pictures" / "tune.png", dpi=100)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
