"""Draw what models make of one run: its noise, and each model's failure probability and findings.

    python -m benchmarks.verdicts RUN MODEL... [--names NAME...] [-o verdicts.png]

MODEL are files of any version. Findings are those of `inspector classify --model MODEL`, by the
rule of today; dashed is the alarm threshold. The share of the time within a finding is printed.
"""

import argparse
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

import noiseclassifier as nc
import noisemodel as nm
from inspector.analysis.analyse import analyse
from inspector.colors import of_classes
from inspector.library import load_library
from noiseclassifier.evaluation.spans import duration, spans_of


def main() -> None:
    """Analyse, print and draw."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("run", type=Path)
    arguments.add_argument("models", nargs="+", help="files, or names of models that ship")
    arguments.add_argument("--names", nargs="*", default=[])
    arguments.add_argument("-o", "--output", type=Path, default=Path("verdicts.png"))
    options = arguments.parse_args()
    run = nm.Run.load(options.run)
    count = 1 + len(options.models)
    figure, rows = plt.subplots(
        count, sharex=True, figsize=(10, 1.5 * count), layout="constrained", squeeze=False
    )
    rows[0, 0].semilogy(
        run.time,
        np.where(run.mask, nm.simplified(run.motion, run.velocity_desired), np.nan),
        lw=0.5,
    )
    rows[0, 0].set_ylabel("noise in rad/s")
    for axes, path, name in zip(
        rows[1:, 0],
        options.models,
        options.names or [Path(each).stem for each in options.models],
        strict=True,
    ):
        found = analyse(run, load_library([path]))
        labels = found.labels
        assert labels is not None, found.reason
        flagged = duration(spans_of(found.findings)) / run.duration
        print(f"{name}: {len(found.findings)} findings, {flagged:.0%} of the time")
        colors = {
            each: tuple(np.array(color) / 255)
            for each, color in of_classes((*labels.classes, "unknown")).items()
        }
        for event in found.findings:
            axes.axvspan(event.start, event.stop, color=colors[event.label], alpha=0.35, lw=0)
        middle = (labels.start + labels.stop) / 2
        axes.plot(middle, 1.0 - labels.scores[:, labels.classes.index("ok")], "k", lw=0.8)
        (model,) = load_library([path]).values()
        settings = model.recipe if isinstance(model, nc.General) else model.profile
        axes.axhline(settings.alarm, color="0.4", ls="--")
        axes.set(ylim=(0, 1), ylabel="P(failure)")
        axes.set_title(f"{name}: {flagged:.0%} of the time flagged", loc="left", fontsize="medium")
    rows[-1, 0].set(xlabel="time in s", xlim=(run.time[0], run.time[-1]))
    figure.savefig(options.output, dpi=110)


if __name__ == "__main__":
    main()
