"""The report of a comparison, in Markdown: what changed, where, and by how much."""

from collections.abc import Iterator, Sequence

import numpy as np

from inspector.pair.changes import KINDS, changes, labelled
from inspector.pair.levels import (
    Level,
    by_band,
    by_class,
    by_link,
    link_steps,
    shared_links,
    steps,
    whole,
)
from inspector.pair.pair import Pair
from inspector.report.markdown import spoken

LINKS = 10


def report(pair: Pair) -> str:
    """Write the report of two runs.

    Args:
        pair: The runs.

    Returns:
        Markdown: verdict, events, classes, bands, links, runs, and what is not compared.
    """
    return "\n\n".join(_parts(pair)) + "\n"


def summary(pair: Pair) -> str:
    """The status of both runs and what changed, in a line."""
    found = changes(pair)
    count = {kind: sum(each.kind == kind for each in found) for kind in KINDS}
    events = "nothing found in either"
    if found:
        events = ", ".join(f"{number} {kind}" for kind, number in count.items() if number)
        events = f"{'findings' if labelled(pair) else 'annotated failures'}: {events}"
    statuses = f"{pair.before.status} → {pair.after.status}"
    return f"{statuses}; {events}; vibration {whole(pair).change:+.1f} dB"


def _parts(pair: Pair) -> Iterator[str]:
    yield f"### {pair.before.name} → {pair.after.name}"
    yield f"**{summary(pair)}**"
    found = sorted(changes(pair), key=lambda change: (KINDS.index(change.kind), change.start))
    if found:
        events = [
            (
                f"**{c.kind}**",
                spoken(c.label),
                f"{c.start:.2f} to {c.stop:.2f}",
                *_numbers(c.level),
            )
            for c in found
        ]
        title = "finding" if labelled(pair) else "annotated"
        yield _table(("", title, "time [s]", "before [dB]", "after [dB]", "change"), events)
    yield _largest(pair)
    yield f"Aligned {pair.alignment}. Changes in dB; positive is louder after."
    if classes := by_class(pair):
        yield "#### Classes"
        rows = [
            (
                spoken(each.level.name),
                *(f"{seconds:.1f}" for seconds in each.seconds),
                *_numbers(each.level),
            )
            for each in classes
            if any(each.seconds)
        ]
        head = ("class", "before [s]", "after [s]", "before", "after", "change")
        yield _table(head, rows)
    yield "#### Bands"
    yield _levels("octave", by_band(pair))
    yield "Levels of the noise in dB re 1 rad/s; of events and classes, above 10 Hz."
    if links := by_link(pair):
        yield "#### Links"
        yield _levels("link", links[:LINKS])
        yield "Sound power of the vibration above 10 Hz, in dB re 1 pW; the largest changes first."
    yield "#### Runs"
    yield _table(("", "before", "after"), list(_facts(pair)))
    if pair.remarks:
        yield "#### Remarks"
        yield "\n".join(f"- {remark}" for remark in pair.remarks)


def _largest(pair: Pair) -> str:
    """Where the level changed most, in a sentence."""
    time, level = steps(pair)
    change = level[:, 1] - level[:, 0]
    place = int(np.abs(change).argmax())
    if change[place] == 0.0:
        return "The level is the same at all times."
    links = ""
    if pair.links is not None:
        names = shared_links(pair)
        starts, changed = link_steps(pair, names)
        column = max(int(np.searchsorted(starts, time[place], side="right")) - 1, 0)
        by_name = dict(zip(names, changed[column].tolist(), strict=True))
        most = max(by_name, key=lambda name: abs(by_name[name]), default="")
        if most and by_name[most] != 0.0:
            links = f"; {most} {by_name[most]:+.0f} dB"
    return f"Largest change of level: **{change[place]:+.0f} dB at {time[place]:.2f} s**{links}."


def _facts(pair: Pair) -> Iterator[tuple[str, str, str]]:
    before, after = pair.before, pair.after
    yield "run", before.name, after.name
    yield "robot", before.run.robot or "not named", after.run.robot or "not named"
    yield "model", before.model or "none", after.model or "none"
    yield "joints", str(len(before.run.joint_names)), str(len(after.run.joint_names))
    for key in ("scenario", "seed"):
        if key in before.run.meta or key in after.run.meta:
            yield key, str(before.run.meta.get(key, "")), str(after.run.meta.get(key, ""))
    shared = f"{before.run.duration:.2f} s at {pair.rate:g} Hz"
    yield "compared", shared, shared


def _levels(head: str, rows: Sequence[Level]) -> str:
    return _table((head, "before", "after", "change"), [(r.name, *_numbers(r)) for r in rows])


def _numbers(level: Level) -> tuple[str, str, str]:
    change = f"{level.change:+.1f}" if np.isfinite(level.change) else ""
    return _number(level.before), _number(level.after), change


def _number(value: float) -> str:
    if np.isnan(value):
        return ""
    return f"{value:.1f}" if np.isfinite(value) else "silent"


def _table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    lines = [head, ("---",) * len(head), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)
