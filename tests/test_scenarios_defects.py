"""Defects draw faults that keep to their settings, and record them."""

import numpy as np
import pytest

from noiseclassifier.scenarios.arm import pick
from noiseclassifier.scenarios.faults import (
    Decalibration,
    ForceGain,
    GivingWay,
    Multisine,
    NoDefect,
    Obstacles,
    ReferenceJumps,
    SensorJumps,
    pulses,
    ramps,
    sines,
    step,
)
from noiseclassifier.scenarios.motions import Picks, Rod
from noiseclassifier.scenarios.table import SCENARIOS

ARM = {name: each.cases["arm"] for name, each in SCENARIOS.items() if "arm" in each.cases}

TIME = np.arange(70_000) * 1e-4


@pytest.fixture(scope="module")
def plan():
    return pick(
        Picks(),
        np.random.default_rng(0),
        start=np.array([0.46, 0.0, 0.43]),
        tool=Rod("hand", length=0.08, radius=0.01),
        table=0.1,
        reach=((0.4, 0.58), (-0.2, 0.2)),
        duration=7.0,
    )


@pytest.mark.parametrize("name", ARM)
def test_the_same_seed_draws_the_same_faults(name, plan):
    one, two = (ARM[name].defect.draw(np.random.default_rng(4), plan) for _ in range(2))
    assert one.events == two.events
    assert one.facts == two.facts
    assert one.boxes == two.boxes
    assert one.sensors.keys() == two.sensors.keys()
    np.testing.assert_array_equal(one.gain(plan.time), two.gain(plan.time))
    for signal, time in (("shift", plan.time), ("overlay", TIME)):
        first, second = getattr(one, signal), getattr(two, signal)
        assert (first is None) == (second is None)
        if first is not None:
            np.testing.assert_array_equal(first(time), second(time))


@pytest.mark.parametrize("name", ARM)
def test_events_of_a_defect_have_labels_of_its_scenario(name, plan):
    faults = ARM[name].defect.draw(np.random.default_rng(0), plan)
    assert {event.label for event in faults.events} <= set(SCENARIOS[name].labels)


def test_no_defect_changes_nothing(plan):
    faults = NoDefect().draw(np.random.default_rng(0), plan)
    assert faults.shift is faults.overlay is faults.ground is None
    assert (faults.boxes, dict(faults.decalibration), dict(faults.sensors)) == ((), {}, {})
    assert (faults.gain(plan.time) == 1).all()


def test_obstacles_lie_on_the_table_where_the_tool_comes_down(plan):
    defect = Obstacles((0.014, 0.025), (0.05, 0.05), share=0.7)
    faults = defect.draw(np.random.default_rng(1), plan)
    places = [contact.place for contact in plan.contacts]
    assert faults.boxes
    for box in faults.boxes:
        assert box.centre[2] - box.half[2] == pytest.approx(0.1)
        assert 0.114 <= box.top <= 0.125
        assert (box.centre[0], box.centre[1]) in [place[:2] for place in places]


def test_of_some_obstacles_only_so_many_are_drawn_and_they_are_offset_along_the_effector(plan):
    defect = Obstacles((0.02, 0.02), (0.01, 0.01), offset=(3.0, -1.0), most=1)
    (box,) = defect.draw(np.random.default_rng(1), plan).boxes
    offsets = [np.subtract(box.centre[:2], contact.place[:2]) for contact in plan.contacts]
    assert any(np.allclose(offset, [0.03, -0.01]) for offset in offsets)


def test_ground_that_gives_way_is_as_high_as_before_until_it_does(plan):
    faults = GivingWay((0.01, 0.01), (0.05, 0.05), (0.3, 0.5)).draw(np.random.default_rng(1), plan)
    assert [box.top for box in faults.ground] == pytest.approx([0.09])
    for box, contact in zip(faults.boxes, plan.contacts, strict=True):
        assert box.top == pytest.approx(0.1)
        assert contact.start + 0.3 <= box.until <= contact.start + 0.5
    assert {event.label for event in faults.events} == {"highaccelerations"}


def test_jumps_of_the_reference_return(plan):
    faults = ReferenceJumps().draw(np.random.default_rng(2), plan)
    shift = np.linalg.norm(faults.shift(plan.time)[:, 0], axis=1)
    assert not shift[: int(faults.events[0].start * 1e3)].any()
    assert 0.001 <= shift.max() <= 0.004
    after_second = int((faults.events[1].stop + 0.01) * 1e3)
    assert shift[after_second] == pytest.approx(0, abs=1e-12)
    steps = np.linalg.norm(np.diff(faults.shift(plan.time)[:, 0], axis=0), axis=1)
    assert steps.max() <= 2.0 * 1e-3 + 1e-9  # never faster than the settings


def test_the_force_signal_jumps_only_while_the_tool_presses(plan):
    faults = SensorJumps((80.0, 160.0)).draw(np.random.default_rng(3), plan)
    signal = faults.sensors["hand.touch"](plan.time)[:, 0]
    wrong = plan.time[signal != 0]
    assert np.abs(signal[signal != 0]).min() >= 80
    assert wrong.size
    assert all(
        any(contact.start < time < contact.lift for contact in plan.contacts)
        for time in wrong.tolist()
    )


def test_a_gain_and_an_encoder_are_off_by_what_was_drawn(plan):
    gain = ForceGain(factor=(6.0, 7.0)).draw(np.random.default_rng(0), plan)
    assert 6 <= gain.gain(plan.time)[0] == gain.facts["factor"] <= 7
    later = ForceGain(factor=(6.0, 7.0), start=(0.5, 0.5), contacts=False)
    gains = later.draw(np.random.default_rng(0), plan).gain(plan.time)
    assert (gains[: len(gains) // 2] == 1).all()
    assert (gains[len(gains) // 2 :] > 6).all()
    assert len(gain.events) == len(plan.contacts)
    encoder = Decalibration(joints=(2,), angle=(0.1, 0.2)).draw(np.random.default_rng(0), plan)
    assert 0.1 <= encoder.decalibration[2] <= 0.2


def test_a_multisine_has_one_line_per_hertz_of_its_band(plan):
    wave = sines(
        TIME,
        rates=2 * np.pi * np.arange(40, 51.0),
        phases=np.zeros(11),
        amplitude=1e-3,
        start=-1.0,
        stop=9.0,
        shares=np.ones(1),
    )[10_000:60_000, 0, 0]
    spectrum = np.abs(np.fft.rfft(wave))[::5]  # 5 s: every fifth bin is a whole hertz
    assert set(np.flatnonzero(spectrum > 0.1 * spectrum.max())) == set(range(40, 51))
    assert np.sqrt(2 * np.mean(wave**2)) == pytest.approx(1e-3, rel=1e-6)


def test_the_rate_of_a_multisine_is_its_slope():
    wave = sines(
        TIME,
        rates=np.array([150.0]),
        phases=np.ones(1),
        amplitude=1e-3,
        start=1.0,
        stop=5.0,
        shares=np.array([0.0, 1.0]),
    )
    assert not wave[:, 0].any()
    wave = wave[:, 1]
    inside = slice(12_000, 48_000)
    np.testing.assert_allclose(
        np.gradient(wave[:, 0], 1e-4)[inside], wave[inside, 1], rtol=0, atol=1e-4
    )
    assert not wave[:10_000].any()
    assert not wave[50_000:].any()


def test_high_bands_get_small_amplitudes(plan):
    settings = Multisine(bands=((900, 1000),), amplitude=(0.002, 0.002), fastest=1.0)
    faults = settings.draw(np.random.default_rng(0), plan)
    assert faults.facts["amplitude"] == pytest.approx(1.0 / (2 * np.pi * 1000))


def test_ramps_and_pulses_add_up():
    time = np.array([0.0, 1.0, 1.5, 2.0, 3.0])
    moved = ramps(
        time,
        starts=np.array([1.0]),
        rises=np.array([1.0]),
        moves=np.array([[0, 0, 2.0]]),
        effectors=np.array([1]),
        count=2,
    )
    np.testing.assert_allclose(moved[:, 1, 2], [0, 0, 1, 2, 2])
    assert not moved[:, 0].any()
    pulse = pulses(
        time,
        starts=np.array([1.0, 1.5]),
        stops=np.array([2.0, 2.5]),
        sizes=np.array([[3.0], [4.0]]),
    )
    np.testing.assert_allclose(pulse[:, 0], [0, 3, 7, 4, 0])
    np.testing.assert_array_equal(step(time, start=1.5, factor=5.0), [1, 1, 5, 5, 5])
