"""A fault made louder is never found less: laws of the verdict on good runs with a fault added.

A tone, a blow or noise is added to one joint of a good run. Its level is that of the loudest tenth
of a second of the run in the band of the model, as a touchdown has, or `FLOOR` if the run is
quieter there: how faint a fault a model finds is measured elsewhere (docs/accuracy.md), that it
finds a loud one is a law.
"""

import os
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from addedfaults import KINDS, fault
from hypothesis import given, settings
from hypothesis import strategies as st
from simulated import simulated

import noisemodel as nm
from inspector.analysis import analyse
from inspector.errors import Status, Unknown
from inspector.library import load_library, signals_of

# Level from which the law holds, as a root mean square in [rad/s]: ten times what the labelling
# rule of the scenarios takes for felt.
FLOOR = 0.3
LOUDER = (1.0, 3.0, 10.0, 100.0, 1000.0)
# Times the loudest tenth of a second, of robots with legs: a blow on one joint, as loud as the
# touchdowns of all, is one more touchdown to the model (docs/accuracy.md).
ABOVE = {"go2": 3.0, "talos": 2.0}
SECONDS = 3.0
MANY = int(os.environ.get("MANY", "1"))  # times the cases of slow laws

LIBRARY = load_library()


@cache
def good_run(robot, rate):
    """Seconds of the first simulated run in which nothing is wrong and nothing is found, at a rate.

    Models raise false alarms in some trots (docs/accuracy.md); the law is about the rest.
    """
    for seed in range(9001, 9031):
        run = simulated(robot, "straight", seed, duration=SECONDS + 2.0)
        run = run.cut(float(run.time[0]) + 1.0, float(run.time[0]) + 1.0 + SECONDS)
        run = nm.decimated(run, rate) if rate < run.rate else run
        if analyse(run, LIBRARY).status is Status.OK:
            return run
    pytest.fail("each of thirty good runs has a finding")


def level_in_band(run, low, high):
    """Root mean square of all joints between two frequencies where it is highest, in [rad/s]."""
    waves = np.fft.rfft(run.velocity.astype(np.float64), axis=0)
    frequency = np.fft.rfftfreq(len(run.time), 1 / run.rate)
    inside = (frequency >= low) & (frequency < high)
    waves[~inside] = 0.0
    power = np.square(np.fft.irfft(waves, len(run.time), axis=0)).sum(axis=1)
    tenth = round(0.1 * run.rate)
    return float(np.sqrt(np.convolve(power, np.ones(tenth) / tenth, "valid").max()))


def added(run, kind, frequency, seed):
    """A fault from 1 s on, of level 1, shape (samples,)."""
    return fault(run.time - run.time[0], kind, frequency, seed, start=1.0)


def with_fault(run, joint, signal, level):
    velocity = run.velocity.astype(np.float64)
    velocity[:, joint] += level * signal
    return replace(run, velocity=velocity)


def check_the_law(robot, rate, kind, joint, frequency, seed):
    run = good_run(robot, rate)
    good = analyse(run, LIBRARY)
    assert good.status is Status.OK
    edges = LIBRARY[good.model].at(run.rate, signals_of(run)).profile.edges
    low, high = edges[0], edges[-1]
    frequency = 20.0 * (min(0.8 * high, 1000.0) / 20.0) ** frequency  # from 20 Hz, in octaves
    level = max(ABOVE.get(robot, 1.0) * level_in_band(run, low, high), FLOOR)
    signal = added(run, kind, frequency, seed)
    joint = joint % run.velocity.shape[1]
    for louder in LOUDER:
        found = analyse(with_fault(run, joint, signal, louder * level), LIBRARY)
        assert found.status is Status.FINDINGS, f"{kind} of {louder * level:.2f} rad/s"
        begin, end = run.time[0] + 1.0, run.time[0] + 2.0  # of the fault
        assert any(e.start < end + 0.1 and e.stop > begin - 0.1 for e in found.findings)


FAULTS = {
    "kind": st.sampled_from(KINDS),
    "joint": st.integers(0, 40),
    "frequency": st.floats(0.0, 1.0),
    "seed": st.integers(0, 1000),
}


@given(**FAULTS)
@settings(max_examples=6, deadline=None, derandomize=True)
def test_a_loud_fault_of_a_panda_is_a_finding_and_stays_one(kind, joint, frequency, seed):
    check_the_law("panda", 1000.0, kind, joint, frequency, seed)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "rate"), [("panda", 250.0), ("ur5", 10_000.0), ("go2", 2000.0), ("talos", 1000.0)]
)
@given(**FAULTS)
@settings(max_examples=8 * MANY, deadline=None, derandomize=True)
def test_a_loud_fault_of_any_robot_is_a_finding_and_stays_one(
    robot, rate, kind, joint, frequency, seed
):
    check_the_law(robot, rate, kind, joint, frequency, seed)


@given(**FAULTS, faint=st.floats(0.001, 0.3))
@settings(max_examples=6, deadline=None, derandomize=True)
def test_a_faint_fault_that_is_found_is_found_louder_too(kind, joint, frequency, seed, faint):
    run = good_run("panda", 1000.0)
    signal = added(run, kind, 20.0 * 20.0**frequency, seed)
    joint = joint % run.velocity.shape[1]
    levels = faint * np.array([1.0, 2.0, 5.0, 20.0, 100.0])
    found = [bool(analyse(with_fault(run, joint, signal, x), LIBRARY).findings) for x in levels]
    assert found == sorted(found)


def test_to_ignore_unknown_frames_never_adds_a_finding():
    run = good_run("panda", 1000.0)
    for kind in KINDS:
        loud = with_fault(run, 1, added(run, kind, 60.0, 0), 100.0)
        reported = analyse(loud, LIBRARY)
        if kind == "tone":  # louder than the faults that models/build.py adds
            assert any(event.novel for event in reported.findings)
        ignoring = analyse(loud, LIBRARY, unknown=Unknown.IGNORE)
        spans = {(span.start, span.stop) for span in reported.spans}
        for span in ignoring.spans:
            assert any(start <= span.start and span.stop <= stop for start, stop in spans)
