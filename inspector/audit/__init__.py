"""The audit of a log: what it can show, and what it cannot."""

from inspector.audit.audit import Audit, audit
from inspector.audit.formats import shortcomings, summary
from inspector.audit.sight import ClassSight, Sight

__all__ = ["Audit", "ClassSight", "Sight", "audit", "shortcomings", "summary"]
