"""Text: what a terminal, a CI's log, TOML or a spreadsheet would take for more; progress."""

import re
import sys
from collections.abc import Iterable, Iterator
from datetime import date, time
from time import monotonic
from typing import TypeVar

T = TypeVar("T")

# Control characters, ends of lines, and what turns the direction of writing.
CONTROL = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\u200e\u200f\u202a-\u202e\u2066-\u2069]")
FORMULA = ("=", "+", "-", "@")  # what a cell begins with that a spreadsheet computes
EVERY = 10.0  # time between two lines of progress, in [s]


def printable(text: str) -> str:
    """Write out control characters and ends of lines, as Python's escapes."""
    return CONTROL.sub(lambda found: found.group().encode("unicode_escape").decode(), text)


def cell(text: str) -> str:
    """Text as a cell of a CSV: a quotation mark before what would be a formula; see `uncell`."""
    return f"'{text}" if text.startswith((*FORMULA, "'")) else text


def uncell(text: str) -> str:
    """The text that `cell` was given."""
    return text[1:] if text.startswith(tuple(f"'{each}" for each in (*FORMULA, "'"))) else text


def counted(number: int, noun: str) -> str:
    """A number with its noun, whose plural takes an s: "1 finding", "2 findings"."""
    return f"{number} {noun}{'s' * (number != 1)}"


def natural(text: str) -> list[tuple[int, str]]:
    """Sorts texts by the numbers in them: pick-9 before pick-10."""
    parts = re.split(r"(\d+)", text)
    return [(int(each), "") if each.isdecimal() else (-1, each) for each in parts]


def plain(value: float, digits: int = 3) -> str:
    """A number rounded to significant digits, without an exponent up to a million: "3540"."""
    return f"{float(f'{value:.{digits}g}'):g}"


def program_version() -> str:
    """The version that is installed; "0" of a program that is run from its folder."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("noise-inspector")
    except PackageNotFoundError:
        return "0"


def progress(items: Iterable[T], what: str, *, total: int) -> Iterator[T]:
    """Items as they come, with a progress bar on a terminal, or a line every 10 s elsewhere."""
    if total < 2:
        return iter(items)
    if not sys.stderr.isatty():
        return _lines(items, what, total)
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    return iter(track(items, what, total=total, console=console, transient=True))


def _lines(items: Iterable[T], what: str, total: int) -> Iterator[T]:
    begun = said = monotonic()
    for number, item in enumerate(items, start=1):
        yield item
        now = monotonic()
        if now - said >= EVERY and number < total:
            said = now
            left = (now - begun) / number * (total - number)
            print(f"{what}: {number} of {total}, {left:.0f} s left", file=sys.stderr, flush=True)


def toml_shown(value: object) -> str:
    """A value of a TOML text about as it stands there, for messages."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, date | time):  # of a day with a time, too
        return str(value)
    if isinstance(value, list):
        return f"[{', '.join(map(toml_shown, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key} = {toml_shown(each)}' for key, each in value.items())}}}"
    return repr(value)
