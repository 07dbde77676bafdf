"""`inspector listen`: the noise of runs as sound."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from inspector.commands.options import Overwrite, one_at_a_time, opened, say_warnings

if TYPE_CHECKING:
    from inspector.logs.read import Reading


def listen(
    ctx: typer.Context,
    runs: Annotated[
        list[Path],
        typer.Argument(
            help="Run files or logs; several are written at one gain.", show_default=False
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="WAV file; several get .a, .b ... in its name.")
    ],
    kind: Annotated[
        str, typer.Option("--kind", help="simplified (of joints), normal or rms (of links).")
    ] = "",
    joint: Annotated[str, typer.Option("--joint", help="The noise of this joint only.")] = "",
    link: Annotated[str, typer.Option("--link", help="The noise of this link only.")] = "",
    gain: Annotated[
        float | None,
        typer.Option(
            "--gain",
            help="In dB; at 0, full scale is 1 rad/s (or √W). By default, the peak fits.",
        ),
    ] = None,
    speed: Annotated[
        float, typer.Option("--speed", help="Playback speed; the pitch changes by the same factor.")
    ] = 1.0,
    overwrite: Overwrite = False,
) -> None:
    """Write the noise of runs as sound, one WAV file per run."""
    from inspector.export import sound as sonification

    reading: Reading = ctx.obj

    one_at_a_time(reading, len(runs))
    settings = sonification.Settings(kind, joint, link, speed)
    paths = sonification.output_paths(output, len(runs), overwrite=overwrite)
    recorded = [opened(run, reading).run for run in runs]
    for each in recorded:
        say_warnings(each)
    sounds = [sonification.sonify(each, settings) for each in recorded]
    level = sonification.common_gain(sounds) if gain is None else gain
    sonification.save(dict(zip(paths, sounds, strict=True)), level, overwrite=overwrite)
    for run, path, sound in zip(runs, paths, sounds, strict=True):
        typer.echo(f"{run}: {sound}")
        typer.echo(f"{path}: {sound.description(level)}")
