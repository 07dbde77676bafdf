"""All speed benchmarks side by side, as a table in Markdown: `make bench`.

python -m benchmarks [extended stream …] [--before CHECKOUT]
"""

import argparse
import sys
import time
from importlib import import_module
from pathlib import Path

from benchmarks.table import HEAD

# Modules with a function `rows`, which takes an older checkout, or None, and yields rows.
SPEED = ("extended", "stream", "live", "commands")


def main() -> None:
    """Measure, and print each row when it is there."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(SPEED)}; or all")
    parser.add_argument("--before", type=Path, help="an older checkout, to compare commands with")
    asked = parser.parse_args()
    if unknown := set(asked.names) - set(SPEED):
        parser.error(f"no benchmark {', '.join(sorted(unknown))}; there are {', '.join(SPEED)}")
    start = time.monotonic()
    print(HEAD, flush=True)
    for name in asked.names or SPEED:
        for row in import_module(f"benchmarks.{name}").rows(asked.before):
            print(row, flush=True)
    print(f"{time.monotonic() - start:.0f} s in all", file=sys.stderr)


if __name__ == "__main__":
    main()
