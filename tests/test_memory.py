"""Memory does not grow with the length of a run: peaks of whole processes."""

import subprocess
import sys
from argparse import Namespace

import pytest

from benchmarks.memory import MEASURE, commands, write

SHORT, LONG = 160.0, 480.0
"""Durations in [s] of runs of 60 joints at 1 kHz: signals of 77 MB and of 230 MB each."""
GROWTH = 80e6
"""Most growth of the peak in [B]; the three signals grow by 460 MB."""


def peak(command):
    """Peak of the resident set of a command that gives a verdict, in [B]."""
    done = subprocess.run(
        [sys.executable, "-c", MEASURE, *command], stdout=subprocess.PIPE, check=True, text=True
    )
    found, _, status, *_ = done.stdout.split()
    assert status in "014", done.stdout
    return float(found)


@pytest.mark.slow
@pytest.mark.parametrize("packed", [False, True], ids=["stored", "deflated"])
def test_peaks_of_commands_do_not_grow_with_a_run(tmp_path, packed):
    peaks = {}
    for seconds in (SHORT, LONG):
        run = tmp_path / "run.npz"
        settings = Namespace(rate=1000.0, joints=60, type="f8", robot="", packed=packed)
        write(run, seconds, settings)
        names = ("audit",) if packed else ("audit", "report", "diff")
        for name in names:
            peaks.setdefault(name, []).append(peak(commands(run)[name]))
    growth = {name: long - short for name, (short, long) in peaks.items()}
    assert max(growth.values()) < GROWTH, growth


LIVE = """
import numpy as np, sys
from inspector import LiveSession

def resident():
    with open("/proc/self/status") as lines:
        return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS")) / 1e3

def motion(second):
    time = second + np.arange(1000) / 1000
    wanted = 0.3 * np.cos(2 * np.pi * 0.3 * time[:, None] + np.arange(3))
    velocity = wanted + 1e-3 * random.standard_normal(wanted.shape)
    return {"time": time, "velocity": velocity, "velocity_desired": wanted, "position": wanted}

random = np.random.default_rng(0)
with LiveSession(1000.0, joint_names=("a", "b", "c"), save=sys.argv[1]) as session:
    for second in range(1800):
        rows = motion(second)
        for first in range(0, 1000, 50):
            session.push(**{name: each[first : first + 50] for name, each in rows.items()})
        if second in (599, 1799):
            print(resident())
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_a_live_recording_keeps_little_of_what_it_wrote(tmp_path):
    """In twenty minutes it grew by 30 MB when each tenth of a second was a message."""
    done = subprocess.run(
        [sys.executable, "-c", LIVE, str(tmp_path / "live.rrd")],
        stdout=subprocess.PIPE,
        check=True,
        text=True,
    )
    after_ten, after_thirty = map(float, done.stdout.split())
    assert after_thirty - after_ten < 12.0
    assert after_thirty < 250.0
