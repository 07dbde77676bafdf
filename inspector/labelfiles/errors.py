"""What can be wrong with a file of labels."""

from pathlib import Path

from inspector.errors import InspectorError


class LabelFileError(InspectorError):
    """A file of labels that cannot be read or written.

    Args:
        path: The file.
        problem: What is wrong with it, in one line.
        where: The place in the file, say "line 3", if it is in one place.
    """

    def __init__(self, path: Path, problem: str, where: str = "") -> None:
        self.path, self.problem, self.where = path, problem, where
        super().__init__(f"{path}{where and f', {where}'}: {problem}")


class EntryError(ValueError):
    """A place in a text of labels that makes no sense, to become a ``LabelFileError``.

    Args:
        problem: What is wrong, in one line.
        where: The place in the text.
    """

    def __init__(self, problem: str, where: str = "") -> None:
        self.problem, self.where = problem, where
        super().__init__(problem)
