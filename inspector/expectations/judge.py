"""What becomes of the findings of a run by what is expected of it, and by the bounds of a gate."""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path

from inspector.analysis.status import Status
from inspector.expectations.expectations import Entry, Expectations
from inspector.verdict import Missing, Ruled, Ruling, Verdict
from noiseclassifier import Event

RULINGS = {
    "waive": Ruling.WAIVED,
    "require": Ruling.REQUIRED,
    "forbid": Ruling.FORBIDDEN,
    "allow": Ruling.ALLOWED,
}


@dataclass(frozen=True)
class Gate:
    """Findings that fail a run.

    Attributes:
        classes: Those of these classes, of all unless given.
        min_score: Those of at least this score, if given; some models have negative ones.
        min_duration: Those that last at least so long, in [s].
    """

    classes: tuple[str, ...] = ()
    min_score: float | None = None
    min_duration: float = 0.0

    def reason(self, event: Event) -> str:
        """Say why a finding does not fail a run; empty if it does."""
        if self.classes and event.label not in self.classes:
            return f"not of {', '.join(self.classes)} (--fail-on-class)"
        if self.min_score is not None and event.score < self.min_score:
            return f"score {event.score:.2f} below {self.min_score:g} (--min-score)"
        duration = event.stop - event.start
        if duration < self.min_duration:
            return f"{duration:.2f} s, shorter than {self.min_duration:g} s (--min-duration)"
        return ""


def judge(
    verdict: Verdict,
    expectations: Expectations | None = None,
    *,
    gate: Gate | None = None,
    today: date,
) -> Verdict:
    """Apply expectations and a gate to what was found in a run.

    Args:
        verdict: What was found, localised if the expectations name joints.
        expectations: What is expected of it, nothing unless given.
        gate: The findings that fail a run, all unless given; missing ones always do.
        today: The day on which waivers are still valid or not.

    Returns:
        The verdict with what became of each finding, with what is missing, and with the status
        that follows: a run whose findings are all expected is `ok`.
    """
    if verdict.status in (Status.BAD_INPUT, Status.INTERNAL_ERROR):
        return verdict
    rulings: dict[Event, Ruled] = {}
    missing: tuple[Missing, ...] = ()
    if expectations is not None:
        entries = expectations.of(verdict.path, verdict.scenario)
        rulings = _rulings(verdict, entries, fail_others=expectations.fail_others, today=today)
        missing = tuple(_missing(verdict, entries))
    for event in verdict.events:
        reason = gate.reason(event) if gate and rulings.get(event, Ruled()).ruling.fails else ""
        if reason:
            rulings[event] = Ruled(Ruling.FILTERED, reason)
    judged = replace(
        verdict,
        rulings={event: ruled for event, ruled in rulings.items() if ruled != Ruled()},
        missing=missing,
        expectations="" if expectations is None else str(expectations.path),
    )
    if judged.failing or judged.missing:
        return replace(judged, status=Status.FINDINGS)
    if verdict.status is Status.FINDINGS:
        return replace(judged, status=Status.OK)
    return judged


def without_run(
    verdicts: Sequence[Verdict], expectations: Expectations, folders: Iterable[Path]
) -> Verdict | None:
    """Give the verdict on required findings of runs that there are none of: a log is missing.

    Args:
        verdicts: Those on all runs.
        expectations: What is expected of them.
        folders: Folders all of whose runs these are.

    Returns:
        A verdict on the file of expectations, with what is missing; None if nothing is.
    """
    top = expectations.path.parent.resolve()
    below = {folder.resolve() for folder in folders}
    names = {f"{each.relative_to(top)}/" if top in each.parents else "" for each in below}
    covered = {entry for each in verdicts for entry in expectations.of(each.path, each.scenario)}
    missing = tuple(
        _lacking(entry, "; ".join(filter(None, (entry.reason, _no_run(entry)))))
        for entry in expectations.entries
        if entry.kind == "require" and entry not in covered and any(map(entry.asked_in, names))
    )
    if not missing:
        return None
    path = expectations.path
    return Verdict(path, Status.FINDINGS, missing=missing, expectations=str(path))


def _no_run(entry: Entry) -> str:
    return f"{entry.name}: no run is {' or '.join(entry.runs or entry.scenario)}"


def _rulings(
    verdict: Verdict, entries: Sequence[Entry], *, fail_others: bool, today: date
) -> dict[Event, Ruled]:
    rulings: dict[Event, Ruled] = {}
    budgets: defaultdict[Entry, list[Event]] = defaultdict(list)
    for event in verdict.events:
        matching = [entry for entry in entries if _matches(entry, event, verdict)]
        valid = [entry for entry in matching if not entry.expired(today)]
        if valid and valid[0].kind == "budget":
            budgets[valid[0]].append(event)
        elif valid:
            rulings[event] = Ruled(RULINGS[valid[0].kind], valid[0].reason)
        elif matching:
            (waiver, *_) = matching
            rulings[event] = Ruled(Ruling.EXPIRED, f"{waiver.until}, {waiver.reason}")
        elif not fail_others:
            rulings[event] = Ruled(Ruling.ALLOWED, "no entry is about it")
        else:
            rulings[event] = Ruled(reason=_blind(verdict, event, entries))
    for entry, events in budgets.items():
        over = _over(entry, events, verdict.duration)
        ruling = Ruling.OVER_BUDGET if over else Ruling.IN_BUDGET
        reason = "; ".join(part for part in (over, entry.reason) if part)
        rulings |= dict.fromkeys(events, Ruled(ruling, reason))
    return rulings


def _over(entry: Entry, events: Sequence[Event], duration: float) -> str:
    """Say by what findings exceed a budget; empty if they do not."""
    if entry.findings is not None and len(events) > entry.findings:
        return f"{len(events)} findings, at most {entry.findings}"
    taken = 100.0 * sum(event.stop - event.start for event in events) / (duration or 1.0)
    if entry.percent is not None and taken > entry.percent:
        return f"{taken:.1f} % of the time, at most {entry.percent:g} %"
    return ""


def _missing(verdict: Verdict, entries: Sequence[Entry]) -> list[Missing]:
    if verdict.status is Status.CANNOT_TELL:
        return []  # what cannot be seen is not missing
    missing = []
    for entry in entries:
        found = any(_matches(entry, event, verdict) for event in verdict.events)
        if entry.kind == "require" and not found:
            missing.append(_lacking(entry, entry.reason))
    return missing


def _lacking(entry: Entry, reason: str) -> Missing:
    earliest, latest = entry.onset or (None, None)
    return Missing(" or ".join(entry.classes), earliest, latest, reason)


def _matches(entry: Entry, event: Event, verdict: Verdict) -> bool:
    return entry.matches(event.label, event.start, event.stop, _joint(verdict, event))


def _joint(verdict: Verdict, event: Event) -> str | None:
    """The joint with the largest share in a finding; None if it is not known."""
    known = verdict.localisations.get(event)
    return known.joints[0][0] if known is not None and known.joints else None


def _blind(verdict: Verdict, event: Event, entries: Sequence[Entry]) -> str:
    """Name the entry that would be about a finding if its joints were known; empty if none."""
    if _joint(verdict, event) is not None:
        return ""
    for entry in entries:
        anywhere = replace(entry, joints=())
        if entry.joints and anywhere.matches(event.label, event.start, event.stop, None):
            return f"its joints are not known, which {entry.name} names"
    return ""
