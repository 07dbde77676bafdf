"""Out again: noise, labels and scores of a run for the tools that people have."""

from inspector.export.content import Content, collect
from inspector.export.writing import export

__all__ = ["Content", "collect", "export"]
