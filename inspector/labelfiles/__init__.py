"""Labels that travel: annotated blocks and findings as files that other tools read and write.

Times are those of the run, in [s]; numbers are written so that they come back bit for bit.
"""

from inspector.labelfiles.errors import LabelFileError
from inspector.labelfiles.reading import read_labels
from inspector.labelfiles.writing import write_labels

__all__ = ["LabelFileError", "read_labels", "write_labels"]
