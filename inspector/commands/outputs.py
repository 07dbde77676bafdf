"""Outputs of one result: standard output and files in several formats, and what is lost of them."""

import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TypeVar

import typer

Result = TypeVar("Result")


def files_of(given: Sequence[str], known: Collection[str], *, overwrite: bool) -> dict[Path, str]:
    """The files of `--write FORMAT=FILE`, with the format of each.

    Raises:
        BadParameter: If one is not of that form.
        OutputError: If a file exists, or is read.
    """
    from noisemodel.files import refuse_existing

    files = {}
    for each in given:
        name, equals, path = each.partition("=")
        if name not in known or not equals or path in ("", "-"):
            raise typer.BadParameter(
                f"{each!r}: expected FORMAT=FILE, with one of {', '.join(known)}",
                param_hint="'--write'",
            )
        refuse_existing(path, overwrite=overwrite)
        if Path(path) in files:
            raise typer.BadParameter(f"{path}: is named twice", param_hint="'--write'")
        files[Path(path)] = name
    return files


def written(
    result: Result,
    formats: Mapping[str, Callable[[Result], str]],
    printed: str,
    files: Mapping[Path, str],
    *,
    overwrite: bool,
) -> list[str]:
    """Print a result in one format, and write it to files in others.

    Returns:
        What was lost, a sentence each.
    """
    lost = tried(lambda: _print(formats[printed](result)), "standard output")
    for path, name in files.items():
        lost += tried(partial(_write, path, formats[name], result, overwrite=overwrite), str(path))
    return lost


def tried(output: Callable[[], object], name: str) -> list[str]:
    """Write an output; a sentence if it is lost."""
    from noisemodel import OutputError

    try:
        output()
    except OutputError as error:
        return [str(error)]
    except OSError as error:
        return [f"{name}: cannot be written ({error.strerror or error})"]
    return []


def _print(text: str) -> None:
    typer.echo(text)
    sys.stdout.flush()


def _write(path: Path, write: Callable[[Result], str], result: Result, *, overwrite: bool) -> None:
    from noisemodel.files import replacing

    with replacing(path, overwrite=overwrite) as temporary:
        temporary.write_text(f"{write(result)}\n", encoding="utf-8")
