import numpy as np
import pytest

from inspector.localisation import Localisation, first_stage, onset, quiet_statistics, rise
from noiseclassifier import Event
from noisemodel import Block, Run

RATE, SECONDS = 2000.0, 4.0
NAMES = ("hip", "knee", "ankle")
DELAY = 4  # samples by which each stage follows the one before: 2 ms
JUMP = Block(2.0, 2.1, "highaccelerations")
SHAKE = Block(2.0, 3.0, "oscillations")


def later(signal, samples):
    return np.concatenate((np.repeat(signal[:1], samples, axis=0), signal[:-samples]))


def flowing_run(acts_in=None, kind="jump", *, feedback=0.0, **changed):
    """Let a swing pass planned, commanded, desired and measured; something is added to one."""
    time = np.arange(round(RATE * SECONDS)) / RATE
    random = np.random.default_rng(1)
    failure = np.zeros((len(time), 3))
    during = (time >= 2.0) & (time < (2.05 if kind == "jump" else 3.0))
    wave = 1.0 if kind == "jump" else np.sin(2 * np.pi * 80 * time[during])
    failure[during, 1] = 0.5 * wave
    swing = np.cos(np.outer(time, [2.0, 3.0, 4.0])) + 0.02 * np.sin(np.outer(time, [180, 200, 220]))
    added = {
        name: failure if name == acts_in else np.zeros_like(failure)
        for name in ("planned", "commanded", "desired", "measured")
    }
    planned = swing + added["planned"]
    response = feedback * later(added["measured"], 3 * DELAY)
    commanded = later(planned, DELAY) + added["commanded"] + response
    desired = commanded + added["desired"]
    noise = 1e-4 * random.standard_normal(swing.shape)
    fields = {
        "time": time,
        "velocity": later(desired, DELAY) + added["measured"] + noise,
        "velocity_desired": desired,
        "stages": {"planned": planned, "commanded": commanded},
        "joint_names": NAMES,
        "blocks": (JUMP if kind == "jump" else SHAKE,),
    }
    return Run(**(fields | changed))


def found(run, failure=None, reach=0.1):
    failure = failure or run.blocks[0]
    return first_stage(run, quiet_statistics(run, run.blocks), failure, reach=reach)


@pytest.mark.parametrize(
    ("stage", "following"),
    [("planned", "commanded"), ("commanded", "measured"), ("desired", "measured")],
)
def test_a_jump_is_localised_in_the_stage_at_which_it_enters_with_its_lead(stage, following):
    first = found(flowing_run(stage))
    assert (first.stage, first.following) == (stage, following)
    assert first.onset == pytest.approx(2.0, abs=0.01)
    assert first.lag == pytest.approx(DELAY / RATE, abs=1.1e-3)


@pytest.mark.parametrize("kind", ["jump", "shake"])
@pytest.mark.parametrize("stage", ["planned", "commanded", "desired", "measured"])
def test_the_joint_on_which_a_defect_acts_is_named(stage, kind):
    joint, share = found(flowing_run(stage, kind)).joints[0]
    assert joint == "knee"
    assert share > 0.9


def test_a_blow_shows_in_the_measured_motion_before_the_command_responds():
    first = found(flowing_run("measured", feedback=0.5))
    assert (first.stage, first.following) == ("measured", "commanded")
    assert first.lag == pytest.approx(3 * DELAY / RATE, abs=1e-3)
    alone = found(flowing_run("measured"))
    assert (alone.stage, alone.following, alone.lag) == ("measured", "", 0.0)


@pytest.mark.parametrize("feedback", [0.0, 0.1])
@pytest.mark.parametrize("stage", ["planned", "commanded", "desired", "measured"])
def test_a_lasting_vibration_is_localised_in_the_stage_that_adds_it(stage, feedback):
    first = found(flowing_run(stage, "shake", feedback=feedback))
    assert first.onset is None
    assert first.stage == stage
    if stage in ("desired", "measured"):
        assert found(flowing_run(stage, stages={})).stage == stage


def test_a_lasting_vibration_leads_the_measured_one_by_the_delay_between_them():
    for stage, delay in (("desired", DELAY), ("planned", 2 * DELAY)):
        lag = found(flowing_run(stage, "shake")).lag
        assert lag == pytest.approx(delay / RATE, abs=2 / RATE)


def test_a_finding_is_searched_over_its_first_frame_with_quiet_time_and_without():
    event = Event("highaccelerations", 1.7, 2.3, 1.0)
    run = flowing_run("commanded")
    first = first_stage(run, quiet_statistics(run, [event, *run.blocks]), event, reach=0.4)
    assert first.stage == "commanded"
    whole = Block(0.0, 4.0, "impact")  # no time is quiet
    first = first_stage(run, quiet_statistics(run, [whole]), run.blocks[0], reach=0.1)
    assert first.stage in {"planned", "commanded"}


def test_joints_that_are_desired_in_another_order_or_not_at_all_are_matched_by_name():
    run = flowing_run("desired")
    fewer = {"velocity_desired": run.velocity_desired[:, 1:], "desired_joint_names": NAMES[1:]}
    assert found(flowing_run("desired", **fewer)).joints[0] == ("knee", pytest.approx(1.0, abs=0.1))
    turned = flowing_run(
        "desired", velocity_desired=run.velocity_desired[:, ::-1], desired_joint_names=NAMES[::-1]
    )
    assert found(turned) == found(run)


def test_no_stage_shows_what_is_not_there_is_the_edge_of_a_gap_or_lies_in_one():
    valid = np.ones(round(RATE * SECONDS), dtype=bool)
    valid[3920:3960] = False
    run = flowing_run(None)
    assert found(run) == Localisation()
    empty = {name: np.where(valid[:, None], stage, 0.0) for name, stage in run.stages.items()}
    gap = flowing_run(
        velocity=np.where(valid[:, None], run.velocity, 0.0),
        velocity_desired=np.where(valid[:, None], run.velocity_desired, 0.0),
        stages=empty,
        valid=valid,
    )
    assert found(gap) == Localisation()
    valid[3960:4240] = False
    assert found(flowing_run(valid=valid)) == Localisation()


def test_an_onset_is_the_sample_at_which_something_first_sets_in_steeply():
    level = np.full(2000, 1.0)
    level[1000:1100] = 50.0
    moment = rise(level, 900, 1100, rate=10000.0)
    around = slice(900, 1300)
    assert onset(level, moment, around, rate=10000.0) == 1000
    assert onset(np.ones(2000), 1000, around, rate=10000.0) is None
    level = np.full(4000, 1.0)
    level[1000:1100], level[1800:1900] = 40.0, 60.0
    assert abs(rise(level, 600, 2000, rate=10000.0) - 1000) < 20
