"""Arguments and options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

from inspector.training.part import Part

RunFile = Annotated[Path, typer.Argument(help="A run file (run.npz).", show_default=False)]
Output = Annotated[Path, typer.Option("--output", "-o", help="The file to write.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace a file that exists.")]
ModelFiles = Annotated[
    list[Path] | None,
    typer.Option(
        "--model", help="Use this model only: a file, or the name of a shipped one; repeatable."
    ),
]


def _known(kind: str) -> str:
    if kind not in KINDS:
        raise typer.BadParameter(f"{kind!r} is none of {', '.join(KINDS)}")
    return kind


KINDS = ("normal", "rms", "mean", "paper", "A", "B", "C")
"""Those of ``noisemodel``, which would take too long to import here."""
Kind = Annotated[
    str,
    typer.Option("--kind", callback=_known, help=f"Extended noise, one of {', '.join(KINDS)}."),
]
InPart = Annotated[
    Part,
    typer.Option("--part", help="All runs, those to train on, or those held out as the test set."),
]
Inputs = Annotated[
    list[Path],
    typer.Argument(help="Annotated runs, samples, folders of them, or NoisyTest folders."),
]
