"""Statistics of a data set: runs upright, amounts of each class, processor time."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from noiseclassifier.scenarios.folder import Folder
from noiseclassifier.scenarios.table import SCENARIOS
from noisemodel import Block

FRAME, HOP = 0.4, 0.1
"""Length of a frame, and time from one to the next (paper, Sec. III-A), in [s]."""
FEW = 8
"""Robots up to which each has a column, and scenarios named at most."""


@dataclass(frozen=True)
class Amount:
    """Amount of a class.

    Attributes:
        seconds: Their total duration, in [s].
    """

    blocks: int = 0
    seconds: float = 0.0
    frames: int = 0

    def __add__(self, other: "Amount") -> "Amount":
        return Amount(
            self.blocks + other.blocks,
            self.seconds + other.seconds,
            self.frames + other.frames,
        )


@dataclass(frozen=True)
class Cost:
    """Processor time of the runs of a robot.

    Attributes:
        seconds: Processor time, in [s].
        simulated: Total duration of those runs, in [s]; both leave out runs that fell.
    """

    seconds: float = 0.0
    simulated: float = 0.0


@dataclass(frozen=True)
class Statistics:
    """Statistics of a data set.

    Attributes:
        motion: Total duration of all runs, in [s].
    """

    upright: Mapping[str, Mapping[str, tuple[int, int]]]
    amounts: Mapping[str, Mapping[str, Amount]]
    costs: Mapping[str, Cost]
    motion: float
    size: int

    @classmethod
    def of(cls, folder: Folder) -> Self:
        """Statistics of a folder."""
        kept, fallen, times = folder.kept(), folder.fallen(), folder.times()
        stood = Counter((task.robot, task.scenario) for task in kept)
        fell = Counter((task.robot, task.scenario) for task in fallen)
        robots = [
            robot for robot in folder.format.robots if any(robot == key[0] for key in stood + fell)
        ]
        names = dict.fromkeys((*SCENARIOS, *(name for _, name in sorted(stood + fell))))
        amounts: dict[str, dict[str, Amount]] = {robot: {} for robot in robots}
        costs = dict.fromkeys(robots, Cost())
        motion = 0.0
        for task in kept:
            blocks, duration = folder.read(task)
            motion += duration
            mine = amounts[task.robot]
            for block in blocks:
                mine[block.label] = mine.get(block.label, Amount()) + _amount(block)
            if task in times:
                cost = costs[task.robot]
                costs[task.robot] = Cost(cost.seconds + times[task], cost.simulated + duration)
        upright = {
            robot: {
                name: (stood[robot, name], stood[robot, name] + fell[robot, name])
                for name in names
                if (robot, name) in stood + fell
            }
            for robot in robots
        }
        size = sum(path.stat().st_size for path in folder.path.rglob("*") if path.is_file())
        return cls(upright, amounts, costs, motion, size)

    def as_dict(self) -> dict[str, Any]:
        """All numbers as plain data."""
        return {
            "format": "noise-balance/1",
            "upright": {
                robot: {name: {"upright": up, "runs": runs} for name, (up, runs) in mine.items()}
                for robot, mine in self.upright.items()
            },
            "classes": {
                robot: {label: vars(amount) for label, amount in sorted(mine.items())}
                for robot, mine in self.amounts.items()
            },
            "cpu": {robot: vars(cost) for robot, cost in self.costs.items()},
            "motion": self.motion,
            "bytes": self.size,
        }

    def __str__(self) -> str:
        pairs = [pair for mine in self.upright.values() for pair in mine.values()]
        runs, fell = sum(all_ for _, all_ in pairs), sum(all_ - up for up, all_ in pairs)
        first = (
            f"{runs} runs, {fell} of which fell and are left out; {self.motion / 3600:.2f} h of"
            f" motion, {self.size / 1e6:.0f} MB"
        )
        return "\n\n".join((first, self._upright(), self._amounts(), self._costs()))

    def _upright(self) -> str:
        if len(self.upright) > FEW:
            return self._upright_by_robot()
        lines = [f"{'upright':26}" + "".join(f"{robot:>10}" for robot in self.upright)]
        for name in {name: None for mine in self.upright.values() for name in mine}:
            shares = (mine.get(name) for mine in self.upright.values())
            cells = (f"{share[0]}/{share[1]}" if share else "-" for share in shares)
            number = f"{SCENARIOS[name].number:>2}" if name in SCENARIOS else "  "
            lines.append(f"{number} {name:23}" + "".join(f"{cell:>10}" for cell in cells))
        return "\n".join(lines)

    def _upright_by_robot(self) -> str:
        """One line per robot, with the scenarios in which it fell most."""
        lines = [f"{'upright':26}{'runs':>10}   fell in"]
        for robot, mine in self.upright.items():
            up, runs = (sum(pair[side] for pair in mine.values()) for side in (0, 1))
            fell = sorted(((n - u, name) for name, (u, n) in mine.items() if n > u), reverse=True)
            most = ", ".join(f"{name} ({count})" for count, name in fell[:FEW])
            lines.append(f"{robot:26}{f'{up}/{runs}':>10}   {most or 'none'}")
        return "\n".join(lines)

    def _amounts(self) -> str:
        lines = [f"{'class':26}{'blocks':>10}{'seconds':>10}{'frames':>10}{'of time':>10}"]
        for robot, mine in self.amounts.items():
            whole = sum(amount.seconds for amount in mine.values())
            for label, amount in sorted(mine.items(), key=lambda item: -item[1].seconds):
                lines.append(
                    f"{robot:8} {label:17}{amount.blocks:>10}{amount.seconds:>10.1f}"
                    f"{amount.frames:>10}{amount.seconds / whole:>10.1%}"
                )
        return "\n".join(lines)

    def _costs(self) -> str:
        lines = [f"{'processor time':26}{'seconds':>10}{'per simulated second':>22}"]
        for robot, cost in self.costs.items():
            each = f"{cost.seconds / cost.simulated:.2f}" if cost.simulated else "-"
            lines.append(f"{robot:26}{cost.seconds:>10.0f}{each:>22}")
        return "\n".join(lines)


def _amount(block: Block) -> Amount:
    seconds = block.stop - block.start
    # Blocks start and stop on samples, up to rounding.
    frames = 1 + int(max(seconds - FRAME, 0.0) / HOP + 1e-6)
    return Amount(1, seconds, frames)
