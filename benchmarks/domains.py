"""Show wide domains: what was drawn and dropped, as a table, as spectra and as sound.

    python -m benchmarks.domains DATA [--picture domains.png] [--sound FOLDER]
        [--real ../shared/data/panda]

DATA is a folder of `inspector simulate domains`. Levels, spectra and sounds are of logs at 1 kHz,
as `inspector simulate logs DATA --rate 1000` writes them, beside the log of a real Panda where
there is one (measured.csv, desired.csv) and a Panda of the scenarios at home.
"""

import argparse
import json
import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import butter, sosfilt, welch

from benchmarks.orders import ORDERS, order_spectra
from inspector import read_log
from inspector.sound import common_gain, save, sonify
from noiseclassifier.scenarios.dataset import FALLEN, Folder, logs
from noiseclassifier.scenarios.drives import ORDERS as GEAR_ORDERS
from noiseclassifier.scenarios.logs import HARMONICS
from noiseclassifier.scenarios.robots import TARGETS, WIDE
from noiseclassifier.scenarios.simulation import GOOD
from noisemodel import Run
from noisemodel.types import Array

PANDA = Path(__file__).parents[2] / "shared" / "data" / "panda"
HOME, REAL = "home-panda-straight-0", "real-panda-good"
RATE = 1000.0
"""Of the logs, in [Hz]: that of the real Panda's."""
LOWEST = 15.0
"""Lowest frequency of the level, in [Hz]."""
SHOWN = 3
"""Logs whose orders are drawn."""
SHARPEST, QUIETEST = 100.0, 0.01
"""Least cutoff in [Hz] and most noise in [rad/s] of those: others mask their ripple."""
PARTS = 10
"""Least number of the parts of their motion, over which their orders are averaged."""
GOOD_SOUNDS = 2
"""Sounds of good logs of each family, of different robots."""
HEAD = (
    *("robot", "runs", "dropped", "control", "tracking error [rad/s]"),
    *(f"above {LOWEST:g} Hz [rad/s]", "faults with a label"),
)
FAMILIES = {"arm": "#0072b2", "quadruped": "#009e73", "humanoid": "#cc79a7"}
COLORS = ("#0072b2", "#d55e00", "#009e73")


@dataclass
class Robot:
    """What was drawn of one robot, and what was dropped."""

    runs: int = 0
    dropped: Counter[str] = field(default_factory=Counter)
    control: Counter[str] = field(default_factory=Counter)
    errors: list[float] = field(default_factory=list)
    levels: list[float] = field(default_factory=list)
    faults: int = 0
    labelled: int = 0

    def row(self, name: str) -> str:
        """Its row of the table."""
        cells = (
            f"{name}{' (target)' if name in TARGETS else ''}",
            str(self.runs),
            _counts(self.dropped),
            _counts(self.control),
            _range(self.errors),
            _range(self.levels),
            f"{self.labelled} of {self.faults}",
        )
        return f"| {' | '.join(cells)} |"


@dataclass
class Shown:
    """What is drawn and played of a data set."""

    robots: Mapping[str, Robot]
    spectra: dict[str, list[Array]] = field(default_factory=lambda: defaultdict(list))
    rippled: list[Run] = field(default_factory=list)
    sounds: dict[str, Run] = field(default_factory=dict)


def main() -> None:
    """Print the table; draw and write what is asked for."""
    arguments = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    arguments.add_argument("data", type=Path)
    arguments.add_argument("--picture", type=Path, help="PNG file to write")
    arguments.add_argument("--sound", type=Path, help="folder of WAV files to write")
    arguments.add_argument("--real", type=Path, default=PANDA, help="log of a real Panda")
    given = arguments.parse_args()
    shown = examined(Folder.opened(given.data, wide=True, any_recipe=True))
    compared = {HOME: home()} | real(given.real)
    print("\n".join(table(shown.robots, compared)))
    if given.picture:
        draw(shown, compared, given.picture)
    if given.sound:
        given.sound.mkdir(parents=True, exist_ok=True)
        for name, run in {**shown.sounds, **compared}.items():
            sound = sonify(run)
            path = given.sound / f"{name}.wav"
            save({path: sound}, common_gain([sound]), overwrite=True)
            print(path)


def examined(folder: Folder) -> Shown:
    """Go through all runs of a data set, and through a log of each."""
    shown = Shown(robots=defaultdict(Robot))
    for task in folder.fallen():
        path = folder.file(task).with_suffix(FALLEN)
        problem = json.loads(path.read_text(encoding="utf-8"))["problem"]
        robot = shown.robots[task.robot]
        robot.runs += 1
        robot.dropped[re.sub(r",? at .*", "", problem)] += 1
    for task in folder.kept():
        robot = shown.robots[task.robot]
        robot.runs += 1
        if task.scenario == GOOD:
            run = Run.load(folder.file(task))
            robot.control[run.meta["domain"]["control"]] += 1
            robot.errors.append(_rms(tracking_error(run)))
    for name, log in logs(folder, rate=RATE):
        _add(shown, name, log)
    return shown


def _add(shown: Shown, name: str, log: Run) -> None:
    (robot, run), meta = name.split("/"), log.meta
    family, entry = WIDE[robot].family, shown.robots[robot]
    if meta["scenario"] == GOOD:
        entry.levels.append(level(log))
        shown.spectra[family].append(spectrum(log))
        if family == "arm" and _shows_ripple(log):
            shown.rippled.append(log)
        others = [sound for sound in shown.sounds if sound.startswith(f"{family}-good")]
        if len(others) < GOOD_SOUNDS and not any(f"-{robot}-" in sound for sound in others):
            shown.sounds[f"{family}-good-{robot}-{meta['seed']}"] = log
        return
    entry.faults += len(meta["events"])
    entry.labelled += sum(event["labelled"] > 0 for event in meta["events"])
    for label in {block.label for block in log.blocks} - {"ok"}:
        if not any(sound.startswith(f"{family}-{label}") for sound in shown.sounds):
            shown.sounds[f"{family}-{label}-{robot}-{run}"] = log


def table(robots: Mapping[str, Robot], compared: Mapping[str, Run]) -> Iterable[str]:
    """Lines of the table, robots in the order of ``WIDE``; what they are compared with last."""
    yield f"| {' | '.join(HEAD)} |"
    yield "|---" * len(HEAD) + "|"
    for name in WIDE:
        if name in robots:
            yield robots[name].row(name)
    runs, dropped, faults, labelled = (
        sum(each)
        for each in zip(
            *((r.runs, r.dropped.total(), r.faults, r.labelled) for r in robots.values()),
            strict=True,
        )
    )
    yield f"| all | {runs} | {dropped} | | | | {labelled} of {faults} |"
    for name, run in compared.items():
        error, fast = f"{_rms(tracking_error(run)):.2g}", f"{level(run):.2g}"
        yield f"| {name} | 1 | none | its own | {error} | {fast} | |"


def home() -> Run:
    """A Panda of the scenarios at home, which has no ripple."""
    from noiseclassifier.scenarios import simulate

    return simulate("panda", "straight", 0)


def real(folder: Path) -> dict[str, Run]:
    """The log of a real Panda by its name; none if it is not there."""
    if not (folder / "measured.csv").exists():
        return {}
    desired = folder / "desired.csv"
    return {REAL: read_log(folder / "measured.csv", desired=desired).run}


def tracking_error(run: Run) -> Array:
    """Measured less desired velocities, or planned ones for a policy, which has no desired ones."""
    desired = run.velocity_desired
    if desired is None or not desired.any():
        desired = run.stages["planned"]
    return np.asarray(run.velocity - desired, dtype=np.float64)[run.mask]


def level(log: Run) -> float:
    """Root mean square above ``LOWEST`` of the norm of all velocities, in [rad/s]."""
    sections = butter(2, LOWEST, "highpass", fs=log.rate, output="sos")
    velocity = _without_gaps(log)
    return _rms(sosfilt(sections, velocity - velocity[0], axis=0)[round(0.2 * log.rate) :])


def spectrum(run: Run) -> Array:
    """Power spectral density by Welch's method, mean of all joints, at 0 to 500 Hz in 1 Hz.

    Returns:
        Shape (frequencies,), in [(rad/s)²/Hz].
    """
    density = welch(_without_gaps(run), run.rate, nperseg=round(run.rate), axis=0)[1]
    return np.asarray(density[: round(RATE / 2) + 1].mean(axis=1))


def joint_orders(run: Run, joints: Sequence[int] | None = None) -> Array:
    """Order spectra of the parts of the motion of some joints, or all, in [rad/s]."""
    chosen = range(run.velocity.shape[1]) if joints is None else joints
    return np.concatenate(
        [order_spectra(run.velocity[:, j], rate=run.rate, valid=run.mask) for j in chosen]
    )


def draw(shown: Shown, compared: Mapping[str, Run], path: Path) -> None:
    """Draw spectra of good logs over frequency, and over orders of the joints' angles."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 7.5), dpi=100, layout="constrained")
    axes = figure.subplot_mosaic([["psd"] * 3, ["real", "wide", "home"]], height_ratios=[1.1, 1])
    _draw_densities(axes["psd"], shown, compared)
    if REAL in compared:
        for color, joints in (("#000000", range(4)), ("#d55e00", range(4, 7))):
            label = f"joints {joints[0] + 1} to {joints[-1] + 1}"
            _draw_orders(axes["real"], joint_orders(compared[REAL], joints), color, label)
    for color, log in zip(COLORS, _with_ripple(shown.rippled), strict=False):
        gear = log.meta["logger"]["gear"]
        label = f"{log.robot}: gear {gear:.0f}, ripple {_ripple(log):.1%}"
        _draw_orders(axes["wide"], joint_orders(log), color, label)
        for order in GEAR_ORDERS if log.meta["domain"]["ripple"] else HARMONICS:
            axes["wide"].axvline(order * gear, color=color, ls=":", lw=0.8)
    _draw_orders(axes["home"], joint_orders(compared[HOME]), "#000000", "all joints")
    titles = {
        "real": "real Panda",
        "wide": "wide domains, arms with most ripple\n(dotted: multiples of the gear ratio)",
        "home": "Panda of the scenarios at home",
    }
    for name, title in titles.items():
        axes[name].set_title(title, fontsize=9)
        axes[name].set(xlim=(60, 700), ylim=(0, 12))
        axes[name].set_xlabel("order [periods per turn of the joint]")
        axes[name].grid(alpha=0.4)
        if axes[name].lines:
            axes[name].legend(fontsize=8, loc="upper right")
    axes["real"].set_ylabel("amplitude of the velocity [mrad/s]")
    figure.savefig(path, format="png")


def _draw_orders(axes: Any, spectra: Array, color: str, label: str) -> None:
    if len(spectra):
        mean = 1e3 * np.sqrt(np.square(spectra).mean(axis=0))
        axes.plot(ORDERS, mean, color=color, label=label)


def _draw_densities(axes: Any, shown: Shown, compared: Mapping[str, Run]) -> None:
    frequency = np.arange(round(RATE / 2) + 1)
    for family, color in FAMILIES.items():
        if not shown.spectra[family]:
            continue
        low, middle, high = np.quantile(shown.spectra[family], (0.1, 0.5, 0.9), axis=0)
        label = f"wide domains, {len(shown.spectra[family])} good logs of {family}s: median"
        if family == "arm":
            axes.fill_between(frequency, low, high, color=color, alpha=0.2, lw=0)
            label += ", 10 to 90 %"
        axes.plot(frequency, middle, color=color, ls="-" if family == "arm" else "--", label=label)
    labels = {REAL: ("real Panda", "#000000"), HOME: ("home Panda", "#d55e00")}
    for name, run in compared.items():
        label, color = labels[name]
        axes.plot(frequency, spectrum(run), color=color, label=label)
    axes.set(xscale="log", yscale="log", xlim=(1, RATE / 2))
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel("PSD of measured velocities,\nmean of joints [(rad/s)²/Hz]")
    axes.grid(alpha=0.4)
    axes.legend(fontsize=8)


def _with_ripple(rippled: Sequence[Run]) -> list[Run]:
    """Logs with most ripple, in [rad/s]."""
    return sorted(rippled, key=lambda log: -_ripple(log) * _rms(log.velocity))[:SHOWN]


def _ripple(log: Run) -> float:
    """By the speed of the joint; of a rigid robot it is the logger's."""
    return float(log.meta["domain"]["ripple"] or log.meta["logger"]["ripple"])


def _shows_ripple(log: Run) -> bool:
    logger = log.meta["logger"]
    sharp = logger["velocity"] == "measured" or logger["cutoff"] > SHARPEST
    quiet = logger["noise"] <= QUIETEST and logger["hold"] == 1
    return bool(sharp and quiet and len(joint_orders(log)) >= PARTS)


def _without_gaps(run: Run) -> Array:
    """Velocities, shape (samples, joints), gaps bridged: they are a few samples long."""
    count, known = np.arange(len(run.time)), np.flatnonzero(run.mask)
    joints = (np.interp(count, known, joint[known]) for joint in run.velocity.T)
    return np.stack([*joints], axis=1)


def _rms(signal: Array) -> float:
    """Of the norm over all joints."""
    return float(np.sqrt(np.square(signal).sum(axis=1).mean()))


def _counts(counter: Counter[str]) -> str:
    return ", ".join(f"{count} {name}" for name, count in counter.most_common()) or "none"


def _range(values: Sequence[float]) -> str:
    return f"{min(values):.2g} to {max(values):.2g}" if values else "none"


if __name__ == "__main__":
    main()
