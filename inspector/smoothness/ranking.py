"""Episodes from the smoothest to the roughest, as a table, as CSV and as JSON."""

import csv
import io
import json
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from inspector.smoothness.episodes import Failed
from inspector.smoothness.measures import CUTOFF, PADDING, THRESHOLD
from inspector.smoothness.scores import FAST, SCORES, TRACKED, VELOCITIES, Episode
from inspector.text import cell

FORMAT = "noise-smoothness/1"
ORDERS = ("action_curvature", "level", "ldlj", "tracking", "action_rate", "sparc")
"""Scores by how well they separate chattering from clean rollouts (docs/smoothness.md)."""


@dataclass(frozen=True)
class Ranking:
    """Episodes in order.

    Attributes:
        by: The score that they are ordered by.
        episodes: The smoothest first; those without this score last.
        failed: What could not be read.
    """

    by: str
    episodes: tuple[Episode, ...]
    failed: tuple[Failed, ...] = ()

    @property
    def ranks(self) -> tuple[int | None, ...]:
        """Rank of each episode, from 1; equal scores have equal ranks, None without a score."""
        values = [episode.scores[self.by] for episode in self.episodes]
        return tuple(None if value is None else values.index(value) + 1 for value in values)


def default_order(episodes: Sequence[Episode]) -> str:
    """Name of the first of ``ORDERS`` that can be compared: all episodes have it, of one quantity.

    Args:
        episodes: The episodes.

    Returns:
        Its name; "level" if there is none.
    """

    def comparable(name: str) -> bool:
        quantities = {episode.quantities.get(name) for episode in episodes}
        return len(quantities) == 1 and all(each.scores[name] is not None for each in episodes)

    return next((name for name in ORDERS if comparable(name)), "level")


def ranked(found: Iterable[Episode | Failed], *, by: str = "") -> Ranking:
    """Order episodes from the smoothest to the roughest.

    Args:
        found: Episodes, and what could not be read.
        by: One of ``SCORES``; by default as `default_order` has it.

    Returns:
        The ranking.
    """
    each = tuple(found)
    scored = [one for one in each if isinstance(one, Episode)]
    by = by or default_order(scored)

    def roughness(episode: Episode) -> tuple[bool, float]:
        value = episode.scores[by]
        return value is None, 0.0 if value is None else -SCORES[by].smooth * value

    return Ranking(
        by,
        tuple(sorted(scored, key=roughness)),
        tuple(one for one in each if isinstance(one, Failed)),
    )


def as_text(ranking: Ranking) -> str:
    """Write a ranking as a table, with what is missing and why below it."""
    episodes = ranking.episodes
    if not episodes:
        return "0 episodes"
    count = f"{len(episodes)} episode{'' if len(episodes) == 1 else 's'}"
    score = SCORES[ranking.by]
    heads = [
        ("rank", ""),
        ("episode", ""),
        ("duration", "s"),
        ("rate", "Hz"),
        *((score.title, score.unit) for score in SCORES.values()),
    ]
    names = _short([episode.name for episode in episodes])
    rows = [
        [
            "" if rank is None else str(rank),
            name,
            f"{episode.duration:.2f}",
            f"{episode.rate:g}",
            *(_cell(name, value) for name, value in episode.scores.items()),
        ]
        for rank, name, episode in zip(ranking.ranks, names, episodes, strict=True)
    ]
    columns = list(zip(*([list(head) for head in zip(*heads, strict=True)] + rows), strict=True))
    widths = [max(len(cell) for cell in column) for column in columns]
    lines = [
        "  ".join(
            cell.ljust(width) if place == 1 else cell.rjust(width)
            for place, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in zip(*columns, strict=True)
    ]
    head = f"{count}, the smoothest first by {score.meaning}"
    return "\n".join([head, "", *lines, "", *_notes(ranking)])


def as_csv(ranking: Ranking) -> str:
    """Write a ranking as CSV; a score that is missing is an empty cell."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["rank", "log", "episode", "duration", "rate", *SCORES])
    for rank, episode in zip(ranking.ranks, ranking.episodes, strict=True):
        known = [
            rank,
            cell(str(episode.log)),
            cell(episode.episode),
            episode.duration,
            episode.rate,
        ]
        values = [*known, *episode.scores.values()]
        writer.writerow(["" if value is None else _plain(value) for value in values])
    return out.getvalue().removesuffix("\n")


def as_json(ranking: Ranking) -> str:
    """Write a ranking as JSON; a score that is missing is null, with its reason."""
    return json.dumps(
        {
            "format": FORMAT,
            "by": ranking.by,
            "scores": {
                score.name: {
                    "meaning": score.meaning,
                    "unit": score.unit,
                    "smoother": "higher" if score.smooth > 0 else "lower",
                }
                for score in SCORES.values()
            },
            "settings": {
                "level_above_hz": FAST,
                "tracking_above_hz": TRACKED,
                "sparc_cutoff_hz": CUTOFF,
                "sparc_threshold": THRESHOLD,
                "sparc_padding": PADDING,
            },
            "episodes": [
                {
                    "rank": rank,
                    "log": episode.log,
                    "episode": episode.episode,
                    "duration": episode.duration,
                    "rate": episode.rate,
                    **episode.scores,
                    "of": dict(episode.quantities),
                    "missing": dict(episode.reasons),
                    "remarks": list(episode.remarks),
                }
                for rank, episode in zip(ranking.ranks, ranking.episodes, strict=True)
            ],
            "failed": {failed.name: failed.problem for failed in ranking.failed},
        },
        indent=2,
        ensure_ascii=False,
    )


def _notes(ranking: Ranking) -> Iterator[str]:
    """Say what is missing, what was decided, and what to look at, each once."""
    episodes = ranking.episodes

    def where(count: int) -> str:
        return "" if count == len(episodes) else f" for {count} of {len(episodes)}"

    missing: dict[str, list[str]] = {}
    for score in SCORES.values():
        reasons = Counter(
            each.reasons[score.name] for each in episodes if score.name in each.reasons
        )
        if reasons:
            (reason, _), others = reasons.most_common(1)[0], len(reasons) - 1
            more = f" (and {others} other reasons: --format json)" if others else ""
            missing.setdefault(f"empty{where(reasons.total())}, {reason}{more}", []).append(
                score.title
            )
    yield from (f"{', '.join(titles)}: {text}" for text, titles in missing.items())
    for name, titles in (("action_curvature", "action rate and 2nd diff."), ("tracking", "error")):
        kinds = Counter(each.quantities[name] for each in episodes if name in each.quantities)
        for kind, count in kinds.items():
            unit = ", rad/s in place of rad" if kind == VELOCITIES else ""
            yield f"{titles}: of {kind}{unit}{where(count)}"
    remarks = Counter(remark for episode in episodes for remark in episode.remarks)
    for remark, count in remarks.items():
        yield remark if count == len(episodes) else f"{count} of {len(episodes)}: {remark}"
    rates = sorted({episode.rate for episode in episodes})
    if len(rates) > 1:
        yield (
            f"Rates differ ({rates[0]:g} to {rates[-1]:g} Hz): compare scores of one rate only;"
            " they count all up to half of it."
        )
    yield f"SPARC: cut-off {CUTOFF:g} Hz. SPARC and LDLJ: higher is smoother; others: lower."
    ordered = [each for each in episodes if each.scores[ranking.by] is not None]
    if len(ordered) > 1:
        roughest = ordered[-1]
        command = f"inspector import {roughest.log} --episode {roughest.episode} -o roughest.npz"
        yield f"The roughest: {command if roughest.episode else f'inspector view {roughest.log}'}"


def _short(names: Sequence[str]) -> list[str]:
    """Names without the folders that all share."""
    parts = [Path(name).parts for name in names]
    shared = 0
    while all(len(each) > shared + 1 and each[shared] == parts[0][shared] for each in parts):
        shared += 1
    return [str(Path(*each[shared:])) for each in parts]


def _cell(name: str, value: float | None) -> str:
    if value is None:
        return ""
    if name == "flagged":
        return f"{100 * value:.0f} %"
    return f"{value:.2f}" if name in ("sparc", "ldlj") else f"{value:.3g}"


def _plain(value: float | str) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
