"""Two runs, before and after a change, on one time axis: new and resolved failures, levels.

    two runs -> alike (same signals, one rate) -> aligned -> the stretch that both cover
             -> two inspections, sample beside sample -> changes, levels -> recording, report

All that is compared is first brought to the same samples, so that a run and itself differ by
exactly nothing.
"""

from inspector.pair.alignment import Align, Alignment
from inspector.pair.changes import Change, changes
from inspector.pair.common import PairError
from inspector.pair.pair import Pair, compare
from inspector.pair.report import report, summary

__all__ = [
    "Align",
    "Alignment",
    "Change",
    "Pair",
    "PairError",
    "changes",
    "compare",
    "report",
    "summary",
]
