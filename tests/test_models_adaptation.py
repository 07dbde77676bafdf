"""A general model is adapted to a robot by good motion of it, with a false-alarm budget."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import poisson

import noiseclassifier as nc
from noiseclassifier.novelty.adaptation import FITTED, _confirmed
from noiseclassifier.novelty.faults import CASES, KINDS, LEVELS, Recall, fault, recall, with_fault

RATE = 250.0
RECIPE = replace(nc.ANY, rounds=20)
SIGNALS = nc.logbands.INPUTS[nc.logbands.INPUTS.index(nc.signals.MOTION) - 1]


def signals(seed, *, noise=0.01, scale=1.0, seconds=20.0):
    """A motion of three joints whose measurements are noisy."""
    generator = np.random.default_rng(seed)
    time = np.arange(round(seconds * RATE)) / RATE
    phase = generator.uniform(0, 6, (3, 1))
    desired = np.sin(2 * np.pi * np.array([[0.3], [0.5], [0.7]]) * time + phase)
    measured = desired + noise * generator.normal(size=desired.shape)
    joints = {"desired": desired, "measured": measured, "error": desired - measured}
    return {
        **{name: scale * np.linalg.norm(each, axis=0) for name, each in joints.items()},
        **{f"{name}_joints": scale * each for name, each in joints.items()},
    }


def good(seed, **how):
    return nc.Recording(f"good{seed}", signals(seed, **how), RATE)


def faulty(seed, kind, level, **how):
    """A motion with a fault from 5 s on, annotated."""
    motion = signals(seed, **how)
    time = np.arange(len(motion["measured"])) / RATE
    added = level * fault(time, kind, 60.0, seed, start=5.0)
    label, stop = ("impact", 5.1) if kind == "blow" else ("oscillations", 6.0)
    blocks = ((0.0, 4.5, "ok"), (5.0, stop, label), (7.0, 20.0, "ok"))
    return nc.Recording(
        f"{kind}{seed}",
        with_fault(motion, seed % 3, added),
        RATE,
        tuple(nc.Block(*block) for block in blocks),
    )


@pytest.fixture(scope="module")
def general():
    """A small general model of eighteen synthetic recordings, at a rate."""
    recordings = [
        faulty(seed, KINDS[seed % 3], LEVELS[seed // 3 % 3], noise=0.005 * 2 ** (seed % 4))
        for seed in range(18)
    ]
    frames = nc.Frames.joined(nc.frames_of(recordings, RECIPE))
    return nc.General.train(frames, RECIPE).at(RATE, SIGNALS)


ROBOT = {"noise": 0.15}
"""A robot that is noisier than any that the general model learnt from."""


@pytest.fixture(scope="module")
def motion(general):
    recordings = [good(seed, **ROBOT) for seed in range(100, 106)]
    return nc.GoodMotion.read(recordings, general.profile)


@pytest.fixture(scope="module")
def adapted(general, motion):
    return nc.adapt(general, motion, alarms=20.0).classifier


def alarms(model, recordings):
    """Stretches of flagged frames in recordings."""
    flagged = [
        model.classify(each.signal, RATE, valid=each.valid).flagged.astype(int)
        for each in recordings
    ]
    return sum(int((np.diff(np.append(0, each)) == 1).sum()) for each in flagged)


def test_good_motion_of_the_robot_raises_no_more_alarms_than_the_budget(general, motion):
    fresh = [good(seed, **ROBOT) for seed in range(200, 215)]
    hours = 20.0 * len(fresh) / 3600
    for budget in (100.0, 400.0):
        model = nc.adapt(general, motion, alarms=budget).classifier
        assert alarms(model, fresh) <= poisson.ppf(0.999, budget * hours)
    assert alarms(general, fresh) >= 10


def test_a_fault_is_found_and_keeps_its_class(adapted):
    labels = adapted.classify(faulty(300, "tone", 1.0, **ROBOT).signal, RATE)
    event = max(labels.events(), key=lambda event: event.stop - event.start)
    assert event.label == "oscillations"
    assert 4.6 <= event.start <= 5.0
    assert 6.0 <= event.stop <= 6.4
    assert adapted.classes == ("ok", "impact", "oscillations")


@pytest.mark.parametrize("budget", [20.0, 100.0, 500.0])
def test_alarms_counted_in_the_good_motion_keep_to_the_budget(general, motion, budget):
    found = nc.adapt(general, motion, alarms=budget).limit
    assert found.alarms <= budget * found.hours


def test_scores_that_all_equal_the_highest_one_are_no_alarms(general):
    trees = general.estimator
    calibration = np.append([1.0, -50.0], np.zeros(len(trees.calibration) - 2))
    flat = replace(trees, leaf=np.zeros_like(trees.leaf), calibration=calibration)
    flat = replace(general, estimator=flat)
    recordings = [good(seed, **ROBOT) for seed in range(6)]
    model = nc.adapt(flat, nc.GoodMotion.read(recordings, flat.profile)).classifier
    probability = 1.0 - model.classify(recordings[0].signal, RATE).scores[:, 0]
    alarm = general.profile.alarm
    assert alarm - 1e-3 < probability.max() < alarm - 1e-4
    assert alarms(model, recordings) == 0


@pytest.mark.slow
def test_a_larger_budget_never_finds_less(general, motion):
    recordings = [good(seed, **ROBOT) for seed in range(100, 106)]
    budgets = (1.0, 2.0, 50.0)
    learnt = {str(each): nc.adapt(general, motion, alarms=each) for each in budgets}
    limits = [each.limit.distance for each in learnt.values()]
    assert limits == sorted(limits, reverse=True)
    models_of = {name: each.classifier for name, each in learnt.items()}
    found = np.array(list(recall(models_of, recordings, motion).found.values()))
    assert (np.diff(found, axis=0) >= 0).all()
    assert (np.diff(found, axis=1) >= 0).all()
    assert found[:, 0].max() <= 2
    assert found[-1, -1] > 0.7 * CASES


def test_a_robot_that_is_louder_as_a_whole_is_adapted_to_alike(general):
    louder = [good(seed, scale=5.0) for seed in range(100, 106)]
    motion = nc.GoodMotion.read(louder, general.profile)
    model = nc.adapt(general, motion, alarms=100.0).classifier
    fresh = [good(seed, scale=5.0) for seed in range(200, 215)]
    assert alarms(model, fresh) <= poisson.ppf(0.999, 100.0 * 20.0 * len(fresh) / 3600)
    assert alarms(general, fresh) == len(fresh)
    assert alarms(model, [faulty(300, "tone", 5.0, scale=5.0)]) == 1


def test_runs_that_differ_widely_are_no_reference_for_each_other(general, adapted):
    assert adapted.reference is not None
    noises = (0.003, 0.003, 0.3, 0.003, 0.003, 0.003)
    recordings = [good(seed, noise=noise) for seed, noise in enumerate(noises)]
    motion = nc.GoodMotion.read(recordings, general.profile)
    found = nc.adapt(general, motion, alarms=20.0).classifier
    assert found.reference is None
    assert found.metrics["adapted"]["reference"] == "the signal itself"


def test_good_motion_is_in_distribution_after_adapting(general, adapted):
    fresh = good(201, **ROBOT).signal
    assert general.classify(fresh, RATE).novel.mean() > 0.05
    assert adapted.classify(fresh, RATE).novel.mean() == 0.0
    loud = adapted.classify(faulty(300, "tone", 100.0, **ROBOT).signal, RATE)
    assert loud.novel.any()
    found = loud.events()
    assert "oscillations" in [event.label for event in found]
    assert all(4.5 < event.start < event.stop < 6.5 for event in found)


def raised_bounds(general, motion, learnt):
    """Bounds above good motion by the limit of novelty, less what a frame may exceed them by."""
    half = motion.features.shape[1] // 2
    highest = np.quantile(motion.features[:, :half], 0.999, axis=0)
    highest = (highest - general.mean[:half]) / general.scale[:half]
    above = highest + learnt.metrics["adapted"]["novelty"] - 2.0
    known = general.estimator.known
    return np.concatenate((np.maximum(known[:half], above), known[half:]))


def test_bounds_and_odds_of_an_adapted_model_are_those_of_its_limits(general, adapted, motion):
    facts = adapted.metrics["adapted"]
    expected = raised_bounds(general, motion, adapted)
    np.testing.assert_allclose(adapted.estimator.known, expected)
    assert (expected > general.estimator.known).any()
    assert (facts["budget"], facts["groups"], facts["runs"]) == (20.0, 6, 6)
    assert (facts["reference"], facts["unit"]) == ("good runs", "log odds of a failure")
    assert facts["hours"] == pytest.approx(6 * 20.0 / 3600)
    assert 0 < facts["peaks"] <= FITTED
    # A probability at the alarm threshold is one of the odds at the limit, but for a margin.
    shift = adapted.estimator.calibration - general.estimator.calibration
    alarm = general.estimator.alarm
    assert shift[1] == pytest.approx(facts["distance"] + 1e-3 - np.log(alarm / (1.0 - alarm)))
    assert not np.delete(shift, 1).any()


def test_runs_that_one_another_exceed_raise_the_bounds_further(general):
    recordings = [good(seed, noise=noise) for seed, noise in enumerate((0.1, 0.1, 0.1, 2.5))]
    motion = nc.GoodMotion.read(recordings, general.profile)
    found = nc.adapt(general, motion).classifier
    assert found.metrics["adapted"]["novelty"] > 2.0
    expected = raised_bounds(general, motion, found)
    np.testing.assert_allclose(found.estimator.known, expected)


def test_what_counts_of_a_frame_is_what_a_neighbour_reaches_too():
    random = np.random.default_rng(0)
    for _ in range(20):
        score = random.normal(size=12)
        gaps = random.choice([0.1, 0.4, 0.41], size=12)
        gaps[random.integers(12)] = 0.5  # beside a change of runs, or not
        start = np.cumsum(gaps)
        runs = np.where(np.arange(12) < random.integers(1, 12), "a", "b")
        good = nc.GoodMotion(score[:, None], runs, start, start + 0.4, {})
        expected = []
        for frame in range(12):
            sides = []
            for other in (frame - 1, frame + 1):
                low, high = sorted((frame, other))
                there = low >= 0 and high < 12 and runs[low] == runs[high]
                joined = there and start[high] <= start[low] + 0.4
                sides.append(score[other] if joined else np.inf)
            expected.append(min(score[frame], max(sides)))
        assert _confirmed(score, good).tolist() == expected


def test_a_robot_that_stands_does_not_alarm_whenever_it_moves_a_little(general):
    still = [good(seed, noise=1e-4, scale=0.0) for seed in range(6)]
    motion = nc.GoodMotion.read(still, general.profile)
    learnt = nc.adapt(general, motion, alarms=100.0)
    assert learnt.limit.distance >= np.log(0.05 / 0.95)
    assert alarms(learnt.classifier, still) == 0


def test_an_adapted_model_is_a_model_file_and_the_same_runs_give_the_same_bytes(
    general, motion, adapted, tmp_path
):
    adapted.save(tmp_path / "one.npz")
    nc.adapt(general, motion, alarms=20.0).classifier.save(tmp_path / "two.npz")
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "two.npz").read_bytes()
    loaded = nc.load(tmp_path / "one.npz")
    assert isinstance(loaded, nc.Classifier)
    assert loaded.metrics["adapted"]["budget"] == 20.0
    assert {f"good{seed}" for seed in range(100, 106)} <= loaded.runs.keys()
    bad = faulty(300, "blow", 1.0, **ROBOT).signal
    before, after = (each.classify(bad, RATE) for each in (adapted, loaded))
    np.testing.assert_array_equal(before.scores, after.scores)
    np.testing.assert_array_equal(before.label, after.label)


def test_a_stream_has_the_labels_of_the_whole_signal(adapted):
    whole = faulty(300, "noise", 1.0, **ROBOT).signal
    stream = nc.Stream(adapted, joints=3)
    parts = [
        stream.push({name: each[..., first : first + 37] for name, each in whole.items()})
        for first in range(0, round(20 * RATE), 37)
    ]
    found = nc.Labels.concatenated([*parts, stream.finish()])
    batch = adapted.classify(whole, RATE)
    np.testing.assert_array_equal(found.scores, batch.scores)
    np.testing.assert_array_equal(found.label, batch.label)
    assert found.flagged.any()


def test_what_it_learnt_from_is_said_with_the_least_rate_that_it_can_show(general, motion):
    learnt = nc.adapt(general, motion, alarms=1.0)
    text = str(learnt)
    assert "learnt from 0.0333 h of good motion in 6 runs" in text
    assert "log odds of a failure, for 1 false alarms per hour" in text
    assert "can show no fewer than 90 alarms per hour: the limit is extrapolated" in text
    alone = nc.Recording("long", signals(0, **ROBOT, seconds=60), RATE)
    single = nc.adapt(general, nc.GoodMotion.read([alone], general.profile))
    assert "which does not show how much another run differs" in str(single)


def test_only_what_is_annotated_ok_is_learnt_from(general):
    recordings = [faulty(seed, "tone", 1.0, **ROBOT) for seed in range(4)]
    motion = nc.GoodMotion.read(recordings, general.profile)
    assert not ((motion.stop > 4.51) & (motion.start < 6.99)).any()
    learnt = nc.adapt(general, motion)
    assert "of 4 runs with annotations, the part annotated `ok` alone" in str(learnt)


@pytest.mark.slow
def test_a_split_that_only_sets_missing_features_apart_can_be_saved(tmp_path):
    recordings = [faulty(seed, "tone", 1.0) for seed in range(6)]
    frames = nc.Frames.joined(nc.frames_of(recordings, RECIPE))
    trained = nc.General.train(frames, RECIPE)
    assert np.isfinite(trained.estimator.threshold).all()
    trained.save(tmp_path / "general.npz")
    assert isinstance(nc.load(tmp_path / "general.npz"), nc.General)


def test_too_little_good_motion_is_refused(general):
    short = nc.GoodMotion.read([good(0, seconds=29.0)], general.profile)
    wanted = "29 s of good motion are too short to learn from, expected 30 s or more"
    with pytest.raises(nc.DatasetError, match=wanted):
        nc.adapt(general, short)


@pytest.mark.parametrize("budget", [0.0, -1.0, np.nan, np.inf])
def test_a_budget_of_no_alarm_is_refused(general, motion, budget):
    with pytest.raises(nc.ProfileError, match="alarms per hour, expected more than 0: say, 1"):
        nc.adapt(general, motion, alarms=budget)


def test_only_a_general_model_can_be_adapted(general, motion):
    other = replace(general, profile=nc.EACH.at(RATE))
    wanted = "only a general model, whose features take a reference, can be adapted"
    with pytest.raises(nc.ProfileError, match=wanted):
        nc.adapt(other, motion)


@pytest.mark.parametrize("kind", KINDS)
def test_a_fault_has_level_1_while_it_lasts_and_is_0_before(kind):
    time = np.arange(4000) / 1000.0
    added = fault(time, kind, 100.0, 1, start=1.0)
    lasts = (time >= 1.0) & (time < (1.1 if kind == "blow" else 2.0))
    assert not added[time < 1.0].any()
    assert np.sqrt(np.mean(added[lasts] ** 2)) == pytest.approx(1.0, abs=0.1)


def test_a_tone_has_its_frequency_and_a_blow_loses_its_strength_in_three_periods():
    time = np.arange(4096) / 1024.0
    tone = fault(time, "tone", 60.25, 1, start=1.0)
    during = (time >= 1.0) & (time < 2.0)
    np.testing.assert_allclose(
        tone, np.where(during, np.sqrt(2) * np.sin(2 * np.pi * 60.25 * (time - 1.0)), 0.0)
    )
    blow = fault(time, "blow", 64.0, 1, start=1.0)
    period = 16  # samples
    np.testing.assert_allclose(
        blow[1024 + 3 * period : 2048], blow[1024 : 2048 - 3 * period] / np.e, atol=1e-12
    )
    first = (time >= 1.0) & (time < 1.1)
    assert np.sqrt(np.mean(blow[first] ** 2)) == pytest.approx(1.0)
    assert blow[1024] == 0.0
    assert blow[1025] > 0.0


def test_band_noise_is_an_octave_wide_around_its_frequency():
    time = np.arange(1024) / 1024.0
    noise = fault(time, "noise", 100.0, 1, start=0.0)
    power = np.abs(np.fft.rfft(noise)) ** 2
    inside = np.flatnonzero(power > 1e-12 * power.max())
    assert (inside[0], inside[-1]) == (71, 141)  # from 70.7 Hz to 141.4 Hz, in [Hz]
    assert np.sqrt(np.mean(noise**2)) == pytest.approx(1.0)
    np.testing.assert_array_equal(noise, fault(time, "noise", 100.0, 1, start=0.0))
    assert np.abs(noise - fault(time, "noise", 100.0, 2, start=0.0)).max() > 0.1


def test_the_table_of_faults_that_were_found_is_aligned():
    found = Recall(36, {"general": (0, 1, 20, 36), "adapted": (2, 10, 30, 36)})
    assert str(found).splitlines() == [
        "found of 36 faults put into this motion    no fault   0.1 rad/s   0.3 rad/s     1 rad/s",
        "  general                                         0           1          20          36",
        "  adapted                                         2          10          30          36",
    ]


class Watching:
    """Stands in for a model: notes what it classifies, and finds what its rule gives."""

    def __init__(self, rule):
        self.rule, self.seen = rule, []

    def classify(self, signals, rate, *, start, valid):
        self.seen.append((signals, rate, start, valid))
        return self

    def events(self):
        number, row = divmod(len(self.seen) - 1, 1 + len(LEVELS))
        return tuple(nc.Event("impact", *span, 1.0) for span in self.rule(number, row))


def test_faults_go_through_all_kinds_joints_and_levels_and_are_found_where_findings_overlap():
    recordings = [good(seed, seconds=30.0) for seed in range(2)]
    start = np.append(np.arange(3.0, 27.0, 0.5), np.arange(4.0, 26.0, 0.5))
    runs = np.array(["good0"] * 48 + ["good1"] * 44)
    where = nc.GoodMotion(np.zeros((92, 1)), runs, start, start + 0.4, {})
    places = [int(number * 92 / CASES) for number in range(CASES)]

    def lasting(number):
        begin = start[places[number]]
        return begin, begin + (0.1 if KINDS[number % 3] == "blow" else 1.0)

    before = Watching(lambda number, row: [(0.0, lasting(number)[0])])
    after = Watching(lambda number, row: [(lasting(number)[1], 99.0)])
    begun = Watching(lambda number, row: [(0.0, lasting(number)[0] + 1e-6)] * row)
    loud = Watching(lambda number, row: [(lasting(number)[1] - 1e-6, 99.0)] if row == 3 else [])
    watching = {"before": before, "after": after, "begun": begun, "loud": loud}
    found = recall(watching, recordings, where, seed=3)
    assert found == Recall(
        36,
        {
            "before": (0, 0, 0, 0),
            "after": (0, 0, 0, 0),
            "begun": (0, 36, 36, 36),
            "loud": (0, 0, 0, 36),
        },
    )
    frequencies = []
    for number, place in enumerate(places):
        four = [
            signals["measured_joints"] for signals, *_ in loud.seen[4 * number : 4 * number + 4]
        ]
        _, rate, begin, valid = loud.seen[4 * number]
        assert (rate, len(valid)) == (RATE, 1500)
        assert begin == pytest.approx(start[place] - 3.0)
        assert valid.all()
        original = recordings[int(runs[place][-1])].signal["measured_joints"]
        first = round(begin * RATE)
        np.testing.assert_array_equal(four[0], original[:, first : first + 1500])
        joint = number // 3 % 3
        added = [each - four[0] for each in four[1:]]
        assert not np.delete(added[-1], joint, axis=0).any()
        for level, each in zip(LEVELS, added, strict=True):
            np.testing.assert_allclose(each, level * added[-1], atol=1e-9)
        changed = np.flatnonzero(added[-1][joint])
        assert changed[0] in (750, 751)  # a tone is 0 as it starts
        if KINDS[number % 3] == "tone":
            assert changed[-1] in (998, 999)
            spectrum = np.abs(np.fft.rfft(added[-1][joint][750:1000]))
            frequencies.append(int(spectrum.argmax()))
    assert 20 <= min(frequencies) < 40
    assert 80 < max(frequencies) <= 0.45 * RATE
    again = Watching(lambda number, row: [])
    recall({"again": again}, recordings, where)
    assert recall({"again": again}, recordings, where, seed=0) == Recall(36, {"again": (0,) * 4})
    half = len(again.seen) // 2
    for (one, *_), (other, *_) in zip(again.seen[:half], again.seen[half:], strict=True):
        np.testing.assert_array_equal(one["measured_joints"], other["measured_joints"])


def test_a_fault_of_a_joint_is_in_all_signals_that_contain_the_joint():
    before = signals(0)
    before["noise"] = np.hypot(before["measured"], before["desired"])
    added = np.full(len(before["measured"]), 0.5)
    after = with_fault(before, 1, added)
    measured, desired = after["measured_joints"], after["desired_joints"]
    np.testing.assert_array_equal(measured[1], before["measured_joints"][1] + 0.5)
    np.testing.assert_array_equal(desired, before["desired_joints"])
    np.testing.assert_allclose(after["error_joints"], desired - measured, atol=1e-12)
    for name in ("measured", "error"):
        norm = np.linalg.norm(after[f"{name}_joints"], axis=0)
        np.testing.assert_allclose(after[name], norm, rtol=1e-9)
    np.testing.assert_allclose(after["noise"], np.hypot(after["measured"], after["desired"]))


def test_recall_takes_joints(general, motion):
    norms = nc.Recording("norms", {"measured": np.ones(9000)}, RATE)
    assert recall({"general": general}, [norms], motion) is None
