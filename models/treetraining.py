"""Boost trees with scikit-learn, and calibrate them on runs that they have not seen."""

from dataclasses import replace
from typing import Any

import numpy as np

from models.calibration import calibrate, familiar, plain
from models.profile import Profile
from models.splitting import folds
from models.trees import Trees
from models.types import Array, Index, Words

MANY = 10_000
"""Frames from which trees are learnt by several processes."""
PARTS = 3
"""Parts of the groups; trees that have not learnt from one are asked about it to calibrate all."""
NEVER = -30.0
"""Prior of a class that no frame is of."""
USUAL = 1e-3
"""Share of the training frames that lie above what is known."""


def fit_trees(features: Array, targets: Index, groups: Words, profile: Profile) -> Trees:
    """Learn trees from all frames, and their calibration from trees that do not know them.

    Args:
        features: Standardised, shape (frames, features).
        targets: Class of each, as an index from 0 without a gap, shape (frames,).
        groups: What shares its motion, shape (frames,).
        profile: Number and size of the trees.

    Returns:
        The trees; equal input gives equal trees. Those of a single group are not calibrated.
    """
    from joblib import Parallel, delayed

    parts = _parts(targets, groups)
    everything = np.arange(len(targets))
    parallel = Parallel(n_jobs=-1 if len(targets) > MANY else 1)
    learnt: list[Trees] = parallel(
        delayed(_fit)(features, targets, known, profile)
        for known in (everything, *(known for known, _ in parts))
    )
    trees, *others = learnt
    asked = [familiar(targets, known, fresh) for known, fresh in parts]
    if not sum(map(len, asked)):
        return trees
    answers = [one.answers(features[those]) for one, those in zip(others, asked, strict=True)]
    truth = targets[np.concatenate(asked)]
    return replace(trees, calibration=calibrate(np.concatenate(answers), truth))


def _parts(targets: Index, groups: Words) -> list[tuple[Index, Index]]:
    """Say which frames trees learn from, and which they are asked about."""
    count = min(PARTS, len(set(groups.tolist())))
    parts = folds(groups.tolist(), count) if count > 1 else []
    return [part for part in parts if len(set(targets[part[0]].tolist())) > 1]


def _fit(features: Array, targets: Index, known: Index, profile: Profile) -> Trees:
    """Learn trees from the frames that are known; their calibration changes nothing."""
    from sklearn.ensemble import HistGradientBoostingClassifier
    from threadpoolctl import threadpool_limits

    boosting = HistGradientBoostingClassifier(
        max_iter=profile.rounds,
        learning_rate=profile.learning_rate,
        max_leaf_nodes=profile.leaves,
        l2_regularization=profile.penalty,
        early_stopping=False,  # it would hold back frames that overlap others
        random_state=0,
    )
    with threadpool_limits(1):  # a thread that waits for a core keeps all others waiting
        boosting.fit(features[known], targets[known])
    classes = int(targets.max()) + 1
    counts = np.bincount(targets[known], minlength=classes)
    there = np.flatnonzero(counts)
    # Private is where its trees are; a test holds ours to them. It has none for a class that it
    # does not see, and of two classes for the second alone.
    learnt = there if len(there) > 2 else there[1:]
    prior = np.where(counts > 0, 0.0, NEVER)
    prior[learnt] = boosting._baseline_prediction.ravel()
    shape = profile.rounds, classes, profile.leaves
    splits, leaf = np.zeros((4, *shape[:2], shape[2] - 1)), np.zeros(shape)
    for number, trees in enumerate(boosting._predictors):
        for kind, tree in zip(learnt, trees, strict=True):
            rows, values = _lay_out(tree.nodes)
            splits[:, number, kind, : len(rows)] = np.transpose(rows)
            leaf[number, kind, : len(values)] = values
    feature, threshold, *left = splits.reshape(4, -1, shape[2] - 1)
    return Trees(
        feature=feature,
        threshold=threshold,
        left=np.array(left),
        leaf=leaf.reshape(-1, shape[2]),
        prior=prior,
        known=np.quantile(features[known], 1.0 - USUAL, axis=0),
        calibration=plain(classes),
        frequency=counts / len(known),
        alarm=profile.alarm,
    )


def _lay_out(nodes: Any) -> tuple[list[list[float]], list[float]]:
    """Read a tree as scikit-learn keeps it.

    Returns:
        Of each split the feature, the threshold, the first leaf on its left, and the first one
        that is not; and the values of the leaves, from left to right.
    """
    splits: list[list[float]] = []
    values: list[float] = []

    def visit(number: int) -> None:
        node = nodes[number]
        if node["is_leaf"]:
            values.append(node["value"])
            return
        split = [node["feature_idx"], node["num_threshold"], len(values)]
        splits.append(split)
        visit(node["left"])
        split.append(len(values))
        visit(node["right"])

    visit(0)
    return splits, values
