"""Audit of a log: bandwidth, observable classes, warnings."""

from inspector.audit.audit import Audit, audit
from inspector.audit.formats import shortcomings, summary
from inspector.audit.observability import ClassObservability, Observability

__all__ = [
    "Audit",
    "ClassObservability",
    "Observability",
    "audit",
    "shortcomings",
    "summary",
]
