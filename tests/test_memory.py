"""Memory does not grow with the length of a run: peaks of whole processes."""

import sys
import zipfile

import numpy as np
import pytest
from commandline import python
from numpy.lib import format as npy

# Durations in [s] of runs of 60 joints at 1 kHz: signals of 77 MB and of 154 MB each.
SHORT, LONG = 160.0, 320.0
GROWTH = 80e6  # most growth of the peak in [B]; the three signals grow by 230 MB
JOINTS, PIECE = 60, 20_000  # samples that are made at once
MEASURE = """
import resource, subprocess, sys
done = subprocess.run([sys.executable, "-m", "inspector", *sys.argv[1:]], capture_output=True)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_maxrss * 1024, done.returncode, *done.stderr.decode().strip().splitlines()[-1:])
"""


def motion(name, samples):
    """Some samples of a sinusoidal motion with noise, and a vibration once a minute."""
    time, places = samples[:, None] / 1000.0, np.arange(JOINTS)
    turn = 2.0 * np.pi * (0.3 + 0.02 * (places % 10))
    if name == "position":
        return 0.2 * np.sin(turn * time + places)
    found = 0.2 * turn * np.cos(turn * time + places)
    if name == "velocity":
        found += 1e-3 * np.random.default_rng(int(samples[0])).standard_normal(found.shape)
        since = (time[:, 0] - 30.0) % 60.0
        found[:, 3] += 3.0 * np.exp(-since / 0.05) * np.sin(2.0 * np.pi * 120.0 * since)
    return found


def write(path, seconds):
    """Write a run file at 1 kHz in little memory."""
    count = round(1000 * seconds)
    names = np.array([f"j{number}" for number in range(JOINTS)])
    plain = {"format": "noise-run/1", "joint_names": names, "time": np.arange(count) / 1000}
    with zipfile.ZipFile(path, "w") as archive:
        for name, array in plain.items():
            with archive.open(f"{name}.npy", "w") as member:
                npy.write_array(member, np.asanyarray(array))
        for name in ("velocity", "velocity_desired", "position"):
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                header = {"descr": "<f8", "fortran_order": False, "shape": (count, JOINTS)}
                npy.write_array_header_1_0(member, header)
                for first in range(0, count, PIECE):
                    rows = np.arange(first, min(count, first + PIECE))
                    member.write(motion(name, rows).tobytes())


def peak(command):
    """Peak of the resident set of a command that gives a verdict, in [B]."""
    done = python("-c", MEASURE, *command)
    found, status, *_ = done.stdout.split()
    assert status in "014", done.stdout
    return float(found)


@pytest.mark.slow
def test_peaks_of_commands_do_not_grow_with_a_run(tmp_path):
    run, page, before = (tmp_path / name for name in ("run.npz", "run.html", "before/run.npz"))
    commands = [["audit", run], ["view", run, "-o", page, "--overwrite"], ["diff", before, run]]
    peaks = []
    before.parent.mkdir()
    write(before, SHORT)
    for seconds in (SHORT, LONG):
        write(run, seconds)
        peaks.append([peak(command) for command in commands])
    growth = [after - before for before, after in zip(*peaks, strict=True)]  # of each command
    assert max(growth) < GROWTH, growth


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
    for second in range(360):
        rows = motion(second)
        for first in range(0, 1000, 100):
            session.push(**{name: each[first : first + 100] for name, each in rows.items()})
        if second in (119, 359):
            print(resident())
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_a_live_recording_keeps_little_of_what_it_wrote(tmp_path):
    """In four minutes it grows by 24 MB where each tenth of a second is a message."""
    done = python("-c", LIVE, tmp_path / "live.rrd", status=0)
    after_two, after_six = map(float, done.stdout.split())
    assert after_six - after_two < 2.4
    assert after_six < 250.0
