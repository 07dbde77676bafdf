"""`inspector config`, and the settings of a project that it prints.

They are in `[tool.noise-inspector]` in pyproject.toml, or in inspector.toml.

The nearest of these files counts, from the working folder up to the top of the repository. Keys are
the long names of options, without dashes before them. Options on reading logs, `model` and `jobs`
stand at the top and hold for all commands that have them; a table such as
``[tool.noise-inspector.classify]`` is for one command, with its arguments (``runs``). The
command line wins. Nothing that is written can be set here: a file must not replace others.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer

from inspector.errors import OptionError

FILES = ("inspector.toml", "pyproject.toml")
TABLE = "noise-inspector"
PATHS = frozenset(("mapping", "desired", "model", "reference", "candidate", "runs", "package-root"))
"""Settings that are paths, which are meant from the folder of the file."""


@dataclass(frozen=True)
class Config:
    """Settings, by command and for all.

    Attributes:
        path: Their file.
        shared: Those of all commands.
        own: Those of each command.
    """

    path: Path
    shared: Mapping[str, Any]
    own: Mapping[str, Mapping[str, Any]]

    def of(
        self,
        name: str,
        options: Mapping[str, str],
        shared: frozenset[str],
        *,
        applied: frozenset[str],
    ) -> dict[str, Any]:
        """The settings of a command, by the names of its parameters.

        Args:
            options: The parameter of each setting that the command has.
            applied: Those of them that mean in this command what they mean in others.
        """
        own = self.own.get(name, {})
        for where, given, known in (
            ("", self.shared, shared),
            (f" [{name}]", own, frozenset(options)),
        ):
            for key in given:
                if key not in known:
                    raise _unknown(self.path, where, key, known)
        settings = {key: value for key, value in self.shared.items() if key in applied} | {**own}
        return {
            options[key]: self._meant(key, value)
            for key, value in settings.items()
            if key in options
        }

    def _meant(self, key: str, value: Any) -> Any:
        """A value, a path from the folder of the file."""
        if isinstance(value, list):
            return [self._meant(key, each) for each in value]
        of_robot = key == "robot" and str(value).endswith((".urdf", ".xml"))
        if not isinstance(value, str) or not (key in PATHS or of_robot):
            return value
        there = self.path.parent / value
        return str(there) if there.exists() or key != "model" else value

    def lines(self) -> Iterator[str]:
        """The settings as they are written."""
        for table, settings in (("", self.shared), *self.own.items()):
            for key, value in settings.items():
                yield f"{table + '.' if table else ''}{key} = {value!r}".replace("'", '"')


def find(start: Path | None = None) -> Config | None:
    """Read the nearest file of settings.

    Args:
        start: Where to begin, the working folder unless given.
    """
    start = (start or Path.cwd()).absolute()
    for folder in (start, *start.parents):
        for name in FILES:
            if (folder / name).exists():
                found = _read(folder / name)
                if found is not None:
                    return found
        if (folder / ".git").exists():
            break
    return None


def _read(path: Path) -> Config | None:
    """The settings of a file; None of a pyproject.toml without any."""
    import tomllib

    try:
        if not path.is_file() or path.stat().st_size > 2**20:
            raise ValueError("no file of less than 1 MB")
        content: Any = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        if path.name != FILES[0] and f"[tool.{TABLE}" not in _start(path):
            return None  # a file of others, wrong in ways that are none of ours
        raise OptionError(f"{path}: cannot be read ({error})") from error
    if path.name == FILES[1]:
        tools = content.get("tool")
        content = tools.get(TABLE) if isinstance(tools, dict) else None
        if content is None:
            return None
    if not isinstance(content, dict):
        raise OptionError(f"{path}: [tool.{TABLE}] is no table")
    own = {key: value for key, value in content.items() if isinstance(value, dict)}
    return Config(path, {k: v for k, v in content.items() if k not in own}, own)


def _start(path: Path) -> str:
    """The first megabyte of a file as text."""
    if not path.is_file():
        return ""
    with path.open(encoding="utf-8", errors="replace") as stream:
        return stream.read(2**20)


def _unknown(path: Path, where: str, key: str, known: frozenset[str]) -> OptionError:
    from noisemodel.types import hint

    return OptionError(f"{path}:{where} no setting {key!r}{hint(key, sorted(known))}")


def config(ctx: typer.Context) -> None:
    """Print the settings of this project that are in force.

    They are in inspector.toml, or in the table tool.noise-inspector of pyproject.toml: options on
    reading logs, model and jobs for all commands, and a table for each command, such as classify.
    The command line wins.
    """
    found = find()
    if found is None:
        typer.echo("no settings: no inspector.toml, no [tool.noise-inspector] in pyproject.toml")
        return
    group: Any = ctx.parent and ctx.parent.command
    for name in found.own:
        if name not in group.commands:
            raise OptionError(f"{found.path}: no command {name!r}")
    for name in group.commands:
        group.settings(name, found)  # refuses what is not known
    typer.echo(f"{found.path}:")
    for line in found.lines():
        typer.echo(f"  {line}")
