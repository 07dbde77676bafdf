"""What becomes of the findings of a stream: a line for each as it comes, and the exit status."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from inspector.live.session import Summary
from inspector.status import EXIT, Status
from inspector.verdict import Verdict, counts
from inspector.version import program_version
from noiseclassifier import Event
from noiseclassifier.labels import interval

FORMAT = "noise-live/1"
NAME = Path("live")
"""What stands for the file of the stream."""


class Gate:
    """Prints findings while they come.

    Attributes:
        failed: Whether a finding counts so far.
    """

    def __init__(
        self,
        tell: Callable[[str], None],
        *,
        as_json: bool = False,
    ) -> None:
        self.failed = False
        self._tell, self._as_json = tell, as_json
        self._found: dict[tuple[str, float], Event] = {}

    def take(self, event: Event, over: bool) -> None:
        """Print a finding when it is there, and when it is over."""
        self._found[event.label, event.start] = event
        verdict = Verdict(NAME, Status.FINDINGS, events=tuple(self._found.values()))
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
