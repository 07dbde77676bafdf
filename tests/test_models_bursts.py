"""Bursts: lines that the rest of their run lacks."""

import numpy as np
import pytest

from noiseclassifier.bursts import Bursts
from noiseclassifier.lasting import MEASURED

RATE = 500.0


def motion(seconds=8.0, rate=RATE, noise=1e-3):
    """A slow motion of three joints, with the noise of a sensor."""
    time = np.arange(round(seconds * rate)) / rate
    slow = np.sin(2 * np.pi * np.outer([0.3, 0.5, 0.8], time))
    return slow + noise * np.random.default_rng(4).standard_normal(slow.shape)


def with_tone(velocity, frequency, rms, start, stop, *, rate=RATE, joint=1):
    """The motion with a tone in one joint for a while."""
    time = np.arange(velocity.shape[1]) / rate
    during = (time >= start) & (time < stop)
    tone = during * rms * np.sqrt(2) * np.sin(2 * np.pi * frequency * time)
    return velocity + tone * (np.arange(len(velocity)) == joint)[:, None]


def found(velocity, *, rate=RATE, whole=True, valid=None, sizes=(10**9,)):
    """Bursts of a signal that comes in chunks."""
    bursts, first = Bursts(rate, whole=whole), 0
    for size in [*sizes, 10**9]:
        part = slice(first, first + size)
        bursts.push({MEASURED: velocity[:, part]}, None if valid is None else valid[part])
        first += size
    bursts.finish()
    return bursts.events


@pytest.mark.parametrize("rate", [100.0, 200.0, 1000.0, 4000.0])
@pytest.mark.parametrize("rms", [0.03, 1.0, 100.0])
def test_a_tone_of_half_a_second_is_one_burst_however_loud(rms, rate):
    for frequency in (16.0, 0.3 * rate):
        velocity = with_tone(motion(rate=rate), frequency, rms, 4.0, 4.5, rate=rate)
        (event,) = found(velocity, rate=rate)
        assert event.label == "oscillations"
        assert (event.start, event.stop) == pytest.approx((4.0, 4.5), abs=0.3)


@pytest.mark.parametrize("rate", [300.0, 997.0, 1000.0])
@pytest.mark.parametrize("duration", [0.4, 0.7, 1.1])
def test_a_tone_is_one_burst_however_long_it_lasts(duration, rate):
    for start in (2.01, 3.3, 4.77):
        velocity = with_tone(motion(rate=rate), 90.0, 0.1, start, start + duration, rate=rate)
        (event,) = found(velocity, rate=rate)
        assert event.start < start + duration / 2 < event.stop
        assert event.score == pytest.approx(0.8, abs=0.005)  # of a line of 22 dB


@pytest.mark.parametrize("whole", [True, False])
def test_motion_and_the_noise_of_sensors_are_no_burst(whole):
    assert found(motion(), whole=whole) == ()


def test_a_tone_from_the_first_sample_to_the_last_is_no_burst():
    assert found(with_tone(motion(), 90.0, 1.0, 0.0, 8.0)) == ()


def test_a_tone_that_comes_again_and_again_is_no_burst():
    velocity = motion()
    for start in (1.0, 3.0, 5.0, 7.0):
        velocity = with_tone(velocity, 90.0, 0.1, start, start + 0.5)
    assert found(velocity) == ()


@pytest.mark.parametrize("whole", [True, False])
def test_a_line_that_rises_with_the_speed_of_its_joint_is_no_burst(whole):
    time = np.arange(4000) / RATE
    during = np.exp(-(((time - 5.0) / 0.3) ** 2))
    speed = (0.3 + 6.0 * during) * np.sin(2 * np.pi * 2.0 * time)
    line = 0.02 * (0.3 + 6.0 * during) * np.sin(2 * np.pi * 90.0 * time)
    own = (np.arange(3) == 1)[:, None]
    assert found(motion() + own * (speed + line), whole=whole) == ()
    assert len(found(motion() + own * line, whole=whole)) == 1  # without the speed
    fast = motion() + own * 0.8 * np.sin(2 * np.pi * 3.0 * time)
    assert len(found(with_tone(fast, 90.0, 0.1, 5.0, 5.5), whole=whole)) == 1


@pytest.mark.parametrize("rms", [0.5, 1.0, 100.0])
def test_a_loud_tone_in_the_only_motion_of_a_run_is_a_burst(rms):
    velocity = 1e-3 * np.random.default_rng(4).standard_normal((3, 4000))
    velocity[1, 1950:2300] += np.hanning(350)
    assert found(velocity) == ()
    assert len(found(with_tone(velocity, 90.0, rms, 4.0, 4.5))) == 1


def test_a_line_that_the_rest_nearly_has_is_no_burst_even_of_a_joint_that_rests():
    time = np.arange(4000) / RATE
    during = (time >= 4.0) & (time < 4.5)
    velocity = motion()
    velocity[1] *= 1.0 - np.exp(-(((time - 4.25) / 0.5) ** 4))
    for above, count in ((15.0, 0), (24.0, 1)):
        tone = 0.02 * 10.0 ** (during * above / 20.0) * np.sin(2 * np.pi * 90.0 * time)
        assert len(found(velocity + (np.arange(3) == 1)[:, None] * tone)) == count


def test_an_octave_of_noise_is_no_burst():
    velocity = motion()
    waves = np.fft.rfft(np.random.default_rng(5).standard_normal(250))
    own = np.fft.rfftfreq(250, 1 / RATE)
    waves[(own < 60.0) | (own > 120.0)] = 0.0
    velocity[1, 2000:2250] += np.fft.irfft(waves, 250)
    assert found(velocity) == ()


def test_a_line_of_2_millirad_per_second_is_none_however_silent_the_joint_is():
    assert found(with_tone(motion(noise=1e-6), 90.0, 2e-3, 4.0, 4.5)) == ()
    assert found(with_tone(motion(noise=1e-6), 90.0, 2e-2, 4.0, 4.5))


def test_a_stream_has_its_past_alone():
    """A burst in the first two seconds is one in a file, and none in a stream."""
    early, late = (with_tone(motion(), 90.0, 0.1, start, start + 0.5) for start in (1.0, 5.0))
    assert len(found(early)) == len(found(late)) == 1
    assert found(early, whole=False) == ()
    assert len(found(late, whole=False)) == 1


def test_a_run_that_is_too_short_has_no_burst():
    assert found(with_tone(motion(1.6), 90.0, 0.1, 0.6, 1.1)) == ()


@pytest.mark.parametrize("whole", [True, False])
@pytest.mark.parametrize("size", [1, 7, 100, 1999])
def test_chunks_have_the_bursts_of_the_whole(size, whole):
    velocity = with_tone(motion(), 90.0, 0.1, 5.0, 5.5)
    valid = np.ones(velocity.shape[1], dtype=bool)
    valid[1500:1600] = False
    sizes = [size] * (velocity.shape[1] // size)
    events = found(velocity, whole=whole, valid=valid)
    assert found(velocity, whole=whole, valid=valid, sizes=sizes) == events
    assert len(events) == 1


def test_no_burst_touches_a_gap():
    velocity = with_tone(motion(), 90.0, 0.1, 4.0, 4.5)
    valid = np.ones(velocity.shape[1], dtype=bool)
    assert found(velocity, valid=valid)
    valid[1990:2260] = False
    assert found(velocity, valid=valid) == ()


@pytest.mark.parametrize("gap", [4.0, 4.05, 4.1])
def test_a_tone_that_a_gap_parts_in_the_middle_is_found(gap):
    """What comes just before a gap is no rest of what comes after it."""
    velocity = with_tone(motion(), 90.0, 0.1, 3.7, 4.5)
    valid = np.ones(velocity.shape[1], dtype=bool)
    valid[round(gap * RATE) : round(gap * RATE) + 20] = False
    assert found(velocity, valid=valid)
