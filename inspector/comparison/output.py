"""The files that a comparison of noise models is written to."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from inspector.comparison import picture
from inspector.comparison.compared import Compared
from inspector.comparison.csv import write_csv
from inspector.errors import InspectorError
from noisemodel.atomic import refuse_existing

MOST = 8
"""Robots that a recording may hold; more make it too slow to look at."""


@dataclass(frozen=True)
class Outputs:
    """What to write; None is not written.

    Attributes:
        csv: All numbers.
        recording: For the viewer.
        picture: A PNG file.
        overwrite: Whether files that exist may be replaced.
    """

    csv: Path | None = None
    recording: Path | None = None
    picture: Path | None = None
    overwrite: bool = False

    def check(self, count: int) -> None:
        """Refuse what cannot be written before long work is done for it.

        Args:
            count: How many robots and runs will be compared.

        Raises:
            OutputError: If a file exists and may not be replaced, or cannot be written.
            InspectorError: If a recording cannot hold so many, or matplotlib is not installed.
        """
        for path in filter(None, (self.csv, self.recording, self.picture)):
            refuse_existing(path, overwrite=self.overwrite)
        if self.recording and count > MOST:
            raise InspectorError(
                f"{self.recording}: a recording holds {MOST} robots and runs at most, not {count};"
                " name some of them, or write --csv and --picture alone"
            )
        if self.picture:
            picture.require()

    def write(self, found: Sequence[Compared]) -> None:
        """Write the files.

        Args:
            found: One comparison or more, of the same kinds.

        Raises:
            OutputError: If a file exists and may not be replaced, or cannot be written.
        """
        if self.csv:
            write_csv(found, self.csv, overwrite=self.overwrite)
        if self.recording:
            from inspector.comparison.recording import write

            write(found, self.recording, overwrite=self.overwrite)
        if self.picture:
            picture.draw(found, self.picture, overwrite=self.overwrite)
