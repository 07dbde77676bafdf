"""Recordings with predictions of a made-up model."""

import numpy as np
from scipy.stats import chi2

from noiseclassifier.labels import Labels
from noiseclassifier.matching import Predictions
from noiseclassifier.recording import Block, group_of

CLASSES = ("ok", "impact", "highaccelerations", "oscillations")
RATE, LENGTH, HOP = 1000.0, 400, 100

OK = np.eye(4)[0]


def blocks(*rows):
    return tuple(Block(*row) for row in rows)


def frames(seconds=5.0):
    """Start of each frame of a recording."""
    last = round(seconds * RATE) - LENGTH
    return np.unique([*range(0, last + 1, HOP), last]) / RATE


def perfect(blocks, seconds=5.0):
    """True class of each frame: a failure as soon as the frame holds any of it."""
    labels = []
    for start in frames(seconds):
        stop = start + LENGTH / RATE
        shared = {
            min(stop, block.stop) - max(start, block.start): block.label
            for block in blocks
            if block.label != "ok"
        }
        most = max(shared, default=0.0)
        labels.append(shared[most] if most > 2e-3 else "ok")
    return labels


def predicted(name, blocks, labels=None, *, seconds=5.0, scores=None, cut=None, start=0.0):
    """Predictions on a recording; by default without errors, also of frames cut from blocks."""
    labels = np.array(perfect(blocks, seconds) if labels is None else labels)
    begins = start + frames(seconds)
    if scores is None:
        scores = np.array([np.eye(4)[CLASSES.index(label)] - 0.5 for label in labels])
    truth = np.array([block.label for block in blocks])
    return Predictions(
        name,
        group_of(name),
        1.0 / RATE,
        tuple(sorted(b._replace(start=b.start + start, stop=b.stop + start) for b in blocks)),
        truth,
        truth if cut is None else np.array(cut),
        Labels(begins, begins + LENGTH / RATE, labels, scores, CLASSES),
    )


GOOD = blocks((0.0, 5.0, "ok"))
IMPACT = blocks((0.0, 2.0, "ok"), (2.03, 2.2, "impact"), (3.0, 5.0, "ok"))
OSCILLATION = blocks((0.0, 1.0, "ok"), (1.05, 3.5, "oscillations"), (3.6, 5.0, "ok"))


def many(seeds, labels=None):
    """Good runs, impacts and oscillations of one robot."""
    return [
        predicted(f"talos/{scenario}-{seed:03d}", annotated, labels)
        for seed in range(seeds)
        for scenario, annotated in (("good", GOOD), ("blow", IMPACT), ("swing", OSCILLATION))
    ]


def garwood(events):
    """Exact bounds of the mean of a Poisson distribution with 95 %, Garwood (1936)."""
    low = chi2.ppf(0.025, 2 * events) / 2 if events else 0.0
    return low, chi2.ppf(0.975, 2 * events + 2) / 2
