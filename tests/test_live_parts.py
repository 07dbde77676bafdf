import numpy as np
import pytest
import rerun as rr
from generalmodel import fixed, run_at, trained

import noisemodel as nm
from inspector.levels import SPECTRUM
from inspector.library import label_run
from inspector.live.drawing import LiveRobot, Messages, SpectrogramStream
from inspector.live.labels import Labeller, noise_signals
from inspector.live.session import Clock, Warnings
from inspector.recording import robot as scene
from inspector.recording.robot import FIELD_OF_VIEW, sight


def warnings():
    lines = []
    return Warnings(lines.append), lines


def taken(stamps, rate=1000.0, size=50):
    """Which stamps a clock keeps, and when they are, in batches; how many are lost; warnings."""
    counted, lines = warnings()
    clock, stamps = Clock(rate, counted), np.asarray(stamps, dtype=np.float64)
    kept, times, lost, held = [], [], 0, stamps[:0]
    for first in range(0, len(stamps), size):
        held = np.append(held, stamps[first : first + size])
        mask, missing, time = clock.take(held, ended=first + size >= len(stamps))
        kept, times, lost = [*kept, *mask], [*times, *time], lost + int(missing.sum())
        held = held[len(mask) :]
    assert not len(held)
    assert (np.diff(times) > 0).all()
    return np.array(kept), np.array(times), lost, counted.counts, lines


@pytest.mark.parametrize("rate", [240.0, 300.0, 400.0, 480.0, 600.0, 700.0, 800.0, 900.0])
@pytest.mark.parametrize("rounded", [np.round, np.floor])
@pytest.mark.parametrize("size", [50, 7, 1])
def test_stamps_in_whole_milliseconds_lose_nothing_and_have_the_right_rate(rate, rounded, size):
    stamps = rounded(np.arange(2000) * 1e3 / rate) / 1e3
    kept, _, lost, _, lines = taken(stamps, rate, size)
    assert (kept.all(), lost, lines) == (True, 0, [])
    assert taken(np.delete(stamps, range(700, 705)), rate, size)[2] == pytest.approx(5, abs=1)


def test_even_stamps_lose_nothing_and_jitter_is_no_gap():
    random = np.random.default_rng(0)
    kept, _, lost, _, lines = taken(np.arange(500) / 1000 + random.uniform(-2e-4, 2e-4, 500))
    assert kept.all()
    assert (lost, lines) == (0, [])


@pytest.mark.parametrize("gap", [2, 10, 500, 60_000])
def test_missing_samples_are_counted_where_they_are_missing(gap):
    whole = np.arange(100_000) / 1000
    kept, times, lost, counts, lines = taken(np.delete(whole, slice(70, 70 + gap))[:200])
    assert kept.all()
    assert lost == gap
    assert lines == [f"gap at {times[70]:.3f} s: {gap} samples are missing"]
    assert counts == {"missing samples": gap}


def test_times_that_do_not_increase_or_are_unknown_are_left_out():
    stamps = [1.0, 1.001, 1.001, 0.5, np.nan, 1.002, 1.003, 1.004]
    kept, _, lost, counts, lines = taken(stamps, size=8)
    assert kept.tolist() == [True, True, False, False, False, True, True, True]
    assert lost == 0
    assert counts == {"samples out of order": 2, "samples without time": 1}
    assert lines[0] == "time stands still or runs backwards at 1.001 s: left out"
    kept, _, _, counts, _ = taken([0.0, 0.001, 0.002, 0.003, 0.004] + 995 * [0.004])
    assert kept.sum() == 5
    assert counts == {"samples out of order": 995}


@pytest.mark.parametrize("wrong", [-1e9, -3.0, 100.0, 1e9, 1e300, np.inf])
@pytest.mark.parametrize("place", [7, 49, 50, 99])
def test_a_single_stamp_that_disagrees_is_left_out_and_no_other(wrong, place):
    stamps = np.arange(200) / 1000
    stamps[place] = wrong
    kept, times, lost, counts, _ = taken(stamps)
    assert np.flatnonzero(~kept).tolist() == [place]
    assert lost == 1
    assert sum(counts.values()) == 2
    np.testing.assert_allclose(times, np.delete(np.arange(200) / 1000, place))


@pytest.mark.parametrize("jump", [-1.0, -0.07, -1e9, 1e9, 1.7e9])
@pytest.mark.parametrize("size", [50, 7, 1])
def test_after_the_clock_jumped_times_go_on_from_there(jump, size):
    stamps = np.arange(300) / 1000
    stamps[120:] += jump
    kept, times, lost, counts, lines = taken(stamps, size=size)
    assert kept.all()
    assert counts["clock jumps"] == 1
    assert lines[0].startswith(f"the clock jumps by {jump + 0.001:+.6g} s at 0.119 s")
    assert times[-1] == pytest.approx(0.3, abs=2e-3)
    assert lost <= 1


def test_times_increase_and_nothing_is_an_error_however_small_or_large_the_steps():
    for step in (5e-324, 1e-300, 1e300, 1.7e308):
        taken([0.0, step, -step, *range(9)])
    tiny = [-5e9, 1e-300, 2e-300, 1e-200, 1e-100, 1e-60, 1e-14]
    kept, *_ = taken(np.concatenate((np.arange(9.0), tiny)), rate=1.0)
    assert kept[:9].all()


@pytest.mark.parametrize("unit", [1e3, 1e6, 1e9])
@pytest.mark.parametrize(("rate", "start"), [(1000.0, 0.0), (100.0, 1.7e9), (1.0, 5.0)])
def test_the_unit_of_stamps_is_that_of_the_rate(unit, rate, start):
    stamps = unit * (start + np.arange(30) / rate)
    _, times, lost, counts, lines = taken(stamps, rate, size=max(1, round(rate / 20)))
    np.testing.assert_allclose(times, start + np.arange(30) / rate, rtol=1e-9)
    assert (lost, counts) == (0, {})
    assert lines[0].endswith(f"at {rate:g} Hz: read as such")


@pytest.mark.parametrize("size", [50, 7, 1])
def test_another_rate_than_the_nominal_one_is_a_warning(size):
    *_, lines = taken(np.arange(50) / 800, size=size)
    assert lines == [
        "timestamps have 800 Hz, the nominal rate is 1000 Hz: labels and spectrogram are wrong,"
        " set --rate"
    ]


@pytest.mark.parametrize(
    ("rate", "remark"),
    [
        (500.0, "No labels: logged at 500 Hz, the model needs 1000 Hz or more"),
        (1500.0, "No labels: samples come at 1500 Hz, the nearest model takes 1000 Hz; only files"),
        (20_000.0, "No labels: samples come at 20000 Hz, the nearest model takes 10000 Hz"),
    ],
)
def test_rates_that_no_model_fits_have_no_labels_and_a_remark(rate, remark):
    library = {"slow": fixed(), "fast": fixed(rate=10_000.0)}  # that take the noise alone
    labeller = Labeller(library, rate, {"velocity": 3})
    assert labeller.remark.startswith(remark)
    assert labeller.push(np.ones((900, 3)), np.ones(900, dtype=bool), 0.9) is None
    labeller.skip(100)
    assert labeller.classes == ()


def streamed(run):
    """A labeller, and its labels of a run that comes in chunks."""
    labeller = Labeller({"general": trained()}, run.rate, {"velocity": 3, "velocity_desired": 3})
    motion = np.hstack((run.velocity, run.velocity_desired))
    ones = np.ones(len(motion), dtype=bool)
    pieces = [slice(i, min(i + 37, len(motion))) for i in range(0, len(motion), 37)]
    parts = [labeller.push(motion[p], ones[p], p.stop / run.rate) for p in pieces]
    parts = [part for part in parts if part is not None]
    fields = ("start", "label", "scores")
    return labeller, {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in fields
    }


@pytest.mark.parametrize("rate", [80.0, 125.0, 333.0, 1000.0, 2500.0])
def test_live_motion_of_any_rate_is_labelled_as_it_comes(rate):
    run = run_at(rate, "oscillations")
    labeller, found = streamed(run)
    assert (labeller.model, labeller.remark) == ("general", "")
    whole = label_run(run, {"general": trained()}).labels
    count = len(found["start"])
    assert len(whole) - count in (0, 1)  # the last frame comes with the end of the run
    for name, each in found.items():
        np.testing.assert_allclose(
            each, getattr(whole, name)[:count]
        ) if name != "label" else np.testing.assert_array_equal(each, whole.label[:count])


@pytest.mark.parametrize("size", [1, 50, 999])
def test_a_hum_is_bright_in_its_band_whatever_the_blocks(size):
    rate, hertz = 5000.0, 440.0
    time = np.arange(5000) / rate
    noise = 2.0 + time + 0.1 * np.sin(2 * np.pi * hertz * time)
    stream, parts = SpectrogramStream(rate), []
    for first in range(0, len(noise), size):
        piece = noise[first : first + size, None]
        end = (first + len(piece)) / rate
        parts.append(stream.push(piece, np.ones(len(piece), dtype=bool), end))
    centres, level = (np.concatenate(each) for each in zip(*parts, strict=True))
    loudest = level.argmax(axis=1)
    assert (stream.edges[loudest] <= hertz).all()
    assert (hertz <= stream.edges[loudest + 1]).all()
    assert level.max() == pytest.approx(
        (-20.0 - SPECTRUM.low) / (SPECTRUM.high - SPECTRUM.low), abs=0.02
    )
    np.testing.assert_allclose(centres, 0.0512 + 0.0256 * np.arange(len(centres)), atol=1e-9)
    assert len(centres) == 1 + (5000 - 512) // 128


def test_silence_and_gaps_are_dark():
    stream, noise = SpectrogramStream(1000.0), np.random.default_rng(0).standard_normal((500, 2))
    _, silent = stream.push(np.zeros((500, 2)), np.ones(500, dtype=bool), 0.5)
    assert silent.max() == 0.0
    _, broken = stream.push(noise, np.arange(500) != 100, 1.0)
    assert (broken.max(axis=1) == 0.0).sum() >= 4  # the windows that touch the gap
    stream.skip()
    time, level = stream.push(noise, np.ones(500, dtype=bool), 9.0)
    assert level[0].max() == 0.0  # what a viewer draws between before and after the gap
    assert level[1:].max(axis=1).min() > 0.5
    assert 8.5 < time[0] < time[1] < 8.56


@pytest.mark.parametrize("robot", ["panda", "talos"])
def test_a_robot_is_in_the_picture_with_room_to_move(robot):
    names = nm.Robot.load(robot).joint_names[:7]
    drawn = LiveRobot(Messages(rr.RecordingStream("test")), robot, names, moves=False)
    camera = drawn.camera({"position": np.zeros((1, 7))})
    right, up, ahead = sight()
    most, poses = 0.0, drawn._drawn.poses(1, {}, None)
    for points in scene.reached(drawn._drawn, poses):
        offset = points - camera.eye
        edge = np.tan(FIELD_OF_VIEW / 2) * (offset @ ahead)
        most = max(most, *(np.abs(offset @ across / edge).max() for across in (right, up)))
    assert 0.4 < most < 0.7


@pytest.mark.parametrize("missing", [(), ("base_velocity",), ("velocity_desired",)])
def test_columns_make_the_norms_and_joints_that_a_run_makes(missing):
    generator = np.random.default_rng(3)
    widths = {"base_velocity": 6, "velocity": 4, "velocity_desired": 4}
    columns = {
        name: generator.normal(size=(50, width))
        for name, width in widths.items()
        if name not in missing
    }
    run = nm.Run(time=np.arange(50) / 1000, joint_names=("a", "b", "c", "d"), **columns)
    motion, base = np.hstack(list(columns.values())), 6 * ("base_velocity" in columns)
    signals = {**nm.norms(run), **nm.by_joint(run)}
    found = noise_signals(tuple(signals), motion, base, 4)
    for name, signal in signals.items():
        np.testing.assert_allclose(found[name], signal, rtol=1e-12)
