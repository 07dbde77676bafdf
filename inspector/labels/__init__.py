"""Label files of other tools: annotated blocks read and written, findings written.

Times are those of the run, in [s]; numbers are written with all digits.
"""

from inspector.labels.entry import LabelFileError
from inspector.labels.files import read_labels, write_labels

__all__ = ["LabelFileError", "read_labels", "write_labels"]
