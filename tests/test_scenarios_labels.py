"""Only measurable deviations are labelled, and nothing is ok that a defect may have disturbed."""

from itertools import pairwise

import numpy as np
import pytest

from noiseclassifier.scenarios.labels import annotate, deviation
from noiseclassifier.scenarios.motions import Event

RATE = 10_000
TIME = np.arange(4 * RATE) / RATE
TWIN = np.stack((np.sin(TIME), np.cos(2 * TIME)), axis=1)


def knock(at: float, size: float, decay: float = 0.02, hertz: float = 30.0):
    """A joint that rings down after a blow, shape (samples, joints)."""
    after = np.maximum(TIME - at, 0)
    ring = size * np.exp(-after / decay) * np.cos(2 * np.pi * hertz * after) * (at <= TIME)
    return np.stack((ring, 0 * ring), axis=1)


def shake(start: float, stop: float, size: float, hertz: float = 40.0):
    now = TIME - start
    wave = size * np.sin(2 * np.pi * hertz * now) * (now >= 0) * (now < stop - start)
    return np.stack((wave, 0.5 * wave), axis=1)


def label(change, *events):
    return annotate(TWIN + change, TWIN, events, rate=RATE)


def failures(blocks):
    return [block for block in blocks if block.label != "ok"]


def test_a_strong_blow_is_an_impact_from_its_onset():
    blocks, (trace,) = label(knock(2.0, 1.0), Event("impact", "contact", 2.0, 2.02))
    (impact,) = failures(blocks)
    assert impact.label == "impact"
    assert impact.start == pytest.approx(2.0, abs=0.001)
    assert 0.02 < impact.stop - impact.start < 0.2
    assert trace["labelled"] == pytest.approx(impact.stop - impact.start)
    assert trace["peak"] > 0.1


def test_a_weak_blow_is_recorded_and_neither_impact_nor_ok():
    blocks, (trace,) = label(knock(2.0, 0.1), Event("impact", "contact", 2.0, 2.02))
    assert failures(blocks) == []
    assert not any(block.start < 2.01 < block.stop for block in blocks)
    assert trace["labelled"] == 0
    assert 0.03 < trace["peak"] < 0.1


def test_a_sudden_velocity_is_a_high_acceleration_and_a_gentle_one_is_not():
    def rise(seconds):
        return 0.5 * np.clip((TIME - 2) / seconds, 0, 1)[:, None] * [1.0, 0.0]

    event = Event("highaccelerations", "jump", 2.0, 2.001)
    assert [block.label for block in failures(label(rise(0.01), event)[0])] == ["highaccelerations"]
    assert failures(label(rise(0.2), event)[0]) == []


def test_a_shaking_joint_oscillates_a_single_blow_or_a_command_without_an_effect_does_not():
    event = Event("oscillations", "multi-sine", 1.0, 3.0)
    (block,) = failures(label(shake(1.0, 3.0, 0.2), event)[0])
    assert block.label == "oscillations"
    assert (block.start, block.stop) == pytest.approx((1.0, 3.0), abs=0.05)
    assert failures(label(knock(2.0, 1.0, decay=0.01), event)[0]) == []
    blocks, (trace,) = label(shake(1.0, 3.0, 0.01), event)
    assert [block.label for block in blocks] == ["ok", "ok"]
    assert blocks[0].stop == pytest.approx(0.95, abs=0.002)
    assert blocks[1].start == pytest.approx(3.05, abs=0.002)
    assert trace["labelled"] == 0


def test_a_deviation_long_after_the_event_has_no_label():
    blocks, _ = label(shake(1.0, 3.0, 0.2), Event("impact", "contact", 1.0, 1.02))
    (impact,) = failures(blocks)
    assert impact.stop == pytest.approx(1.17, abs=1e-3)
    assert all(block.stop < 1.0 or block.start > 3.0 for block in blocks if block.label == "ok")


def test_an_event_during_another_belongs_to_it_and_else_ends_where_the_next_one_begins():
    impact = Event("impact", "contact", 2.0, 2.02)
    blocks, traces = label(
        shake(1.0, 3.0, 0.3), impact, Event("oscillations", "multi-sine", 1.0, 3.0)
    )
    assert [block.label for block in failures(blocks)] == ["oscillations"]
    assert [trace["label"] for trace in traces] == ["oscillations"]
    blocks, _ = label(shake(2.0, 4.0, 0.3), impact, Event("oscillations", "multi-sine", 2.1, 4.0))
    first, second = failures(blocks)
    assert first.stop == second.start == pytest.approx(2.1)


def test_blocks_never_overlap_and_keep_their_distance_from_ok():
    blocks, _ = label(
        knock(1.0, 1.0) + shake(2.0, 3.0, 0.2),
        Event("impact", "contact", 1.0, 1.02),
        Event("oscillations", "multi-sine", 2.0, 3.0),
    )
    assert [block.label for block in blocks] == ["ok", "impact", "ok", "oscillations", "ok"]
    for before, after in pairwise(blocks):
        assert after.start - before.stop >= 0.0499


def test_the_deviation_is_causal():
    fast = deviation(TWIN + knock(2.0, 1.0), TWIN, rate=RATE)
    assert not fast[: 2 * RATE].any()
    assert fast[2 * RATE + 1].any()


def test_an_event_below_its_background_has_no_label():
    parted = shake(0.5, 4.0, 0.2, hertz=15.0)  # a run that has long left its twin
    event = Event("impact", "contact", 2.0, 2.02)
    assert failures(label(parted, event)[0]) == []
    blocks, (trace,) = label(parted + knock(2.0, 2.0), event)
    (impact,) = failures(blocks)
    assert impact.start == pytest.approx(2.0, abs=0.01)
    assert impact.stop == pytest.approx(2.17, abs=1e-3)
    assert 0.1 < trace["background"] < 0.3


def test_earlier_events_are_not_background():
    first, second = (Event("impact", "contact", at, at + 0.02) for at in (2.0, 2.4))
    blocks, traces = label(knock(2.0, 3.0) + knock(2.4, 1.0), first, second)
    assert len(failures(blocks)) == 2
    assert traces[1]["background"] < 0.2 * traces[0]["peak"]


def test_a_commanded_oscillation_is_detected_in_its_band():
    event = Event("oscillations", "multi-sine", 1.0, 3.0, {"band": [60, 100]})
    assert failures(label(shake(1.0, 3.0, 0.3, hertz=12.0), event)[0]) == []
    blocks, _ = label(shake(1.0, 3.1, 0.3, hertz=80.0), event)
    (block,) = failures(blocks)
    assert (block.start, block.stop) == pytest.approx((1.0, 3.1), abs=0.05)
