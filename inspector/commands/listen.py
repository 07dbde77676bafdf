"""`inspector listen`: the noise of runs as sound files."""

from pathlib import Path
from typing import Annotated

import typer

from inspector.commands.options import Output, Overwrite


def listen(
    runs: Annotated[
        list[Path],
        typer.Argument(help="A run file, or several to hear at equal gain.", show_default=False),
    ],
    output: Output,
    kind: Annotated[
        str, typer.Option("--kind", help="simplified (of joints), normal or rms (of links).")
    ] = "",
    joint: Annotated[str, typer.Option("--joint", help="Hear this joint alone.")] = "",
    link: Annotated[str, typer.Option("--link", help="Hear this link alone.")] = "",
    gain: Annotated[
        float | None,
        typer.Option("--gain", help="In dB; at 0, full scale is 1 rad/s (or √W). Else it fits."),
    ] = None,
    speed: Annotated[
        float, typer.Option("--speed", help="Play so many times as fast, and as high.")
    ] = 1.0,
    overwrite: Overwrite = False,
) -> None:
    """Make noise audible: a WAV per run, of what would be heard, at a gain that is said."""
    from inspector.sound import sonification
    from noisemodel import Run

    settings = sonification.Settings(kind, joint, link, speed)
    paths = sonification.output_paths(output, len(runs), overwrite=overwrite)
    sounds = [sonification.sonify(Run.load(run), settings) for run in runs]
    level = sonification.common_gain(sounds) if gain is None else gain
    sonification.save(dict(zip(paths, sounds, strict=True)), level, overwrite=overwrite)
    for run, path, sound in zip(runs, paths, sounds, strict=True):
        typer.echo(f"{run}: {sound}")
        typer.echo(f"{path}: {sonification.description(sound, level)}")
