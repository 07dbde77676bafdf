"""Write docs/accuracy.md: the figures of the shipped model and of references, with their commands.

    python -m benchmarks.accuracy --elsewhere DIR --simulated DIR --repetitions DIR [--logs LOG ...]

The folders are written by `python -m benchmarks.elsewhere`, `inspector simulate domains` and
`python -m benchmarks.repetitions make`. LOG are logs of good motion of real robots.
"""

import argparse
import subprocess
import sys
from pathlib import Path

PAGE = Path(__file__).parents[1] / "docs" / "accuracy.md"
HEAD = """# Accuracy

Written by `python -m benchmarks.accuracy`. [Metrics](metrics.md) defines the measures. The shipped
model was trained on none of this. All motion is simulated unless it says "real": no repeated
motion of a real robot was available.
"""
OTHERS = """
Robots and controllers of PyBullet and Drake (`python -m benchmarks.elsewhere`), never used in
training. Legged robots have all of the false alarms. That motion is compared with all motion of its
run followed from earlier looks at them, but was decided, like all thresholds, on other robots."""
LASTING = """
Other seeds of robots in wide domains: good runs, faults, tones over whole runs, and faults that are
cut out of their runs. The thresholds of lines and bursts were chosen on runs of the same robots,
these among them. Then real logs of good motion, with tones of half a second added."""
REPEATED = """
Runs of robots against good repetitions of the same motion, with other sensor noise, friction and
gains ([statistics](statistics.md)): first of Panda, Go2 and TALOS, on which margins were chosen,
then of an arm of another simulator (`benchmarks.arm`), which was measured only."""


def main() -> None:
    """Run what measures, and write the page."""
    arguments = argparse.ArgumentParser(description=__doc__)
    for name in ("elsewhere", "simulated", "repetitions"):
        arguments.add_argument(f"--{name}", type=Path, required=True)
    arguments.add_argument("--logs", type=Path, nargs="*", default=[])
    given = arguments.parse_args()
    others = printed("inspector", "evaluate", "general", given.elsewhere)
    # The protocol's tables; lists of single faults and the paper's frames are left out.
    tables = others.partition("\nMissed, of")[0]
    runs = sorted(given.simulated.rglob("*.npz"))
    lasting = printed("benchmarks.lasting", *runs, "--logs", *given.logs)
    repetitions = "benchmarks.repetitions"
    repeated = printed(repetitions, "table", given.repetitions)
    repeated += "\n" + printed(repetitions, "table", given.repetitions, "arm")
    repeated += printed(repetitions, "pool")
    sections = [
        ("Other simulators", OTHERS, tables),
        ("What happens and what lasts", LASTING, lasting),
        ("Against a reference", REPEATED, repeated),
    ]
    parts = [
        f"\n## {title}\n{text}\n\n```text\n{out.strip()}\n```\n" for title, text, out in sections
    ]
    PAGE.write_text(HEAD + "".join(parts), encoding="utf-8")


def printed(module: str, *arguments: object) -> str:
    """What a module prints on standard output."""
    command = [sys.executable, "-m", module, *map(str, arguments)]
    return subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout


if __name__ == "__main__":
    main()
