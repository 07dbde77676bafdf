"""Logs to import, written by the tests of the importer."""

import numpy as np

TIME = np.arange(400) / 100


def swing(time):
    """Position and velocity of a joint that swings, smooth at 100 Hz."""
    return np.sin(2 * np.pi * time), 2 * np.pi * np.cos(2 * np.pi * time)


def write(path, columns, delimiter=","):
    """Write columns by name as a log; numbers so that they are read back bit for bit."""
    rows = zip(*columns.values(), strict=True)
    lines = [delimiter.join(columns), *(delimiter.join(map(str, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


def log(tmp_path, time=TIME, name="log.csv", **columns):
    position, velocity = swing(time)
    held = {"time": time, "elbow.position": position, "elbow.velocity": velocity}
    return write(tmp_path / name, held | columns)


def jittered(seed=0):
    """Stamps that are off by up to 20 %, as a logger without a real-time clock writes them."""
    time = TIME + np.random.default_rng(seed).uniform(-0.002, 0.002, len(TIME))
    return time - time[0]
