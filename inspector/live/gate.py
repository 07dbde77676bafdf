"""What becomes of the findings of a stream: a line for each as it comes, and the exit status."""

import json
from collections.abc import Callable
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

from inspector.errors import EXIT, Status
from inspector.live.session import Summary
from inspector.reference.judging import GAP
from inspector.reference.levels import Levels
from inspector.reference.store import Reference
from inspector.reference.verdicts import beside, judge
from inspector.text import program_version
from inspector.verdict import Evidence, Verdict, counts
from noiseclassifier import Event
from noiseclassifier.labels import interval

FORMAT = "noise-live/1"
NAME = Path("live")
"""What stands for the file of the stream."""


class Gate:
    """Prints findings while they come.

    Args:
        reference: What the stream is compared with, a stretch after the other while it runs and as
            a whole at its end; None leaves it to the model.

    Attributes:
        failed: Whether a finding counts so far.
    """

    def __init__(
        self,
        tell: Callable[[str], None],
        *,
        as_json: bool = False,
        reference: Reference | None = None,
    ) -> None:
        self.failed = False
        self._tell, self._as_json = tell, as_json
        self._reference = reference
        self._found: dict[tuple[str, float], Event] = {}
        self._told: dict[Event, Evidence] = {}
        self._begin: float | None = None  # of what was compared so far
        self._heard = 0.0

    def take(self, event: Event, over: bool) -> None:
        """Print a finding when it is there, and when it is over; beside a reference, keep it."""
        self._found[event.label, event.start] = event
        if self._reference is None:
            verdict = Verdict(NAME, Status.FINDINGS, events=tuple(self._found.values()))
            self._print(verdict, event, over=over)

    def compare(self, latest: Levels) -> None:
        """Print the findings in the latest stretch of the stream beside the reference, each once.

        Args:
            latest: Levels of the last 6 s, 3 s of which have been there before.
        """
        if self._begin is None:
            self._begin = self._heard = latest.start
        found = tuple(self._found.values())
        verdict = self._beside(Verdict(NAME, Status.OK, events=found, begin=self._begin), latest)
        for event in verdict.failing:
            if event.start > latest.time[-1] or event.stop < latest.start:
                continue
            if event.start >= self._heard:
                self._told[event] = verdict.evidence[event]
                self._print(verdict, event, over=False)
            self._heard = max(self._heard, event.stop + GAP)

    def _print(self, verdict: Verdict, event: Event, *, over: bool) -> None:
        self.failed = self.failed or event in verdict.failing
        ruled, evidence = verdict.ruled(event), verdict.evidence.get(event)
        if self._as_json:
            line: dict[str, Any] = {
                "event": "end" if over else "begin",
                "label": event.label,
                "start": round(event.start, 6),
                "stop": round(event.stop, 6) if over else None,
                "score": round(event.score, 6),
                "novel": event.novel,
                "fails": ruled.ruling.fails,
                "ruling": ruled.ruling.value,
                "reason": ruled.reason,
            }
            if evidence is not None:
                line["evidence"] = evidence.as_dict()
            self._tell(json.dumps({"format": FORMAT, **line}))
        elif not over:
            became = f" ({ruled})" if str(ruled) else f": {evidence}" if evidence else ""
            self._tell(f"{event.label} from {event.start:.2f} s{event.novelty}{became}")

    def end(self, summary: Summary) -> int:
        """Print what became of the stream."""
        verdict, duration = self._verdict(summary), summary.samples / summary.rate
        if self._as_json:
            line = {
                "event": "summary",
                "version": program_version(),
                "status": verdict.status.value,
                "exit_status": EXIT[verdict.status],
                "reason": summary.reason if verdict.status is Status.CANNOT_TELL else "",
                "model": summary.model,
                "samples": summary.samples,
                "duration": round(duration, 6),
                "frames": dict(summary.labels),
                "counts": counts([verdict])["findings"],
                "missing": [str(each) for each in verdict.missing],
                "warnings": dict(summary.warnings),
                "where": summary.where,
            }
            if self._reference is not None:
                known = verdict.as_dict()
                line |= {"reference": known["reference"], "findings": known["events"]}
            self._tell(json.dumps({"format": FORMAT, **line}))
            return EXIT[verdict.status]
        shown = summary.findings if self._reference is None else verdict.failing
        self._tell(str(replace(summary, status=verdict.status, findings=shown)))
        for event, evidence in verdict.evidence.items():
            if not evidence.excused:
                span = interval(event.start, event.stop)
                self._tell(f"  {event.label} from {span}: {evidence}")
        for event in verdict.excused:
            span = interval(event.start, event.stop)
            self._tell(f"  {event.label} from {span} does not count: {verdict.ruled(event)}")
        for missing in verdict.missing:
            self._tell(f"  {missing}")
        if verdict.beside is not None:
            self._tell(f"compared with {verdict.beside.path}: {verdict.beside.words}")
        return EXIT[verdict.status]

    def _verdict(self, summary: Summary) -> Verdict:
        """The verdict on the whole stream."""
        verdict = Verdict(
            NAME,
            summary.status,
            summary.model,
            tuple(summary.findings),
            duration=summary.samples / summary.rate,
        )
        if self._reference is None or (summary.levels is None and self._begin is None):
            return verdict
        if summary.levels is None:  # too long to be compared as a whole
            status = Status.FINDINGS if self._told else Status.OK
            verdict = replace(
                verdict, status=status, events=tuple(self._told), evidence=dict(self._told)
            )
        else:
            verdict = replace(verdict, begin=summary.levels.start)
            verdict = self._beside(verdict, summary.levels)
        if summary.status is Status.CANNOT_TELL and summary.model and verdict.status is Status.OK:
            return replace(verdict, status=Status.CANNOT_TELL)  # too little of it was seen
        return verdict

    def _beside(self, verdict: Verdict, levels: Levels) -> Verdict:
        assert self._reference is not None
        verdict = beside(verdict, self._reference.compare(levels), self._reference)
        return judge(verdict, self._reference, today=date.today())
