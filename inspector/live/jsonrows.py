"""Rows of JSON: an object per line, with arrays named as in a run file."""

import json
from collections.abc import Iterator
from itertools import groupby
from math import nan
from typing import Any

import numpy as np

from inspector.live.rows import Note, Rows
from inspector.live.samples import SIGNALS


class JsonReader:
    """Reads objects such as ``{"time": 0.1, "velocity": [0.2, 0.3]}``."""

    def __init__(self, names: tuple[str, ...]) -> None:
        self.names = names

    def read(self, lines: bytes, first: int, note: Note) -> Iterator[Rows]:
        """Read whole lines; the others are counted.

        Args:
            note: Called with each row that cannot be read.
        """
        samples = []
        for number, line in enumerate(lines.splitlines(), start=first):
            if not line.strip():
                continue
            try:
                samples.append(_sample(line))
            except ValueError as error:
                note("malformed rows", f"line {number}: {error}; such rows are left out")
        for keys, group in groupby(samples, key=_shape):
            alike = list(group)
            signals = {name: np.array([each[name] for each in alike]) for name, _ in keys}
            time = signals.pop("time", None)
            yield Rows(signals, None if time is None else time[:, 0])


def _shape(sample: dict[str, list[float]]) -> tuple[tuple[str, int], ...]:
    return tuple((name, len(values)) for name, values in sample.items())


def _sample(line: bytes) -> dict[str, list[float]]:
    """Read one object, its values as lists of numbers."""
    try:
        found = json.loads(line, parse_int=float)
    except RecursionError as error:
        raise ValueError("nested too deeply") from error
    if not isinstance(found, dict) or "velocity" not in found:
        raise ValueError("no JSON object with a velocity")
    names = ("time", *SIGNALS)
    if isinstance(found.get("time", 0.0), list) and len(found["time"]) != 1:
        raise ValueError("time is no single number")
    return {name: _numbers(name, found[name]) for name in names if name in found}


def _numbers(name: str, value: Any) -> list[float]:
    values = value if isinstance(value, list) else [value]
    if not values:
        raise ValueError(f"{name} is empty")
    try:
        return [nan if each is None else float(each) for each in values]
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} holds no numbers") from error
