"""JSON and TOML parsed within limits, so that a hostile text is one ``ValueError``."""

import json
import re
import stat
import tomllib
from pathlib import Path
from typing import Any

MAX_CHARACTERS = 64 * 2**20  # longest text that is parsed: a hundred times the longest manifest
MAX_TOML = 16 * 2**20  # of TOML, of which `tomllib` reads two megabytes in a second
DIGITS = 20  # most digits of an integer: enough for 64 bits
PARTS = 100  # most parts of a TOML key; `tomllib` takes memory by their square
LONG_KEY = re.compile(
    rf"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*"|'[^'\n]*')[ \t]*+\.[ \t]*+){{{PARTS}}}"""
)


def text_of(path: str | Path) -> str:
    """Text of a regular file in UTF-8, with or without a byte order mark."""
    path = Path(path)  # a device or a pipe may have no end
    about = path.stat()
    if not (stat.S_ISREG(about.st_mode) or stat.S_ISDIR(about.st_mode)):
        raise ValueError("is no regular file; save what it holds to one")
    if about.st_size > MAX_CHARACTERS:
        raise ValueError(f"{about.st_size} bytes, the limit is {MAX_CHARACTERS}")
    try:
        return path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError("not text in UTF-8") from error


def from_json(text: str | bytes) -> Any:
    """Value of a JSON text."""
    _check_length(text, MAX_CHARACTERS)
    try:
        return json.loads(text, parse_int=_whole)
    except RecursionError as error:
        raise ValueError("nested too deeply") from error


def from_toml(text: str) -> dict[str, Any]:
    """Table of a TOML text."""
    _check_length(text, MAX_TOML)
    if LONG_KEY.search(text):
        raise ValueError(f"a key of more than {PARTS} parts")
    try:
        table = tomllib.loads(text)
    except RecursionError as error:
        raise ValueError("nested too deeply") from error
    waiting: list[Any] = [table]
    while waiting:
        value = waiting.pop()
        if isinstance(value, dict | list):
            waiting += value.values() if isinstance(value, dict) else value
        elif isinstance(value, int) and abs(value) >= 10**DIGITS:
            raise ValueError(f"an integer of more than {DIGITS} digits")
    return table


def _check_length(text: str | bytes, most: int) -> None:
    if len(text) > most:
        raise ValueError(f"{len(text)} characters, the limit is {most}")


def _whole(digits: str) -> int:
    if len(digits) > DIGITS + digits.startswith("-"):
        raise ValueError(f"an integer of more than {DIGITS} digits")
    return int(digits)
