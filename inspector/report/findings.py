"""Findings in a line, alike in all formats, and runs of one scenario folded into a row."""

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from inspector.errors import Status
from inspector.localisation.stage import Localisation
from inspector.text import counted
from inspector.verdict import Verdict
from noiseclassifier import Event
from noiseclassifier.labels import interval

REPETITION = re.compile(r"(?P<name>.+?)[-_.](?:run|rep|take|seed)?[-_.]?\d+")
"""Name of a file that is one of several: ``walk-1``, ``walk_run2``, ``walk-seed-003``."""
TOGETHER = 0.25
"""Onsets this close, of one class or joint in repetitions, are one row, in [s]: the hop of frames
is 0.1 s or 0.2 s."""
WORDS = {
    Status.INTERNAL_ERROR: "internal error",
    Status.BAD_INPUT: "bad input",
    Status.FINDINGS: "FAIL",
    Status.CANNOT_TELL: "cannot tell",
    Status.OK: "ok",
}
"""How people read a status."""
COUNTED = WORDS | {Status.FINDINGS: "with findings"}
"""How people count them."""
LEAST = 0.05
"""Joints with a smaller share are left out."""
PRECISE = 10.0
"""A lag is given to a tenth of a millisecond up to this, in [ms]."""
Item = TypeVar("Item")
Row = tuple[str, str, str, str, str]
"""Time, class, joints, band, and what else is known of a finding."""


def words(found: Localisation, *, quote: str = "") -> tuple[str, str, str]:
    """A localisation in words.

    Args:
        quote: Mark around the names of stages, say a backtick in Markdown.

    Returns:
        Stage and its lead over the next, joints and their shares, and frequency band; each is
        empty if it is not known.
    """
    stage = f"{quote}{found.stage}{quote}" if found.stage else ""
    if found.lag > 0.0:
        lag_ms = 1e3 * found.lag
        lead = f"{lag_ms:.1f} ms" if lag_ms < PRECISE else f"{lag_ms:.0f} ms"
        stage = f"{stage}, {lead} before {quote}{found.following}{quote}"
    joints = ", ".join(f"{joint} {share:.0%}" for joint, share in found.joints if share >= LEAST)
    low, high = (f"{frequency:.0f}" for frequency in found.band or (0.0, 0.0))
    band = f"{low} Hz" if low == high else f"{low}-{high} Hz"
    return stage, joints, band if found.band else ""


def row(verdict: Verdict, event: Event, runs: str = "") -> Row:
    """A finding as cells of a table; `runs` says in how many repetitions it is."""
    known = verdict.localisations.get(event)
    _, joints, band = words(known) if known else ("", "", "")
    evidence, order = verdict.evidence.get(event), verdict.orders.get(event)
    over = ""
    if evidence is not None and not evidence.excused:
        over = "by the general model"
    if evidence is not None and evidence.db is not None and not evidence.excused:
        over = f"{evidence.db:+.0f} dB over {_compared(verdict, evidence.kind)}"
        joints = joints or evidence.joint
        if evidence.octave and not band:
            band = f"{evidence.octave[0]:.0f}-{evidence.octave[1]:.0f} Hz"
    ruled = f"({verdict.ruled(event)})" if str(verdict.ruled(event)) else ""
    rest = (event.novelty.removeprefix(", "), str(order or ""), over, runs, ruled)
    when = f"{event.start:6.2f} - {event.stop:6.2f} s"
    return when, event.label, joints, band, ", ".join(filter(None, rest)).replace(", (", " (")


def _compared(verdict: Verdict, kind: str) -> str:
    """What a finding is louder than, with the number of repetitions where that is known."""
    number = verdict.beside.repetitions if verdict.beside else 0
    return counted(number, "repetition") if number and kind == "repetitions" else kind


def sentence(verdict: Verdict, event: Event, runs: str = "") -> str:
    """The same as a sentence."""
    _, label, joints, band, rest = row(verdict, event, runs)
    parts = [f"{label} from {interval(event.start, event.stop)}", joints, band, rest]
    return ", ".join(filter(None, parts)).replace(", (", " (")


def brief(verdict: Verdict, event: Event) -> str:
    """The same with nothing before what, when and where, for lines that are cut."""
    _, label, joints, band, rest = row(verdict, event)
    parts = [f"{label} {event.start:.2f}-{event.stop:.2f} s", joints, band, rest]
    return ", ".join(filter(None, parts)).replace(", (", " (")


def failing(verdict: Verdict) -> list[str]:
    """Sentences on what fails a run."""
    found = [sentence(verdict, event) for event in verdict.failing]
    return [*found, *map(str, verdict.missing)]


def excused(verdict: Verdict) -> list[str]:
    """Sentences on findings that do not."""
    return [sentence(verdict, event) for event in verdict.excused]


@dataclass(frozen=True)
class Group:
    """The runs of one scenario, the worst first, or a single run, by its path."""

    name: str
    verdicts: Sequence[Verdict]

    @property
    def worst(self) -> Verdict:
        """The verdict that stands for all."""
        return self.verdicts[0]

    def found(self, *, fails: bool) -> list[tuple[Verdict, Event, str]]:
        """Findings that fail their runs, or that do not; repetitions of one finding count once."""
        every = [
            (verdict, event)
            for verdict in self.verdicts
            for event in (verdict.failing if fails else verdict.excused)
        ]
        several = len(self.verdicts)
        result = []
        for each in folded(every, _alike):
            number = len({id(verdict) for verdict, _ in each})
            runs = f"{number} of {counted(several, 'run')}" if several > 1 else ""
            (label, _), *_ = Counter(event.label for _, event in each).most_common(1)
            named = [one for one in each if one[1].label == label]
            result.append((*max(named, key=lambda one: one[1].score), runs))
        return result

    @property
    def words(self) -> str:
        """What became of it: a scenario may be missing or cut."""
        if self.worst.missing and not self.worst.failing:
            return self.worst.missing[0].words
        return WORDS[self.worst.status]

    @property
    def missing(self) -> list[str]:
        """Required findings that were not found."""
        return list(dict.fromkeys(each.told for one in self.verdicts for each in one.missing))

    @property
    def sentences(self) -> list[str]:
        """Sentences on what fails its runs."""
        return [*(sentence(*each) for each in self.found(fails=True)), *self.missing]

    @property
    def notes(self) -> list[str]:
        """Sentences on findings that do not."""
        return [sentence(*each) for each in self.found(fails=False)]


def folded(items: Sequence[Item], alike: Callable[[Item, Item], bool]) -> list[list[Item]]:
    """Groups of items that are like the first one of their group, in order."""
    groups: list[list[Item]] = []
    for item in items:
        group = next((each for each in groups if alike(each[0], item)), None)
        if group is None:
            groups.append(group := [])
        group.append(item)
    return groups


def each_missing(verdicts: Sequence[Verdict]) -> list[Verdict]:
    """The verdicts with one for each scenario that has no log."""
    found: list[Verdict] = []
    for verdict in verdicts:
        absent = [replace(verdict, missing=(each,)) for each in verdict.missing]
        found += [verdict] if verdict.of_run else absent
    return found


def groups(verdicts: Sequence[Verdict]) -> list[Group]:
    """Runs by scenario, the worst first.

    A scenario is what runs of one folder name so, or have one name but for a number, and one that
    has no log. What could not be read stays alone.
    """
    found: dict[tuple[str, str], list[Verdict]] = {}
    absent = []
    for verdict in sorted(each_missing(verdicts), key=lambda each: each.severity):
        if verdict.of_run:
            found.setdefault(_key(verdict), []).append(verdict)
        else:
            absent.append(Group(verdict.missing[0].scenario, [verdict]))
    return absent + [
        Group(name if len(each) > 1 else str(each[0].path), each)
        for (_, name), each in found.items()
    ]


def _key(verdict: Verdict) -> tuple[str, str]:
    """Folder and scenario of a run."""
    path, alone = verdict.path, verdict.status in (Status.BAD_INPUT, Status.INTERNAL_ERROR)
    if alone:
        return str(path), ""
    repeated = REPETITION.fullmatch(path.stem)
    name = verdict.scenario or (str(path.with_name(repeated["name"])) if repeated else str(path))
    return str(path.parent), name


def _alike(one: tuple[Verdict, Event], other: tuple[Verdict, Event]) -> bool:
    """Whether two findings of repetitions are one."""
    (first, event), (second, same) = one, other
    known, other_known = first.evidence.get(event), second.evidence.get(same)
    joint = known.joint if known and other_known and known.joint == other_known.joint else ""
    return (
        (event.label == same.label or bool(joint))
        and abs(event.start - same.start) <= TOGETHER
        and first.ruled(event) == second.ruled(same)
        and (first is not second or event is same)
    )


def timeline(verdict: Verdict, width: int = 60) -> str:
    """The findings that fail a run over time as text, a line for each class and joint."""
    if not verdict.duration:
        return ""
    lines: dict[tuple[str, str], list[str]] = {}
    for event in verdict.failing:
        marks = lines.setdefault((event.label, _joint(verdict, event)), ["."] * width)
        times = (event.start - verdict.begin, event.stop - verdict.begin)
        first, last = (int(width * time / verdict.duration) for time in times)
        marks[max(first, 0) : last + 1] = "#" * (min(last + 1, width) - max(first, 0))
    rows = [(*of, f"|{''.join(marks)}| {verdict.duration:.1f} s") for of, marks in lines.items()]
    return "\n".join(table(rows, gap="  "))


def _joint(verdict: Verdict, event: Event) -> str:
    """The joint of a finding; empty if it is not known."""
    known, where = verdict.evidence.get(event), verdict.localisations.get(event)
    if where is not None and where.joints:
        return where.joints[0][0]
    return known.joint if known else ""


def table(rows: Sequence[Sequence[str]], gap: str = "   ") -> list[str]:
    """Lines of cells, each column as wide as its widest cell.

    A row of fewer cells ends with a sentence, which may reach over the columns to its right.
    """
    most = max(map(len, rows), default=0)
    widths = [0] * most
    for cells in rows:
        for place, cell in enumerate(cells if len(cells) == most else cells[:-1]):
            widths[place] = max(widths[place], len(cell))
    lines = []
    for cells in rows:
        padded = [cell.ljust(width) for cell, width in zip(cells, widths, strict=False)]
        used = [cell for cell, width in zip(padded, widths, strict=False) if width or cell]
        lines.append(gap.join(used).rstrip())
    return lines
