"""A baseline is trained on good motion alone, with a limit for a false-alarm budget."""

from dataclasses import replace

import numpy as np
import pytest

import noiseclassifier as nc
from noiseclassifier.estimators.baseline import MOTION, NOISE_ALONE, Baseline, distance, k_centers
from noiseclassifier.novelty.frames import GUARD, parts
from noiseclassifier.novelty.limit import HOUR, PEAKS, Limit, alarm_peaks, counted, limit
from noiseclassifier.novelty.training import Learnt, check

RATE = 1000.0
PROFILE = MOTION.at(RATE)
SECONDS = 8


def signals(seed, rattle=0.0, seconds=SECONDS):
    """A motion that hums; a rattle of 90 Hz from 4 s to 6 s on what is measured."""
    generator = np.random.default_rng(seed)
    time = np.arange(round(seconds * RATE)) / RATE
    desired = 1.0 + 0.5 * np.sin(2 * np.pi * 0.7 * time + seed)
    error = 0.01 * generator.normal(size=len(time))
    error += rattle * np.sin(2 * np.pi * 90 * time) * ((time >= 4.0) & (time < 6.0))
    return {"desired": desired, "measured": desired + error, "error": np.abs(error)}


def recording(name, seed, rattle=0.0, blocks=(), **more):
    blocks = tuple(nc.Block(*block) for block in blocks)
    return nc.Recording(name, signals(seed, rattle), RATE, blocks, **more)


GOOD = [recording(f"good{seed}", seed) for seed in range(6)]


@pytest.fixture(scope="module")
def learnt():
    return nc.learn_baseline(nc.GoodMotion.read(GOOD, PROFILE), PROFILE, alarms=5.0)


def motion(apart, run=None, hop=1.0):
    """Good motion whose frames of 0.4 s start every `hop` seconds."""
    start = hop * np.arange(len(apart))
    run = np.full(len(apart), "run") if run is None else np.array(run)
    return nc.GoodMotion(np.zeros((len(apart), 1)), run, start, start + 0.4, {})


def test_what_good_runs_do_is_no_anomaly_and_a_rattle_is_one_when_it_happens(learnt):
    model = learnt.classifier
    assert model.classify(signals(11), RATE).events() == ()
    (event,) = model.classify(signals(12, rattle=0.3), RATE).events()
    assert event.label == nc.ANOMALY
    assert 3.5 < event.start <= 4.0
    assert 6.0 <= event.stop < 6.5
    assert event.score > 1.0


def test_silence_is_no_anomaly_and_neither_is_a_quieter_motion(learnt):
    still = dict.fromkeys(PROFILE.signals, np.zeros(3000))
    assert learnt.classifier.classify(still, RATE).events() == ()
    good = signals(11)
    quieter = {name: 0.03 * signal for name, signal in good.items()}
    assert learnt.classifier.classify(quieter, RATE).events() == ()


def test_distance_is_the_root_mean_square_to_the_nearest_frame():
    generator = np.random.default_rng(0)
    good, fresh = generator.normal(size=(20, 7)), generator.normal(size=(9, 7))
    known = np.vstack((np.full(7, -9.0), good))
    apart = np.sqrt(np.square(fresh[:, None] - known).mean(axis=2)).min(axis=1)
    np.testing.assert_allclose(distance(fresh, known), apart, rtol=1e-12)


def test_a_k_center_subset_of_all_frames_has_no_distance_from_any():
    generator = np.random.default_rng(1)
    features = generator.normal(size=(60, 5))
    far = [distance(features, k_centers(features, count)).max() for count in (1, 5, 20, 60)]
    assert far == sorted(far, reverse=True)
    assert far[-1] < 1e-6
    assert len(k_centers(np.repeat(features[:3], 9, axis=0), 20)) == 1 + 3


def test_each_next_centre_is_the_frame_farthest_from_those_before():
    features = np.random.default_rng(2).normal(0.3, 1.0, size=(150, 4))
    silence, *centres = k_centers(features)
    assert silence.tolist() == features.min(axis=0).tolist()
    assert len(centres) == 100
    lengths = np.linalg.norm(features, axis=1)
    assert np.linalg.norm(centres[0]) == lengths.min()
    for count in range(1, 100):
        apart = np.linalg.norm(features[:, None] - np.array(centres[:count]), axis=2).min(axis=1)
        assert (centres[count] == features[apart.argmax()]).all()
    same = k_centers(np.repeat(features[:1], 3, axis=0))
    assert same.tolist() == [features[0].tolist()] * 2


def test_an_anomaly_lies_beyond_the_limit_and_not_at_it():
    model = Baseline(np.array([[-1.0, -1.0], [0.0, 0.0]]), np.array([2.0]))
    frames = np.array([[2.0, 2.0], [2.0, 2.1], [-9.0, -9.0], [1.0, -1.0]])
    apart = model.decision(frames)
    raised = np.array([[2.0, 2.0], [2.0, 2.1], [0.0, 0.0], [1.0, -1.0]])
    expected = np.sqrt((raised**2).mean(axis=1)) / 2.0
    np.testing.assert_allclose(apart[:, 0], expected, atol=1e-9)
    assert model.choose(apart).tolist() == [0, 1, 0, 0]
    np.testing.assert_allclose(model.score(apart), np.stack((np.ones(4), expected), axis=1))
    assert model.width == 1
    still = replace(model, limit=np.zeros(1))  # any distance at all is one then
    assert still.choose(still.decision(frames)).tolist() == [1, 1, 0, 1]


def test_so_much_good_motion_is_enough_and_no_less():
    good = motion(np.zeros(75))
    assert good.seconds == pytest.approx(30.0)
    check(good, 0.1, good.seconds)
    with pytest.raises(nc.DatasetError, match=r"^30 s of good motion are too short to learn"):
        check(good, 0.1, good.seconds + 1e-9)


@pytest.mark.parametrize(
    ("runs", "groups", "annotated", "head"),
    [
        (1, 1, 1, ["in 1 run", "of 1 run with annotations,", "its parts were left out in turn,"]),
        (2, 2, 0, ["in 2 runs"]),
        (3, 2, 2, ["in 3 runs", "of 2 runs with annotations,"]),
    ],
)
def test_what_was_learnt_from_is_said_in_lines(learnt, runs, groups, annotated, head):
    limit_ = Limit(1.0, 90.0, 1.0, 2, 0.5, 30)
    lines = str(Learnt(learnt.classifier, limit_, runs, groups, annotated)).splitlines()
    assert lines[0] == f"learnt from 1 h of good motion {head[0]}"
    assert len(lines) == len(head) + 1
    for line, start in zip(lines[1:], head[1:], strict=False):
        assert line.startswith(start)
    assert lines[-1] == str(limit_)


def test_the_limit_of_an_exponential_tail_is_where_it_has_to_be():
    generator = np.random.default_rng(2)
    apart = generator.exponential(0.2, 5000)
    good = motion(apart)
    hours = good.seconds / HOUR
    found = limit(apart, good, 0.5)
    expected = 0.2 * np.log(len(apart) / (0.5 * hours))  # frames lie apart: each is an alarm
    assert found.distance == pytest.approx(expected, rel=0.2)
    assert found.distance > apart.max() - 0.4
    assert found.extrapolated
    assert found.peaks <= PEAKS


def test_what_other_robots_show_counts_as_much_as_that_many_alarms():
    apart = np.random.default_rng(2).exponential(0.2, 2000)
    good = motion(apart)
    alone = limit(apart, good, 0.5)
    peaks = alarm_peaks(apart, good, alone.level)
    own = float((peaks - alone.level).mean())
    ratio = np.log(len(peaks) / (0.5 * good.seconds / HOUR))
    assert alone.distance == pytest.approx(alone.level + own * ratio)
    for expected in (own, 0.0, 3.0):
        both = (len(peaks) * own + PEAKS * expected) / (len(peaks) + PEAKS)
        found = limit(apart, good, 0.5, expected=expected)
        assert found.distance == pytest.approx(max(alone.level + both * ratio, 0.0))


def test_where_there_is_motion_enough_alarms_are_counted():
    generator = np.random.default_rng(3)
    apart = generator.normal(size=30_000) ** 2
    good = motion(apart)
    found = limit(apart, good, 40.0)
    assert not found.extrapolated
    assert found.alarms == pytest.approx(40.0 * found.hours, rel=0.1)
    assert "extrapolated" not in str(found)


def test_the_level_in_the_tail_is_the_lowest_with_as_many_alarms_as_allowed():
    random = np.random.default_rng(5)
    for frames in (3, 4, 12, 60, 100):
        apart = random.exponential(1.0, frames)
        good = motion(apart, hop=0.25)  # neighbours overlap, so that alarms merge as a level falls
        tail = np.sort(apart)[::-1][: max(round(0.1 * frames), 1)]
        alarms_at = [len(alarm_peaks(apart, good, level)) for level in tail]
        for allowed in (0, 1, 2, 3):
            fits = [max(alarms_at[: n + 1]) <= allowed for n in range(len(tail))]
            assert counted(apart, good, allowed) == tail[fits.count(True) - 1]


def test_a_limit_is_never_below_the_least_one():
    still = motion(np.zeros(50))
    assert limit(np.zeros(50), still, 1.0).distance == 0.1
    assert limit(np.zeros(50), still, 1.0, least=0.7).distance == 0.7
    assert limit(np.zeros(50), still, 1.0, least=-2.0).distance == 0.0
    assert limit(np.zeros(50), still, 1.0).unit == "deviations"


@pytest.mark.parametrize(("minutes", "shown"), [(10.0, 18.0), (2.0, 90.0)])
def test_so_much_good_motion_shows_no_fewer_alarms(minutes, shown):
    found = Limit(1.234, 5.0, minutes / 60.0, 2, 0.567, 30, "log odds")
    assert found.shown == pytest.approx(shown)
    assert str(found) == (
        f"limit 1.23 log odds, for 5 false alarms per hour; 2 in {minutes / 60:.3g} h, each part"
        f" classified without learning from it\n{minutes / 60:.3g} h of good motion can show no"
        f" fewer than {shown:g} alarms per hour: the limit is extrapolated from 30 alarms beyond"
        " 0.57 log odds, assuming an exponential tail"
    )
    assert not replace(found, budget=found.shown).extrapolated
    assert "\n" not in str(replace(found, budget=found.shown))


def test_a_smaller_budget_gives_a_larger_limit():
    apart = np.random.default_rng(4).exponential(0.2, 300)
    limits = [limit(apart, motion(apart), budget).distance for budget in (0.1, 1.0, 10.0, 100.0)]
    assert limits == sorted(limits, reverse=True)
    assert limits[0] > limits[-1]


def test_frames_that_overlap_or_touch_are_one_alarm_and_runs_are_never_joined():
    apart = np.array([2.0, 3.0, 0.0, 5.0, 4.0, 0.0, 0.0, 1.0, 2.0])
    overlapping = motion(apart, hop=0.1)
    np.testing.assert_array_equal(alarm_peaks(apart, overlapping, 0.5), [5.0])
    apart_by_time = motion(apart, hop=0.3)
    np.testing.assert_array_equal(alarm_peaks(apart, apart_by_time, 0.5), [3.0, 5.0, 2.0])
    touching = motion(apart, hop=0.4)
    np.testing.assert_array_equal(alarm_peaks(apart, touching, 0.5), [3.0, 5.0, 2.0])
    assert alarm_peaks(apart, touching, 5.0).tolist() == []
    two = motion(apart, ["a"] * 4 + ["b"] * 5, hop=0.1)
    np.testing.assert_array_equal(alarm_peaks(apart, two, 0.5), [5.0, 4.0])


def test_little_good_motion_gives_a_remark(learnt):
    text = str(learnt)
    assert "learnt from 0.0133 h of good motion in 6 runs" in text
    assert "can show no fewer than 225 alarms per hour: the limit is extrapolated" in text
    assert learnt.classifier.metrics["baseline"]["budget"] == 5.0


def test_of_a_single_run_parts_are_left_out_with_time_between():
    long = nc.Recording("long", signals(0, seconds=30), RATE)
    good = nc.GoodMotion.read([long], PROFILE)
    for train, test in parts(good):
        gap = np.maximum(good.start[train][:, None] - good.stop[test], 0)
        gap += np.maximum(good.start[test] - good.stop[train][:, None], 0)
        assert gap.min() >= GUARD
    alone = nc.learn_baseline(good, PROFILE)
    assert "which does not show how much another run differs" in str(alone)
    assert alone.classifier.classify(signals(12, rattle=0.3), RATE).events()


def test_of_an_annotated_run_only_ok_blocks_are_for_training():
    blocks = ((0.0, 3.0, "ok"), (4.0, 6.0, "impact"), (6.0, 8.0, "ok"))
    good = nc.GoodMotion.read([recording("one", 0, 0.3, blocks)], PROFILE)
    assert ((good.stop <= 3.0 + 1e-9) | (good.start >= 6.0 - 1e-9)).all()
    assert good.seconds == pytest.approx(5.0, abs=0.01)
    assert good.annotated == ("one",)


def test_frames_that_touch_a_gap_are_not_for_training():
    valid = np.ones(SECONDS * 1000, dtype=bool)
    valid[3000:3500] = False
    good = nc.GoodMotion.read([recording("one", 0, valid=valid)], PROFILE)
    assert ((good.stop <= 3.0 + 1e-9) | (good.start >= 3.5 - 1e-9)).all()


def test_a_baseline_is_a_model_file_and_the_same_runs_give_the_same_bytes(learnt, tmp_path):
    learnt.classifier.save(tmp_path / "one.npz")
    again = nc.learn_baseline(nc.GoodMotion.read(GOOD, PROFILE), PROFILE, alarms=5.0)
    again.classifier.save(tmp_path / "two.npz")
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "two.npz").read_bytes()
    loaded = nc.Classifier.load(tmp_path / "one.npz")
    assert isinstance(loaded.estimator, Baseline)
    loaded_labels, labels = (
        m.classify(signals(12, 0.3), RATE) for m in (loaded, learnt.classifier)
    )
    np.testing.assert_array_equal(loaded_labels.scores, labels.scores)


def test_a_limit_of_another_shape_is_no_model(learnt, tmp_path):
    odd = replace(learnt.classifier.estimator, limit=np.ones(2))
    replace(learnt.classifier, estimator=odd).save(tmp_path / "odd.npz")
    with pytest.raises(nc.ModelFileError, match=r"array 'limit' has shape \(2,\)"):
        nc.Classifier.load(tmp_path / "odd.npz")


def test_a_stream_has_the_labels_of_the_whole_signal(learnt):
    whole = signals(12, rattle=0.3)
    stream = nc.Stream(learnt.classifier)
    parts = [
        stream.push({name: signal[first : first + 370] for name, signal in whole.items()})
        for first in range(0, SECONDS * 1000, 370)
    ]
    labels = np.concatenate([each.label for each in parts])
    batch = learnt.classifier.classify(whole, RATE)
    np.testing.assert_array_equal(labels, batch.label[: len(labels)])
    assert nc.ANOMALY in labels


def test_a_failure_of_any_class_is_an_anomaly(learnt):
    blocks = ((0.0, 3.5, "ok"), (4.0, 6.0, "oscillations"), (6.5, 8.0, "ok"))
    tests = [recording(f"bad{seed}", seed, 0.3, blocks) for seed in (21, 22)]
    measured = nc.assess(learnt.classifier, tests)
    assert measured.protocol.pooled["class_recall"].value == 1.0
    assert measured.protocol.counts["false_alarms"] == 0
    assert measured.frames.failure_recall.value == 1.0
    assert measured.calibration_error is None
    with pytest.raises(nc.SeenError, match="good0"):
        nc.assess(learnt.classifier, [recording("good0", 0, blocks=((0.0, 8.0, "ok"),))])


def test_the_noise_alone_is_enough_for_a_baseline():
    profile = NOISE_ALONE.at(RATE)
    good = nc.GoodMotion.read(GOOD, profile)
    model = nc.learn_baseline(good, profile).classifier
    assert model.classify(signals(11), RATE).events() == ()
    assert model.classify(signals(12, rattle=1.0), RATE).events()


@pytest.mark.parametrize("alarms", [0.0, -1.0, np.nan, np.inf])
def test_a_budget_of_no_alarm_is_refused(alarms):
    good = nc.GoodMotion.read(GOOD[:2], PROFILE)
    with pytest.raises(nc.ProfileError, match="alarms per hour, expected more than 0"):
        nc.learn_baseline(good, PROFILE, alarms=alarms)


def test_too_little_good_motion_is_refused():
    short = nc.Recording("short", signals(0, seconds=3), RATE)
    with pytest.raises(nc.DatasetError, match="3 s of good motion are too short to learn"):
        nc.learn_baseline(nc.GoodMotion.read([short], PROFILE), PROFILE)


def test_runs_without_a_good_frame_are_refused():
    bad = recording("bad", 0, blocks=((0.0, 8.0, "impact"),))
    tiny = nc.Recording("tiny", signals(0, seconds=0.2), RATE)
    with pytest.raises(nc.DatasetError, match="no good frame in 2 recordings"):
        nc.GoodMotion.read([bad, tiny], PROFILE)


def test_recordings_that_do_not_fit_are_refused_by_name():
    with pytest.raises(nc.DatasetError, match="two recordings are called 'good0'"):
        nc.GoodMotion.read([GOOD[0], GOOD[0]], PROFILE)
    with pytest.raises(nc.RateError, match="'good0' does not fit"):
        nc.GoodMotion.read(GOOD, MOTION.at(500.0))
    alone = nc.Recording("alone", np.ones(5000), RATE)
    with pytest.raises(nc.RecordingError, match="alone: no signal desired, measured, error"):
        nc.GoodMotion.read([alone], PROFILE)
