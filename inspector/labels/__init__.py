"""Labels that travel: annotated blocks and findings as files that other tools read and write.

Times are those of the run, in [s]; numbers are written so that they come back bit for bit.
"""

from inspector.labels.entry import LabelFileError
from inspector.labels.formats import write_labels
from inspector.labels.reading import read_labels

__all__ = ["LabelFileError", "read_labels", "write_labels"]
