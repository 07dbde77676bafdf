"""The files that the measures of a model are written to."""

from dataclasses import dataclass
from json import dumps
from pathlib import Path

from inspector import evaluationpicture
from models import Assessment
from noisemodel.atomic import refuse_existing, replacing


@dataclass(frozen=True)
class Outputs:
    """What to write; None is not written.

    Attributes:
        json: All measures, the curve, and each failure that was missed.
        picture: A PNG file.
        overwrite: Whether files that exist may be replaced.
    """

    json: Path | None = None
    picture: Path | None = None
    overwrite: bool = False

    def check(self) -> None:
        """Refuse what cannot be written before long work is done for it.

        Raises:
            OutputError: If a file exists and may not be replaced, or cannot be written.
            InspectorError: If matplotlib is not installed.
        """
        for path in filter(None, (self.json, self.picture)):
            refuse_existing(path, overwrite=self.overwrite)
        if self.picture:
            evaluationpicture.require()

    def write(self, assessment: Assessment, model: Path) -> None:
        """Write the files.

        Args:
            assessment: The measures.
            model: The file of the model.

        Raises:
            OutputError: If a file exists and may not be replaced, or cannot be written.
        """
        if self.json:
            with replacing(self.json, overwrite=self.overwrite) as temporary:
                temporary.write_text(as_json(assessment, model) + "\n", encoding="utf-8")
        if self.picture:
            evaluationpicture.draw(
                assessment, self.picture, title=model.stem, overwrite=self.overwrite
            )


def as_json(assessment: Assessment, model: Path) -> str:
    """Write the measures of a model as JSON.

    Args:
        assessment: The measures.
        model: The file of the model.
    """
    return dumps({"model": model.name, **assessment.as_dict()}, indent=1, allow_nan=False)
