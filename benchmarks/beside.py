"""A table of what several models are worth, by robot and domain, from the JSON of `evaluate`.

    inspector evaluate general SET --json -o general.json
    python -m benchmarks.beside general=general.json paper=paper.json [--by robot|robot_and_domain]

Each cell has false alarms per hour of ok time (of these, by findings unknown), the share of ok time
that is flagged, the share of the felt faults that are found, and F1 by class. The last row is the
mean of robots.
"""

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

SHARES = ("ok_flagged", "recall_felt")


def cell(measures: Mapping[str, Any]) -> str:
    """Measures of a model on some runs."""

    def value(name: str, shown: str) -> str:
        found = measures.get(name)
        found = found["value"] if isinstance(found, Mapping) else found
        return "–" if found is None else format(found, shown)  # noqa: RUF001

    alarms = value("false_alarms_per_hour", ".0f")
    unknown = value("unknown_false_alarms_per_hour", ".0f")
    shares = ", ".join(value(name, ".0%") for name in SHARES)
    return f"{alarms} ({unknown}), {shares}, {value('class_f1', '.2f')}"


def main() -> None:
    """Read and print."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("models", nargs="+", metavar="NAME=JSON")
    arguments.add_argument("--by", choices=("robot", "robot_and_domain"), default="robot")
    options = arguments.parse_args()
    protocols = {
        name: json.loads(Path(path).read_text())["protocol"]
        for name, _, path in (each.partition("=") for each in options.models)
    }
    rows: dict[str, dict[str, str]] = {}
    for name, protocol in protocols.items():
        parts = protocol[f"by_{options.by}"]
        for key, part in parts.items() if isinstance(parts, dict) else enumerate(parts):
            label = key if isinstance(parts, dict) else f"{part['robot']}, {part['domain']}"
            rows.setdefault(label, {})[name] = cell(part["measures"])
    for name, protocol in protocols.items():
        rows.setdefault("**mean of robots**", {})[name] = cell(protocol["robots_alike"])
    print("\n".join((f"| | {' | '.join(protocols)} |", "|---" * (len(protocols) + 1) + "|")))
    for label, cells in rows.items():
        print(f"| {label} | {' | '.join(cells.get(name, '') for name in protocols)} |")


if __name__ == "__main__":
    main()
