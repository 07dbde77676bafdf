"""Make the pictures of docs/first-log.md: from a CSV that nobody prepared to the finding.

`python assets/screencast.py` simulates a UR5 whose force control has too high gains (extra
`sim`), writes what ur_rtde logs of it at 500 Hz, runs the commands on that CSV, and keeps what they
print and show.
"""

import re
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from PIL import Image
from rich.console import Console
from rich.text import Text

from noisemodel import Run

ROOT = Path(__file__).parents[1]
PICTURES = Path(__file__).parent / "pictures"
RATE = 500
"""Rate at which an e-series UR reports, in [Hz]."""
WIDTH = 108
HEAD = 100
"""Characters of a line of the log that are shown."""


def main() -> None:
    """Write the pictures."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        _run(folder, "simulate ur5 --scenario limit-cycle --seed 3 -o run.npz")
        write_log(Run.load(folder / "run.npz"), folder / "log.csv")
        with (folder / "log.csv").open() as lines:
            first = [f"{next(lines)[:HEAD]}..." for _ in range(3)]
        shown = [("head -3 log.csv", "\n".join(first))]
        status, printed = _run(folder, "classify log.csv")
        shown += [("inspector classify log.csv", printed), ("echo $?", str(status))]
        status, printed = _run(folder, "view log.csv --robot ur5 --save log.rrd")
        left_out = re.compile("recording|browser|open it")
        kept = [line for line in printed.splitlines() if not left_out.search(line)]
        shown.append(("inspector view log.csv --robot ur5", "\n".join(kept)))
        (PICTURES / "first-log-terminal.svg").write_text(terminal(shown), encoding="utf-8")
        _run(folder, "shot log.csv --robot ur5 --size 1280x800 -o log.png")
        with Image.open(folder / "log.png") as picture:  # 256 colours take a third of the space
            picture.quantize(256).save(PICTURES / "first-log-viewer.png", optimize=True)


def write_log(run: Run, path: Path) -> None:
    """Write a run as ur_rtde's `record` names the columns, by default at 500 Hz."""
    samples = slice(None, None, round(run.rate / RATE))
    columns = {"timestamp": 1_700_000 + run.time[samples]}
    signals = {
        "target_qd": run.velocity_desired,
        "actual_q": run.position,
        "actual_qd": run.velocity,
    }
    for signal, values in signals.items():
        assert values is not None
        columns |= {f"{signal}_{n}": column for n, column in enumerate(values[samples].T)}
    table = np.column_stack(list(columns.values()))
    formats = ["%.3f", *["%.6f"] * (len(columns) - 1)]
    np.savetxt(path, table, fmt=formats, delimiter=",", header=",".join(columns), comments="")


def terminal(shown: list[tuple[str, str]]) -> str:
    """Draw commands and what they printed as SVG, without fonts from elsewhere."""
    console = Console(record=True, width=WIDTH, file=open("/dev/null", "w"))  # noqa: SIM115, PTH123
    for command, printed in shown:
        console.print(Text(f"$ {command}", style="bold"))
        console.print(Text(printed.rstrip()))
    svg = console.export_svg(title="inspector")
    return re.sub(r"@font-face \{.*?\}\n?", "", svg, flags=re.DOTALL)


def _run(folder: Path, command: str) -> tuple[int, str]:
    """Run a command in a folder; returns its exit status and all that it printed."""
    done = subprocess.run(
        [sys.executable, "-m", "inspector", *command.split()],
        cwd=folder,
        env={"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin", "HOME": str(folder)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    if done.returncode not in (0, 1):
        raise SystemExit(f"{command}: {done.stdout}")
    return done.returncode, done.stdout


if __name__ == "__main__":
    main()
