"""Export of a run's noise, labels and scores for other tools."""

from inspector.export.content import Content, collect
from inspector.export.writing import export

__all__ = ["Content", "collect", "export"]
