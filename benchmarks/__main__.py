"""All speed benchmarks side by side, as a table in Markdown: `make bench`.

    python -m benchmarks [twists extended …] [--noisytest FOLDER] [--original PYTHON]
        [--before CHECKOUT]

A benchmark that lacks what it needs is left out, and says so. docs/benchmarks.md has the latest
table, and the studies of accuracy beside, each a script of its own.
"""

import argparse
import sys
import time
from importlib import import_module
from pathlib import Path

from benchmarks.table import HEAD, Given, LeftOutError

SPEED = ("twists", "extended", "stream", "live", "logs", "commands", "noisytest")
"""Modules with a function `rows`, which takes what is given and yields rows of the table."""


def main() -> None:
    """Measure, and print each row when it is there."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(SPEED)}; or all")
    parser.add_argument("--noisytest", type=Path, help="data set in NoisyTest's form")
    parser.add_argument("--original", default="", help="Python of an environment with NoisyTest")
    parser.add_argument("--before", type=Path, help="an older checkout, to compare commands with")
    asked = parser.parse_args()
    if unknown := set(asked.names) - set(SPEED):
        parser.error(f"no benchmark {', '.join(sorted(unknown))}; there are {', '.join(SPEED)}")
    given, start = Given(asked.noisytest, asked.original, asked.before), time.monotonic()
    print(HEAD, flush=True)
    for name in asked.names or SPEED:
        try:
            for row in import_module(f"benchmarks.{name}").rows(given):
                print(row, flush=True)
        except LeftOutError as reason:
            print(f"{name} is left out: {reason}", file=sys.stderr)
    print(f"{time.monotonic() - start:.0f} s in all", file=sys.stderr)


if __name__ == "__main__":
    main()
