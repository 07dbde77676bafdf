"""Write the pages that are made from the code: `python docs/generate.py`; a test holds them."""

import sys
from collections import Counter
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
NOTE = "Written by `python docs/generate.py`.\n\n"


def commands() -> str:
    """The page of commands: the help of each, and its options; those of several stand once."""
    from typer.main import get_command

    from inspector.cli import LOGS, app

    command: Any = get_command(app)
    options = {
        name: [
            param
            for param in each.params
            if param.param_type_name == "option" and not param.hidden and param.name != "help"
        ]
        for name, each in command.commands.items()
    }
    rows = Counter(_row(param) for own in options.values() for param in own)
    shared = [row for row, count in rows.items() if count > 2]
    parts = [
        f"# Commands\n\n{NOTE}{_prose(command.help)} {LOGS}\n",
        "\n## Options of several commands\n",
        _table(shared),
    ]
    for name, each in command.commands.items():
        arguments = " ".join(
            (param.metavar or param.name or "").upper() + ("…" if param.nargs != 1 else "")
            for param in each.params
            if param.param_type_name == "argument"
        )
        text = _prose(each.help).removesuffix(LOGS).strip()
        parts.append(f"\n## {name}\n\n`inspector {name} {arguments}`\n\n{text}\n")
        if own := [row for row in map(_row, options[name]) if row not in shared]:
            parts.append(_table(own))
        if also := [f"`{each.opts[0]}`" for each in options[name] if _row(each) in shared]:
            parts.append(f"\nAlso {', '.join(also)}.\n")
    return "".join(parts)


def _row(param: Any) -> str:
    flags = ", ".join(f"`{flag}`" for flag in (*param.opts, *param.secondary_opts))
    text = " ".join((param.help or "").split()).replace("|", "\\|")
    return f"| {flags} | {text} |"


def _table(rows: list[str]) -> str:
    return "\n".join(("\n| option | meaning |", "|---|---|", *rows)) + "\n"


def _prose(text: str | None) -> str:
    """Help text as Markdown, without the marks that only a terminal knows."""
    lines = (text or "").replace("\b", "").replace("\f", "\n").strip().splitlines()
    return "\n".join(line.strip() for line in lines)


def log_formats() -> str:
    """The page of log formats: what the tests read, what is typed for it, and what is said."""
    sys.path.insert(0, str(HERE.parent / "tests"))
    import test_logs_formats_of_others as others
    import test_logs_kinds as kinds

    head = "| log | header | typed | said | read |\n|---|---|---|---|---|"
    rows = "\n".join(each.row for each in others.FORMATS)
    told = (
        "Each row is a log that a test writes and reads. *Typed* is what has to be added to the"
        " command, *said* what it prints. The same rules hold in all formats"
        " ([read your log](logs.md))."
    )
    public = f"## In the manner of public logs\n\n{kinds.table()}\n"
    return f"# Log formats\n\n{NOTE}{told}\n\n## CSV\n\n{head}\n{rows}\n\n{public}"


# Files of this folder, and what makes each.
PAGES = {"commands.md": commands, "log-formats.md": log_formats}


if __name__ == "__main__":
    for page, make in PAGES.items():
        (HERE / page).write_text(make(), encoding="utf-8")
