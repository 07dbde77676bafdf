"""What came out of tuning, as text for people and as JSON."""

from math import isnan
from typing import Any

from inspector.training.tuning import Tuned
from models.tuning.grid import Point
from models.tuning.search import Criterion, Measures

HEADS = {
    "balanced_accuracy": ("balanced", "accuracy"),
    "log_loss": ("", "log-loss"),
    "failure_recall": ("failure", "recall"),
    "false_alarm_rate": ("false", "alarms"),
    "subset_accuracy": ("subset", "accuracy"),
}
"""What the measures are called, in two lines."""
WIDTH = 10
"""Of a column at least."""


def table(tuned: Tuned, criterion: Criterion, *, rows: int = 10) -> str:
    """Print the best points under each other, and what there is to say about them.

    Args:
        tuned: What came out.
        criterion: What makes a point the best.
        rows: How many points.

    Returns:
        Lines of text.
    """
    names = list(tuned.grid.axes)
    ranked, points = tuned.ranked(criterion)[:rows], list(tuned.grid.points())
    untuned = {name: getattr(tuned.untuned, name) for name in names}
    titles = [str(place + 1) for place in range(len(ranked))]
    cells = [
        ["", *("" for _ in names), *(upper for upper, _ in HEADS.values())],
        ["", *names, *(lower for _, lower in HEADS.values())],
        *([t, *_cells(points[i], tuned.measures[i])] for t, i in zip(titles, ranked, strict=True)),
        ["as was", *_cells(untuned, tuned.asked.measures()[0])],
    ]
    widths = [6, *(max(WIDTH, len(name) + 2) for name in names), *(WIDTH for _ in HEADS)]
    lines = ["".join(c.rjust(w) for c, w in zip(row, widths, strict=True)) for row in cells]
    return "\n".join([_basis(tuned), "", *lines, "", *_remarks(tuned, criterion)])


def as_dict(tuned: Tuned, criterion: Criterion, *, rows: int = 10) -> dict[str, Any]:
    """Give the best points as JSON can hold them.

    Args:
        tuned: What came out.
        criterion: What makes a point the best.
        rows: How many points.
    """
    points = list(tuned.grid.points())
    return {
        "points": len(points),
        "criterion": criterion,
        "shared_by": {name: _shared(tuned, name) for name in HEADS},
        "best": [
            {**points[index], **tuned.measures[index].as_dict()}
            for index in tuned.ranked(criterion)[:rows]
        ],
        "profile": tuned.profiles[tuned.ranked(criterion)[0]].as_dict(),
        "untuned": tuned.asked.measures()[0].as_dict(),
    }


def _basis(tuned: Tuned) -> str:
    asked, splits = tuned.asked, tuned.trial.splits
    learnt = len({index for learn, _ in splits for index in learn.tolist()})
    others = f"{len(set(asked.runs.tolist()))} others"
    if not tuned.question.validation:
        others = f"the same, in {len(splits)} folds"
    return (
        f"{len(tuned.grid)} points of {tuned.question.profile}, trained on"
        f" {asked.training_frames} frames of {learnt} recordings,"
        f" measured on {len(asked.truth)} frames of {others}"
    )


def _remarks(tuned: Tuned, criterion: Criterion) -> list[str]:
    best = tuned.ranked(criterion)[0]
    first = tuned.measures[best]
    lines = []
    if criterion != "log-loss":
        name = criterion.replace("-", "_")
        lines.append(
            f"{_share(tuned, name)} the best {criterion.replace('-', ' ')},"
            f" {getattr(first, name):.1%}; between equals, the log-loss decides."
        )
    if criterion != "subset-accuracy":
        most = max(measures.subset_accuracy for measures in tuned.measures)
        lines.append(
            f"{_share(tuned, 'subset_accuracy')} the best subset accuracy, {most:.1%},"
            " which is the paper's criterion."
        )
    for name, values in tuned.grid.axes.items():
        value = getattr(tuned.profiles[best], name)
        numbers = [each for each in values if not isinstance(each, str)]
        if len(numbers) > 1 and value in (min(numbers), max(numbers)):
            lines.append(f"{name} {value:.6g} is an end of the grid: a wider one may hold better.")
    return lines


def _share(tuned: Tuned, name: str) -> str:
    count = _shared(tuned, name)
    return f"{count} of {len(tuned.grid)} points {'has' if count == 1 else 'share'}"


def _shared(tuned: Tuned, name: str) -> int:
    """Count the points with the best value of a measure."""
    values = [getattr(measures, name) for measures in tuned.measures]
    least = name in ("log_loss", "false_alarm_rate")
    there = [value for value in values if not isnan(value)]
    return there.count(min(there) if least else max(there)) if there else 0


def _cells(point: Point, measures: Measures) -> list[str]:
    settings = [value if isinstance(value, str) else f"{value:.6g}" for value in point.values()]
    return settings + [_cell(name, getattr(measures, name)) for name in HEADS]


def _cell(name: str, value: float) -> str:
    if isnan(value):
        return "-"
    return f"{value:.4f}" if name == "log_loss" else f"{value:.1%}"
