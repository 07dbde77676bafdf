"""Arguments that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

RunFile = Annotated[Path, typer.Argument(help="A run file (run.npz).", show_default=False)]
Output = Annotated[Path, typer.Option("--output", "-o", help="The file to write.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace a file that exists.")]
ModelFiles = Annotated[
    list[Path] | None,
    typer.Option("--model", help="A model to use instead of those that ship; may be repeated."),
]
Kind = Annotated[
    str, typer.Option("--kind", help="Extended noise: normal, rms, mean, paper, A, B or C.")
]
Inputs = Annotated[
    list[Path],
    typer.Argument(help="Annotated runs, samples, folders of them, or NoisyTest folders."),
]
