"""Order spectrograms."""

import numpy as np
import pytest

from inspector.analysis import analyse, orders
from noisemodel import Run

RATE = 1000.0


def analysed(velocity, **changes):
    time = np.arange(len(velocity)) / RATE
    run = Run(time=time, velocity=velocity, joint_names=("elbow", "wrist"), **changes)
    return analyse(run, {})


def turning(periods, seconds=6.0):
    """The elbow turns faster and faster, with a ripple of so many periods per turn."""
    time = np.arange(round(seconds * RATE)) / RATE
    speed = 1.0 + 0.5 * time
    angle = np.cumsum(speed) / RATE
    ripple = 0.05 * np.sin(periods * angle)
    return np.stack((speed + ripple, np.zeros_like(speed)), axis=1)


@pytest.mark.parametrize("periods", [60.0, 160.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_ripple_stays_at_its_order_while_the_joint_speeds_up(periods, sign):
    joint, found = orders(analysed(sign * turning(periods)))
    assert joint == "elbow"
    loudest = found.frequency[
        found.amplitude[found.frequency > 30.0].argmax(axis=0)
        + int((found.frequency <= 30.0).sum())
    ]
    np.testing.assert_allclose(loudest, periods, rtol=0.08)
    # Its amplitude is that of the ripple, less what a window between two lines loses.
    assert found.amplitude[found.frequency > 30.0].max(axis=0) == pytest.approx(0.05, rel=0.3)


def test_a_joint_at_rest_and_one_that_turns_back_have_no_orders():
    assert orders(analysed(np.zeros((6000, 2)))) is None
    back = np.sin(2 * np.pi * 2.0 * np.arange(6000) / RATE)
    assert orders(analysed(np.stack((back, back), axis=1))) is None


def test_windows_that_touch_a_gap_are_not_valid():
    velocity = turning(100.0)
    valid = np.ones(len(velocity), dtype=bool)
    valid[3000:3010] = False
    _, found = orders(analysed(velocity, valid=valid))
    touching = np.abs(found.time - 3.005) < 0.4
    assert not found.valid[touching].any()
    assert found.valid[~(np.abs(found.time - 3.005) < 0.42)].all()
    assert (found.amplitude[:, touching] == 0.0).all()


def test_a_run_shorter_than_a_window_has_none():
    assert orders(analysed(turning(100.0, seconds=0.5))) is None
