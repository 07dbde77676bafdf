"""What lasts needs no past: lines that stand out, the same whole and in chunks."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from noiseclassifier import Event, Lasting, merged
from noiseclassifier.lasting import FLOOR, SHORTEST, STRONG, spectrum

RATE = 1000.0


def motion(seconds=4.0, rate=RATE, noise=1e-3):
    """Two joints that swing, and the noise of their sensors."""
    time = np.arange(round(seconds * rate)) / rate
    slow = np.stack([np.cos(2.0 * time), np.sin(3.0 * time)])
    return time, slow + noise * np.random.default_rng(1).standard_normal(slow.shape)


def shaken(frequency, rms, *, seconds=4.0, rate=RATE, start=0.0, stop=np.inf):
    time, velocity = motion(seconds, rate)
    during = (time >= start) & (time < stop)
    velocity[1] += during * rms * np.sqrt(2.0) * np.sin(2.0 * np.pi * frequency * time)
    return velocity


def found(velocity, rate=RATE, *, valid=None, error=None):
    lasting = Lasting(rate)
    errors = {} if error is None else {"error_joints": error}
    lasting.push({"measured_joints": velocity, **errors}, valid)
    lasting.finish()
    return lasting.events


@pytest.mark.parametrize("frequency", [15.0, 40.0, 120.0, 330.0])
def test_the_power_of_a_line_is_the_mean_square_of_its_tone(frequency):
    time = np.arange(1000) / RATE
    tone = 0.3 * np.sqrt(2) * np.sin(2 * np.pi * frequency * time)
    power, frequencies = spectrum(np.diff(tone), RATE)
    assert np.sqrt(power.max()) == pytest.approx(0.3, rel=0.15)  # between two bins
    assert frequencies[power.argmax()] == pytest.approx(frequency, abs=1.0)


@pytest.mark.parametrize("rate", [100.0, 200.0, 500.0, 1000.0])
@pytest.mark.parametrize("rms", [0.1, 1.0, 100.0])
def test_a_tone_from_the_first_sample_to_the_last_is_one_finding_however_loud(rms, rate):
    (event,) = found(shaken(0.3 * rate, rms, rate=rate), rate)
    assert event.label == "oscillations"
    assert (event.start, event.stop) == pytest.approx((0.0, 4.0))


def test_motion_and_the_noise_of_sensors_are_no_finding():
    assert found(motion()[1]) == ()
    assert found(motion(noise=0.3)[1]) == ()


def test_a_line_below_25_millirad_per_second_is_none_however_silent_the_joint_is():
    level = 10.0 ** ((FLOOR + STRONG) / 20.0)
    assert level == pytest.approx(0.025, abs=1e-3)
    assert found(shaken(60.0, 0.8 * level)) == ()
    faint, loud = (found(shaken(60.0, share * level))[0].score for share in (1.2, 12.0))
    assert 0.5 <= faint < 0.75 < 0.9 < loud <= 1.0


def test_a_ripple_that_follows_the_speed_of_its_joint_is_no_finding():
    time, velocity = motion()
    angle = np.cumsum(1.0 + 0.6 * np.sin(2.0 * time)) / RATE
    assert found(velocity + 0.05 * np.sin(60.0 * angle * 2.0 * np.pi)) == ()


def stairs(speed, *, hold=0.01, seconds=4.0):
    """Velocity of a drive, a spring and a damper, whose targets are held for a while."""
    time, (velocity, position), out = motion(seconds)[0], (speed, 0.0), []
    stiffness, damping = (2 * np.pi * 12.0) ** 2, 1.4 * 2 * np.pi * 12.0
    target = speed / 12.0 * np.sin(12.0 * (time - time % hold))
    for each in target.tolist():
        velocity += (stiffness * (each - position) - damping * velocity) / RATE
        position += velocity / RATE
        out.append(velocity)
    return np.array(out)


@pytest.mark.parametrize("speed", [1.0, 5.0, 25.0])
def test_targets_that_are_held_leave_no_finding_however_fast_the_joint_is(speed):
    time, slow = motion()
    held = stairs(speed)
    power, frequency = spectrum(np.diff(held[1000:2000]), RATE)
    line = power[np.abs(frequency - 100.0) < 5.0].max()
    assert found(slow + held) == ()
    tone = np.sqrt(2.0 * line) * np.sin(2 * np.pi * 100.0 * time)
    assert bool(found(slow + tone)) == (speed > 1.0)  # as loud, in joints that are slow


@pytest.mark.parametrize("speed", [2.0, 20.0])
def test_a_line_counts_from_27_db_below_the_motion_of_its_joint_on(speed):
    time, velocity = motion()
    velocity[1] += speed * np.sin(2 * np.pi * 3.0 * time)
    for below, count in ((31.0, 0), (24.0, 1)):
        line = 10.0 ** (-below / 20.0) * speed * np.sin(2 * np.pi * 60.0 * time)
        assert len(found(velocity + np.outer([0, 1], line))) == count


def test_a_line_of_the_desired_motion_alone_is_no_finding():
    time, velocity = motion()
    steps = 0.3 * np.sin(2 * np.pi * 50.0 * time)
    assert found(velocity, error=steps - 0.01 * velocity) == ()


def test_an_error_of_zero_changes_nothing():
    velocity = shaken(60.0, 0.3)
    assert found(velocity, error=np.zeros_like(velocity)) == found(velocity) != ()


def test_a_loud_half_second_is_found_near_its_time():
    (event,) = found(shaken(70.0, 1.0, start=1.6, stop=2.1))
    assert 1.0 < event.start < 1.8
    assert 1.9 < event.stop < 2.7


def test_a_tone_is_found_in_every_piece_of_it_that_is_long_enough():
    velocity = shaken(70.0, 0.2, seconds=6.0)
    generator = np.random.default_rng(2)
    for _ in range(30):
        length = generator.uniform(SHORTEST + 0.01, 3.0)
        first = generator.uniform(0.0, 6.0 - length)
        piece = velocity[:, round(first * RATE) : round((first + length) * RATE)]
        assert [event.label for event in found(piece)] == ["oscillations"]


def test_a_piece_that_is_too_short_has_no_finding():
    assert found(shaken(70.0, 1.0, seconds=SHORTEST - 0.01)) == ()


def test_a_gap_parts_stretches():
    valid = np.ones(4000, dtype=bool)
    valid[1900:2100] = False
    first, second = found(shaken(70.0, 0.3), valid=valid)
    assert (first.start, first.stop, second.start) == pytest.approx((0.0, 1.9, 2.1))
    assert second.stop == pytest.approx(4.0)


@given(st.lists(st.integers(0, 900), min_size=1, max_size=20), st.booleans())
@settings(deadline=None, max_examples=25)
def test_chunks_have_the_findings_of_the_whole(sizes, gap):
    velocity = shaken(70.0, 0.3, start=0.7, stop=3.1)
    valid = np.ones(velocity.shape[1], dtype=bool)
    valid[2500:2600] = not gap
    lasting, first = Lasting(RATE), 0
    for size in [*sizes, velocity.shape[1]]:
        piece = slice(first, first + size)
        lasting.push({"measured_joints": velocity[:, piece]}, valid[piece])
        first += size
    lasting.finish()
    assert lasting.events == found(velocity, valid=valid)


def test_nothing_begins_before_the_time_that_is_decided():
    velocity, lasting = shaken(70.0, 0.3, start=1.2, stop=2.9), Lasting(RATE)
    for first in range(0, 4000, 50):
        before, decided = lasting.events, lasting.decided
        lasting.push({"measured_joints": velocity[:, first : first + 50]})
        for event in set(lasting.events) - set(before):
            assert event.stop >= decided
    assert lasting.events


def test_events_that_touch_become_one_of_the_class_that_lasts_longer_and_is_known():
    blow, hum = Event("impact", 1.0, 1.4, 0.9), Event("oscillations", 1.4, 3.0, 0.6)
    odd = Event("unknown", 2.5, 9.0, 0.7, novel=True)
    assert merged(hum, blow) == (Event("oscillations", 1.0, 3.0, 0.6),)
    assert merged(odd, hum, blow) == (Event("oscillations", 1.0, 9.0, 0.6, novel=True),)
    assert merged(blow, Event("impact", 2.0, 2.4, 0.5)) == (blow, Event("impact", 2.0, 2.4, 0.5))
