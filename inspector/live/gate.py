"""What becomes of the findings of a stream: a line for each as it comes, and the exit status."""

import json
from collections.abc import Callable
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

from inspector.analysis.status import EXIT, Status
from inspector.expectations.expectations import Expectations
from inspector.expectations.judge import judge
from inspector.live.session import LiveSession, Summary
from inspector.verdict import Verdict, counts
from inspector.version import program_version
from noiseclassifier import Event
from noiseclassifier.labels import interval

FORMAT = "noise-live/1"
NAME = Path("live")
"""What entries of expectations call the stream."""


class Gate:
    """Applies expectations to findings while they come, and prints them.

    Args:
        expectations: What is expected, nothing unless given.

    Attributes:
        failed: Whether a finding counts so far.
    """

    def __init__(
        self,
        tell: Callable[[str], None],
        expectations: Expectations | None = None,
        *,
        as_json: bool = False,
        today: date,
    ) -> None:
        self.failed = False
        self._tell, self._as_json, self._today = tell, as_json, today
        self._expectations = expectations
        self._found: dict[tuple[str, float], Event] = {}
        self._session: LiveSession | None = None

    def watch(self, session: LiveSession) -> LiveSession:
        """Begin with a session, whose frames say how early findings may begin."""
        self._session = session
        return session

    def take(self, event: Event, over: bool) -> None:
        """Print a finding when it is there, and when it is over."""
        self._found[event.label, event.start] = event
        frame = 0.0 if self._session is None else self._session.summary.frame
        whole = Verdict(NAME, Status.FINDINGS, events=tuple(self._found.values()))
        verdict = self._judged(replace(whole, duration=event.stop), frame)
        self.failed = self.failed or event in verdict.failing
        ruled = verdict.ruled(event)
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
            self._tell(json.dumps({"format": FORMAT, **line}))
        elif not over:
            became = f" ({ruled})" if str(ruled) else ""
            self._tell(f"{event.label} from {event.start:.2f} s{event.novelty}{became}")

    def end(self, summary: Summary) -> int:
        """Print what became of the stream."""
        events, duration = tuple(summary.findings), summary.samples / summary.rate
        verdict = Verdict(NAME, summary.status, summary.model, events, duration=duration)
        verdict = self._judged(verdict, summary.frame)
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
            self._tell(json.dumps({"format": FORMAT, **line}))
            return EXIT[verdict.status]
        self._tell(str(summary))
        for event in verdict.excused:
            span = interval(event.start, event.stop)
            self._tell(f"  {event.label} from {span} does not count: {verdict.ruled(event)}")
        for missing in verdict.missing:
            self._tell(f"  {missing}")
        return EXIT[verdict.status]

    def _judged(self, verdict: Verdict, frame: float) -> Verdict:
        if self._expectations is None:
            return verdict
        return judge(verdict, self._expectations.widened(frame), today=self._today)
