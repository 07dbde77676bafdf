import io
import wave

import numpy as np
import pytest
from commandline import call, printed
from test_audit_bandwidth import run_of as of_velocities

import noisemodel as nm
from inspector.errors import InspectorError
from inspector.export.sound import clip, common_gain, remarks, sonify

RATE = 10_000.0


def times(seconds=2.0, rate=RATE):
    return np.arange(round(seconds * rate)) / rate


def run_of(*columns, rate=RATE, **fields):
    """A run whose joints have the given velocities."""
    return of_velocities(np.column_stack(columns), rate, **fields)


def tone(hertz, seconds=2.0, rate=RATE):
    return np.sin(2 * np.pi * hertz * times(seconds, rate))


def pitch(data):
    """The loudest frequency of a WAV file, in [Hz], and the file's rate."""
    samples, rate = read(data)
    spectrum = np.abs(np.fft.rfft(samples * np.hanning(len(samples))))
    return spectrum.argmax() * rate / len(samples), rate


def read(data):
    with wave.open(io.BytesIO(data)) as file:
        assert (file.getnchannels(), file.getsampwidth()) == (1, 2)
        frames = file.readframes(file.getnframes())
        return np.frombuffer(frames, dtype="<i2") / 32767, file.getframerate()


def middle(signal):
    """A sound without its ends, which are faded."""
    return signal[len(signal) // 4 : -len(signal) // 4]


def rms(signal):
    return float(np.sqrt(np.mean(np.square(middle(signal)))))


def test_an_oscillation_about_a_steady_motion_sounds_the_same():
    still, moving = (sonify(run_of(base + 0.01 * tone(440))) for base in (0.0, 2.0))
    np.testing.assert_allclose(middle(still.signal), middle(moving.signal), atol=1e-8)


def test_powers_of_joints_in_antiphase_add():
    velocity = 0.01 * tone(300)
    alone = sonify(run_of(velocity))
    against = sonify(run_of(velocity, -velocity))
    assert rms(against.signal) == pytest.approx(np.sqrt(2) * rms(alone.signal), rel=1e-6)


def test_the_power_of_a_sound_is_that_of_the_noise_estimate():
    velocity = np.random.default_rng(0).normal(size=(20_000, 3))
    run = run_of(*velocity.T, velocity_desired=0.5 * velocity)
    whole = np.sqrt(np.mean(nm.simplified(run.motion, run.velocity_desired) ** 2))
    # Windows that overlap do not quite agree where many joints rattle at random.
    assert 20 * np.log10(rms(sonify(run).signal) / whole) == pytest.approx(0, abs=1.0)


def test_the_full_scale_is_used_without_clipping_and_standstill_is_silent():
    loud = sonify(run_of(0.01 * tone(440)))
    whole = np.abs(read(loud.file(common_gain([loud])))[0]).max()
    assert 0.85 < whole < 0.9  # 1 dB of headroom
    sound = sonify(run_of(np.zeros(20_000), np.zeros(20_000)))
    assert sound.silent
    assert common_gain([sound]) == 0.0
    assert not read(sound.file(60.0))[0].any()
    assert "silent: nothing reaches 1e-06 rad/s" in sound.description(0.0)
    assert str(sound).startswith("simplified noise above 20 Hz: silent")


def test_gaps_are_silent_without_ringing():
    valid = np.ones(20_000, dtype=bool)
    valid[8000:12_000] = False
    run = run_of(tone(440) * valid, valid=valid)
    sound = sonify(run)
    assert not sound.signal[~valid].any()
    assert np.abs(np.diff(sound.signal)).max() < 0.3  # no click: the tone itself moves by 0.28
    assert "Gaps are silent." in remarks(run, 1.0)


def test_an_impact_sounds_at_its_time():
    still, hit = np.zeros(20_000), np.zeros(20_000)
    hit[10_000:10_020] = 1.0
    sound = sonify(run_of(still + 1e-4 * tone(300), hit))
    assert np.abs(sound.signal).argmax() == pytest.approx(10_010, abs=25)


@pytest.mark.parametrize("rate", [100.0, 333.0, 1000.0, 9999.0, RATE, 48_000.0, 100_000.0])
def test_a_sound_has_the_duration_and_the_pitch_of_its_log_at_any_rate(rate):
    hertz = min(rate / 4, 440.0)
    sound = sonify(run_of(tone(hertz, rate=rate), rate=rate))
    data = sound.file(-6.0)
    assert len(read(data)[0]) / 48_000 == pytest.approx(2.0, abs=2 / rate)
    assert pitch(data) == (pytest.approx(hertz, abs=0.5), 48_000)


def test_playing_faster_makes_low_frequencies_audible():
    run = run_of(tone(12, 4.0, 100.0), rate=100.0)
    sound = sonify(run, speed=10.0)
    data = sound.file(-6.0)
    assert len(read(data)[0]) / 48_000 == pytest.approx(0.4, abs=0.01)
    assert pitch(data)[0] == pytest.approx(120, abs=3)
    assert "Played 10 times as fast: frequencies are 10 times as high." in remarks(run, 10.0)


def test_a_log_at_a_low_rate_has_a_remark_and_without_audible_frequencies_is_refused():
    found = list(remarks(run_of(tone(40, rate=250.0), rate=250.0), 1.0))
    assert "Audible: 20 Hz to 125 Hz of the motion (half the rate of 250 Hz)." in found
    assert any("no content above 125 Hz" in remark for remark in found)
    run = run_of(tone(5, rate=30.0), rate=30.0)
    with pytest.raises(InspectorError, match="30 Hz has no content above 15 Hz.*--speed 6"):
        sonify(run)
    assert not sonify(run, speed=6.0).silent
    assert clip(run) is None


@pytest.mark.parametrize(("joint", "hertz"), [("joint0", 300), ("joint1", 700)])
def test_one_joint_of_several_can_be_chosen(joint, hertz):
    sound = sonify(run_of(tone(300), tone(700)), joint=joint)
    assert pitch(sound.file(-6.0))[0] == pytest.approx(hertz, abs=0.5)


def test_the_command_writes_runs_at_one_gain(tmp_path):
    runs = [tmp_path / "before.npz", tmp_path / "after.npz"]
    for path, size in zip(runs, (0.01, 0.05), strict=True):
        run_of(size * tone(440)).save(path)
    out = printed("listen", *runs, "-o", tmp_path / "ab.wav")
    assert out.count("gain +24.9 dB: full scale is 0.0569 rad/s") == 2
    assert (
        out.count("  The run has no desired velocities: the sound is of the measured motion") == 2
    )
    assert f"{tmp_path}/ab.b.wav: 2.00 s" in out
    files = (tmp_path / f"ab.{letter}.wav" for letter in "ab")
    peaks = [np.abs(middle(read(path.read_bytes())[0])).max() for path in files]
    assert peaks[1] / peaks[0] == pytest.approx(5, rel=1e-3)
    assert call("listen", *runs, "-o", tmp_path / "ab.wav")[0] == 3  # they exist


def test_the_command_refuses_wrong_settings_in_one_line(tmp_path):
    run_of(tone(440)).save(tmp_path / "run.npz")
    output = tmp_path / "o.wav"
    for option, value, code, text in (
        ("--joint", "knee", 3, "no joint 'knee' in the run; it has joint0"),
        ("--speed", "0", 2, "a speed of 0, expected 0.01 to 1000"),
    ):
        status, out, err = call("listen", tmp_path / "run.npz", "-o", output, option, value)
        assert (status, out, err) == (code, "", f"inspector: {text}\n")
    assert not output.exists()


def test_a_clip_has_the_whole_run_or_the_part_around_its_worst_moment(monkeypatch):
    run = run_of(0.01 * tone(440), 0.01 * tone(300))
    whole = clip(run)
    assert (whole.start, whole.stop) == (0.0, 2.0)
    monkeypatch.setattr("inspector.export.sound.MOST_VELOCITIES", 10_000)
    part = clip(run, around=1.5)
    assert (part.start, part.stop) == (1.25, 1.75)
    samples, rate = read(part.file(common_gain([part])))
    assert (len(samples), rate) == (8000, 16_000)
