"""Export of a run's noise, labels and scores for other tools."""

from inspector.export.content import Content, collect
from inspector.export.writing import LAYOUTS, export

__all__ = ["LAYOUTS", "Content", "collect", "export"]
