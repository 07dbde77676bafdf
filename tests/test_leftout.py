"""The choice of estimator and threshold on robots that are left out in turn."""

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import noiseclassifier as nc
from inspector.errors import InspectorError
from inspector.train import classified
from noiseclassifier.estimators.decision import NOVELTY_LIMIT, identity
from noiseclassifier.estimators.trees import Trees
from noiseclassifier.evaluation.matching import Outcome, predict
from noiseclassifier.logbands import ANY
from noiseclassifier.pooling import columns
from noiseclassifier.scenarios.robots import TARGETS, WIDE
from noisemodel import Block, Run
from noisemodel.limits import joint_limits

with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(Path(__file__).parents[1])
    from benchmarks import leftout
    from benchmarks.leftout import Candidates, Linear, Measured, TargetError, Threshold

PROFILE = nc.EACH.at(1000.0)
LOGGER = {
    **dict.fromkeys(("cutoff", "noise", "jitter", "lost", "repeated", "ripple", "gear"), 0.0),
    "rate": 1000.0,
    "velocity": "measured",
    "bits": 19,
    "hold": 1,
    "resonances": (),
    "desired": "planned",
}


def recording(robot, seed, *, faulty, rate=1000.0):
    """Two joints that follow a sine, one of which vibrates for a second if it is faulty."""
    time = np.arange(int(4 * rate)) / rate
    desired = np.stack([np.sin(np.pi * time + seed), np.cos(np.pi * time)])
    error = 1e-3 * np.random.default_rng([seed, faulty]).normal(size=desired.shape)
    blocks, events = [nc.Block(0.0, 4.0, "ok")], ()
    if faulty:
        vibrates = (time >= 2.0) & (time < 3.0)
        error[0, vibrates] += np.sin(2 * np.pi * 60 * time[: vibrates.sum()])
        ends = (0.0, 1.9, "ok"), (2.0, 3.0, "oscillations"), (3.2, 4.0, "ok")
        blocks, events = [nc.Block(*each) for each in ends], (nc.Fault(*ends[1]),)
    joints = {"desired": desired, "measured": desired - error, "error": error}
    signal = {name: np.linalg.norm(each, axis=0) for name, each in joints.items()}
    signal |= {f"{name}_joints": each for name, each in joints.items()}
    return nc.Recording(
        f"{robot}/{'fault' if faulty else 'good'}-{seed}",
        signal,
        rate,
        tuple(blocks),
        events=events,
        facts={"robot": robot},
    )


@pytest.fixture(scope="module")
def runs():
    """Good and faulty runs of four robots of three families."""
    return [
        leftout.of_recording(recording(robot, seed, faulty=faulty), PROFILE)
        for robot in ("ur5", "panda", "anymal", "g1")
        for seed in range(2)
        for faulty in (False, True)
    ]


def perfect(offset=0.0):
    """A candidate that takes the loudest norm of the error for the probability of a failure."""

    def fit(scaled, targets, groups):
        classes, features = targets.max() + 1, scaled.shape[1]
        weights = np.zeros((features, classes))
        best = np.argmax(scaled[targets == 1].mean(axis=0) - scaled[targets == 0].mean(axis=0))
        weights[best, 1] = 4.0
        middle = (scaled[targets == 1, best].min() + scaled[targets == 0, best].max()) / 2
        return [
            Linear(
                weights=weights,
                offset=np.array([0.0, offset - 4.0 * middle]),
                known=np.full(features, np.inf),
                calibration=identity(classes),
                frequency=np.bincount(targets) / len(targets),
                alarm=0.5,
            )
        ]

    return Candidates(("perfect",), fit)


def test_no_line_of_robots_is_on_both_sides_and_families_are_spread():
    robots = [robot for robot in WIDE for _ in range(3) if robot not in TARGETS]
    split = leftout.robot_folds(robots, 6)
    assert sorted(np.concatenate([test for _, test in split])) == list(range(len(robots)))
    for train, test in split:
        lines = [{leftout.line_of(robots[index]) for index in side} for side in (train, test)]
        assert not lines[0] & lines[1]
        assert len({type(WIDE[robots[index]]) for index in test}) >= 2
    assert leftout.line_of("anymal_kinova") == leftout.line_of("anymal_c") == "anymal"
    assert leftout.line_of("ur10") == leftout.line_of("ur5") == "ur"


def joints_of(robot, count):
    """The first joints of a robot."""
    return tuple(joint_limits(robot))[:count]


@pytest.mark.parametrize(
    ("robot", "meta", "what"),
    [
        ("talos", {}, "robot talos"),
        ("ur5", {"domain": {"control": "impedance"}}, "control impedance"),
        ("ur5", {"logger": {**LOGGER, "bits": 12}}, "a log of 12 bit whose samples are held 1"),
        ("ur5", {"logger": {**LOGGER, "hold": 5}}, "a log of 19 bit whose samples are held 5"),
        ("panda", {"simulator": "pybullet 3.2"}, "simulator pybullet 3.2"),
    ],
)
def test_runs_of_target_domains_are_refused(tmp_path, robot, meta, what):
    time = np.arange(1000) / 1000
    path = tmp_path / "run-001.npz"
    motion = np.sin(time)[:, None]
    Run(
        time=time,
        joint_names=joints_of(robot, 1),
        velocity=motion,
        velocity_desired=motion + 1e-3,
        robot=robot,
        meta={**meta, "events": [{"label": "impact", "start": 0.1, "stop": 0.2}]},
    ).save(path)
    with pytest.raises(TargetError, match=f"run-001: {what}.* is of the target domains; nothing"):
        leftout.read([path], PROFILE)
    refused = pickle.loads(pickle.dumps(TargetError("run", what)))
    assert str(refused).startswith(f"run: {what}")


def test_a_damaged_file_is_one_line(tmp_path):
    (tmp_path / "run.npz").write_bytes(b"damaged")
    with pytest.raises(InspectorError, match=r"run\.npz: .*") as raised:
        leftout.read([tmp_path / "run.npz"], PROFILE)
    assert str(pickle.loads(pickle.dumps(raised.value))) == str(raised.value)


def test_runs_of_source_domains_are_no_targets():
    meta = {"domain": {"control": "pd"}, "logger": LOGGER, "simulator": "mujoco"}
    assert not leftout.target("ur5", meta)


def test_a_run_without_a_robot_is_refused(tmp_path):
    time = np.arange(1000) / 1000
    ends = {"block_start": [0.0], "block_stop": [1.0], "block_label": ["ok"]}
    np.savez(tmp_path / "run.npz", time=time, velocity=np.sin(time)[:, None], **ends)
    with pytest.raises(InspectorError, match=r"run\.npz: names no robot"):
        leftout.read([tmp_path / "run.npz"], PROFILE)


def test_a_perfect_candidate_has_a_pauc_of_one_and_no_false_alarm(runs):
    split = leftout.robot_folds([run.robot for run in runs], 3)
    (found,) = leftout.measure(runs, split, [perfect()], PROFILE, [Threshold(0.5, np.inf)])
    assert found.ranking(leftout.partial_auc) == found.ranking(leftout.auc) == 1.0
    assert found.mean("found_felt", "felt") == 1.0
    assert found.mean("false_alarms", "ok_hours") == 0.0
    assert found.chosen(0.0) == 0


def test_a_model_predicts_robots_that_it_was_not_trained_on(runs):
    seen = []

    def fit(scaled, targets, groups):
        seen.append({name.rpartition("-")[0] for name in groups.tolist()})
        return perfect().fit(scaled, targets, groups)

    split = leftout.robot_folds([run.robot for run in runs], 2)
    candidate = Candidates(("own",), fit)
    leftout.measure(runs, split, [candidate], PROFILE, [Threshold(0.5, 2.0)])
    for robots, (_, test) in zip(seen, split, strict=True):
        assert robots.isdisjoint(runs[index].robot for index in test)


def test_counts_at_the_shipped_thresholds_are_those_of_the_protocol():
    profile = replace(PROFILE, rounds=5, leaves=4)
    every = [recording("ur5", seed, faulty=seed % 2 > 0) for seed in range(4)]
    classifier = nc.Classifier.train(nc.Examples.read(every[:2], profile), profile)
    for one in every:
        expected = Outcome.of(predict(classifier, one))
        run = leftout.of_recording(one, profile)
        decisions = classifier.decide(run.whole)
        shipped = Threshold(profile.alarm, NOVELTY_LIMIT)
        score, counts = leftout.counted(run, classifier, decisions, [shipped])
        assert score == pytest.approx(expected.score)
        found = dict(zip(leftout.COUNTS, counts[:, 0], strict=True))
        assert {name: expected.counts.get(name, found[name]) for name in found} == found


def test_fewer_ok_frames_give_the_same_odds():
    one = recording("ur5", 0, faulty=True)
    every, run = (leftout.of_recording(one, PROFILE, thin=thin) for thin in (1, 3))
    ok, left = every.labels == "ok", run.labels == "ok"
    assert left.sum() == ok.sum() // 3
    assert (~left).sum() == (~ok).sum() > 0
    np.testing.assert_array_equal(run.cut[left], every.cut[ok][2::3])
    assert len(run.whole) == len(every.whole)
    (estimator,) = perfect().fit(np.eye(4), np.array([0, 0, 0, 1]), np.array(["a"] * 4))
    thinned = leftout.corrected(estimator, 3, np.zeros(4, dtype=bool))
    odds = [np.subtract(*each.decision(np.eye(4)[:1])[0, :2]) for each in (estimator, thinned)]
    assert odds[1] - odds[0] == pytest.approx(np.log(3))


def measured(false, found):
    """Two robots with one hour of ok motion and ten faults each."""
    counts = {name: np.full((len(false), 2), 10.0) for name in leftout.COUNTS}
    counts |= {"false_alarms": np.array(false), "found_felt": np.array(found)}
    counts["ok_hours"][:] = 1.0
    thresholds = [Threshold(each, 2.0) for each in np.linspace(0.2, 0.8, len(false))]
    parts = [(1000, "joints")] * 2
    return Measured("one", np.array(["a", "b"]), parts, np.zeros(2), thresholds, counts, 0.0)


def test_the_threshold_finds_most_within_the_budget():
    one = measured(
        false=[[90, 10], [59, 1], [20, 0], [10, 0]], found=[[9, 9], [8, 8], [8, 8], [7, 8]]
    )
    assert one.chosen(60.0) == 0
    assert one.chosen(30.0) == 2  # as many as at 30 per hour, with fewer false alarms
    assert one.chosen(5.0) == 3
    assert one.chosen(4.9) is None
    for budget in (5.0, 10.0, 30.0, 60.0):
        assert one.mean("false_alarms", "ok_hours")[one.chosen(budget)] <= budget


def test_robots_weigh_alike_in_the_report():
    one = measured(false=[[58, 2]], found=[[10, 0]])
    text = "\n".join(leftout.report([one], 30.0))
    assert "| 0.2 | 2 | 50.0 % | 100.0 % | 100.0 % | 30.0 | a 58 |" in text
    assert "| none | - |" in "\n".join(leftout.report([one], 29.0))


def test_trees_of_fewer_rounds_are_trained_with_those_of_more():
    first, second = leftout.candidates(PROFILE, ["rounds=2,3", "leaves=2,4"])
    assert first.names == ("rounds 2, leaves 2", "rounds 3, leaves 2")
    generator = np.random.default_rng(0)
    features, targets = generator.normal(size=(200, 4)), np.arange(200) % 2
    features[:, 0] += targets
    groups = np.repeat(["a-1", "b-2", "c-3"], [100, 50, 50])
    few, _ = second.fit(features, targets, groups)
    alone = replace(PROFILE, rounds=2, leaves=4)
    expected = Trees.fit(features, targets, groups, alone)
    for name, array in few.arrays().items():
        np.testing.assert_array_equal(array, expected.arrays()[name])


def files(folder, robots, *, rate, desired=True):
    """Runs of robots at a rate: a good one and a faulty one of each."""
    for robot in robots:
        for seed, faulty in enumerate((False, True)):
            one = recording(robot, seed, faulty=faulty, rate=rate)
            path = folder / f"{rate:g}" / robot / f"{one.name.partition('/')[2]}.npz"
            path.parent.mkdir(parents=True, exist_ok=True)
            Run(
                time=one.time,
                joint_names=joints_of(robot, 2),
                velocity=one.signal["measured_joints"].T,
                velocity_desired=one.signal["desired_joints"].T if desired else None,
                robot=robot,
                blocks=tuple(Block(*block) for block in one.blocks),
                meta={"domain": {"name": "mujoco-pd", "wildness": 0.5}},
            ).save(path)


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Logs of three robots at 250 Hz, and of two of them at 1 kHz, of which one is measured."""
    folder = tmp_path_factory.mktemp("logs")
    files(folder, ["ur5", "anymal", "g1"], rate=250.0)
    files(folder, ["ur5"], rate=1000.0)
    files(folder, ["anymal"], rate=1000.0, desired=False)
    return [folder / "250", folder / "1000"]


def read_general(logs, *without, thin=8):
    profile, names = leftout.wanted("general", without=without)
    runs, _ = leftout.read(leftout.files(logs), profile, thin=thin, names=names)
    return runs, profile, names


def test_the_general_profile_takes_each_log_at_its_rate_with_each_of_its_inputs(logs):
    runs, _, names = read_general(logs)
    slow, fast = ([run.part for run in runs if run.part[0] == rate] for rate in (250, 1000))
    assert sorted(slow) == sorted([(250, each) for each in ("motion", "measured", "noise")] * 6)
    assert sorted(set(fast)) == [(1000, each) for each in ("measured", "motion", "noise")]
    assert fast.count((1000, "motion")) == 2
    assert not any(name.startswith("effort") for name in names)
    assert any(name.startswith("relative effort") for name in names)


def test_frames_of_the_general_profile_are_those_that_training_takes(logs):
    runs, _, names = read_general(logs, thin=3)
    own = np.array([name in names for name in ANY.columns])
    read = [each for each, _ in classified(leftout.files(logs), None, bare_too=True)]
    expected = nc.Frames.joined(nc.frames_of(read, ANY, thin=3))
    found = np.concatenate([run.wide(run.cut, len(names)) for run in runs])
    np.testing.assert_array_equal(found, expected.features[:, own])
    assert np.isnan(expected.features[:, ~own]).all()
    labels = np.concatenate([run.labels for run in runs])
    np.testing.assert_array_equal(labels, expected.labels)


def test_a_general_candidate_decides_as_the_model_that_training_makes(logs, monkeypatch):
    runs, profile, names = read_general(logs)
    small = replace(ANY, rounds=3, leaves=4)
    read = [each for each, _ in classified(leftout.files(logs), None, bare_too=True)]
    model = nc.General.train(nc.Frames.joined(nc.frames_of(read, small, thin=8)), small, thin=8)
    decided = []

    def counted(run, classifier, decisions, thresholds):
        decided.append(decisions)
        return 0.0, np.zeros((len(leftout.COUNTS), len(thresholds)))

    monkeypatch.setattr(leftout, "counted", counted)
    every = np.arange(len(runs))  # none is left out
    candidates = [*leftout.candidates(profile, ["rounds=3", "leaves=4"], names)]
    threshold = [Threshold(0.5, NOVELTY_LIMIT)]
    leftout.measure(runs, [(every, every)], candidates, profile, threshold, names=names, thin=8)
    for run, decisions in zip(runs, decided, strict=True):
        classifier = model.at(run.profile.rate, run.profile.signals)
        expected = classifier.decide(run.whole[:, np.isin(columns(run.profile), names)])
        np.testing.assert_allclose(decisions, expected, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize(
    ("without", "left"),
    [
        ("relative", "measured long mean 15"),
        ("plain", "relative effort_joints long mean 15"),
        ("efforts", "relative error_joints long mean 15"),
        ("joints", "relative effort_joints long mean 15"),
    ],
)
def test_features_can_be_left_out_by_name(logs, without, left):
    runs, _, names = read_general(logs[:1], without)
    parts = {
        "relative": lambda name: name.startswith("relative "),
        "plain": lambda name: not name.startswith("relative "),
        "efforts": lambda name: "effort_joints" in name,
        "joints": lambda name: "_joints" in name and "effort" not in name,
    }
    assert left in names
    assert not any(parts[without](name) for name in names)
    _, every = leftout.wanted("general")
    assert [name for name in every if not parts[without](name)] == list(names)
    assert len(runs) == 18
    widths = {run.part[1]: len(run.places) for run in runs}
    assert all(np.ptp(run.places) < len(names) for run in runs)
    assert 0 < widths["noise"] <= widths["measured"] <= widths["motion"]


def test_settings_of_the_other_kind_of_profile_are_refused():
    with pytest.raises(InspectorError, match=r"general is for any rate; leave out --rate 500"):
        leftout.wanted("general", 500.0)
    with pytest.raises(InspectorError, match=r"joints is of one rate; leave out --without"):
        leftout.wanted("joints", None, ["efforts"])
    with pytest.raises(InspectorError, match=r"no feature is left without plain, relative"):
        leftout.wanted("general", None, ["plain", "relative"])


def test_logistic_regression_takes_missing_features_at_their_mean():
    generator = np.random.default_rng(0)
    scaled, targets = generator.normal(size=(300, 3)).astype(np.float32), np.arange(300) % 2
    scaled[:, 1] += targets
    missing = scaled.copy()
    missing[::3, 2] = np.nan
    fitted = Linear.fit(missing, targets, 0.5)
    alike = Linear.fit(np.nan_to_num(missing), targets, 0.5)
    np.testing.assert_array_equal(fitted.logits(missing), alike.logits(np.nan_to_num(missing)))
    assert np.isfinite(fitted.decision(missing)).all()


def test_a_run_below_the_lowest_rate_is_left_out(tmp_path):
    files(tmp_path, ["ur5"], rate=250.0)
    files(tmp_path, ["ur5"], rate=50.0)
    profile, names = leftout.wanted("general")
    runs, left_out = leftout.read(leftout.files([tmp_path]), profile, names=names)
    assert {run.part[0] for run in runs} == {250}
    assert str(left_out) == "left out: 2 runs below 80 Hz, e.g. ur5/fault-1"


@pytest.mark.slow
@pytest.mark.parametrize("options", [[], ["--profile", "norms", "--rate", "250"]])
def test_the_benchmark_prints_its_tables(logs, monkeypatch, capsys, options):
    paths = [str(path) for path in logs[: 1 if options else 2]]
    grid = ["--grid", "rounds=2,4", "leaves=4", "--alarms", "0.5", "0.9", "--budget", "1e6"]
    monkeypatch.setattr(
        "sys.argv", ["leftout", *paths, *options, *grid, "--folds", "3", "--jobs", "1"]
    )
    leftout.main()
    tables = capsys.readouterr().out.split("\n\n")
    rows = [[line for line in each.split("\n") if line.startswith("| ")] for each in tables]
    counts = [len(each) for each in rows if each]
    names = [line.split(" | ")[0] for line in max(rows, key=len)[1:]]
    assert {"| rounds 2, leaves 4", "| logistic regression"} <= set(names)
    assert counts == ([4, 7] if options else [4, 7, 1 + 3 * 6])


def test_logs_to_learn_from_alone_and_wild_domains_are_not_measured_and_not_learnt(logs):
    profile, names = leftout.wanted("general")
    runs, _ = leftout.read(leftout.files([logs[0]]), profile, names=names)
    wild, _ = leftout.read(leftout.files([logs[0]]), profile, names=names, wildest=0.4)
    assert [len(run.whole) for run in wild] == [len(run.whole) for run in runs]
    assert sum(len(run.cut) for run in runs) > sum(len(run.cut) for run in wild) == 0
    both, split = [*runs, *runs], leftout.robot_folds([run.robot for run in (*runs, *runs)], 3)
    split = [(learn, test[test < len(runs)]) for learn, test in split]
    (one,) = leftout.measure(
        *(both, split, [leftout.logistic(profile)], profile, [leftout.Threshold(0.5, 2.0)]),
        measured=len(runs),
        names=names,
    )
    assert len(one.score) == len(runs)
