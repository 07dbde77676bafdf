import dataclasses
import pickle

import numpy as np
import pytest
from chains import chain

from inspector.comparison.compared import Compared, Failed
from inspector.comparison.comparing import (
    Settings,
    compare_all,
    compare_robot,
    compare_run,
    sorted_out,
    sources_of,
)
from inspector.errors import InspectorError
from noisemodel import (
    ROBOTS,
    Block,
    GeometryError,
    RobotError,
    Run,
    RunError,
    UnknownKindError,
    UnknownRobotError,
)
from noisemodel.excitation import made_up

FEW = Settings(("simplified", "C", "paper", "normal"))


def arm(folder, *kinds, **options):
    return str(chain(folder, *kinds, **options).path)


def saved(folder, moved, **changes):
    run = dataclasses.replace(made_up(moved), **changes)
    run.save(folder / "run.npz", overwrite=True)
    return folder / "run.npz"


def test_on_one_joint_all_models_agree(tmp_path):
    """With one degree of freedom every kind is the joint's speed times a constant."""
    found = compare_robot(arm(tmp_path, "revolute"), FEW)
    np.testing.assert_allclose(found.found.correlation, 1.0, rtol=1e-9)
    np.testing.assert_allclose(found.found.distance, 0.0, atol=1e-6)
    np.testing.assert_allclose(found.contrast, found.contrast[[0]] * np.ones((4, 1)), rtol=1e-6)
    np.testing.assert_allclose(found.pressure, found.pressure[[0]] * np.ones((4, 1)), rtol=1e-9)


def test_pressures_have_a_root_mean_square_of_one(tmp_path):
    found = compare_robot(arm(tmp_path, "revolute", "continuous"), FEW)
    np.testing.assert_allclose(np.mean(found.pressure**2, axis=1), 1.0, rtol=1e-12)


def test_a_jerk_stands_out_in_every_model(tmp_path):
    found = compare_robot(arm(tmp_path, "revolute", "revolute", "prismatic"), FEW)
    labels = [event.label for event in found.events]
    assert labels == ["shake-near", "shake-far", "jerk"]
    assert (found.contrast[:, labels.index("jerk")] > 3.0).all()
    assert (found.by_label(0, ["jerk", "fall"]) > 3.0).tolist() == [True, False]
    assert np.isnan(found.by_label(0, ["fall"])).all()


def test_a_vibration_is_as_loud_as_it_is_above_the_ripple(tmp_path):
    """One joint at a steady speed: p = |v|, so the contrast is that of the velocity itself."""
    robot = chain(tmp_path, "revolute")
    time = np.arange(8000) / 4000.0
    velocity = 2.0 + 0.01 * np.sin(2 * np.pi * 100 * time)
    velocity[4000:6000] += 0.1 * np.sin(2 * np.pi * 100 * time[4000:6000])
    run = Run(
        time=time,
        velocity=velocity[:, None],
        position=np.zeros((8000, 1)),
        joint_names=robot.joint_names,
        robot=str(robot.path),
        blocks=(Block(0.0, 1.0, "ok"), Block(1.0, 1.5, "oscillations")),
    )
    run.save(tmp_path / "run.npz")
    found = compare_run(tmp_path / "run.npz", FEW)
    assert [event.label for event in found.events] == ["oscillations"]
    np.testing.assert_allclose(found.contrast, 20 * np.log10(11.0), atol=0.2)


def test_distances_by_band_add_up_to_the_distance(tmp_path):
    found = compare_robot(arm(tmp_path, "revolute", "revolute"), FEW)
    counts = [np.sum((found.found.frequency >= a) & (found.found.frequency < b)) for a, b in
              [(0, 20), (20, 100), (100, 500), (500, np.inf)]]  # fmt: skip
    whole = np.sqrt(np.average(found.by_band(0) ** 2, weights=counts))
    assert whole == pytest.approx(found.found.distance[0, found.reference], rel=1e-9)


@pytest.mark.parametrize(
    ("kinds", "reference"),
    [("paper,normal,mean", "normal"), ("mean,paper", "mean"), ("paper,A,simplified", "simplified")],
)
def test_the_reference_is_normal_else_mean_else_the_last(tmp_path, kinds, reference):
    found = compare_robot(arm(tmp_path, "revolute"), Settings(("simplified", "C", "paper")))
    named = dataclasses.replace(found.found, kinds=tuple(kinds.split(",")))
    found = dataclasses.replace(found, found=named)
    assert found.kinds[found.reference] == reference


def test_a_recorded_motion_is_compared_as_the_robot_that_made_it(tmp_path):
    robot = chain(tmp_path, "revolute", "prismatic", floating_base=True)
    run = compare_run(saved(tmp_path, robot), FEW)
    assert run.floating_base
    assert run.joints == 2
    assert len(run.found.names) == 3
    assert run.remarks == ()


def test_joints_that_a_run_does_not_name_rest_and_are_told(tmp_path):
    robot = chain(tmp_path, "revolute", "revolute")
    run = made_up(robot)
    run = dataclasses.replace(
        run,
        velocity=run.velocity[:, :1],
        position=run.position[:, :1],
        joint_names=("joint1",),
        desired_joint_names=(),
    )
    run.save(tmp_path / "run.npz")
    found = compare_run(tmp_path / "run.npz", FEW)
    assert found.remarks == ("The run does not name joint2: they rest.",)


def test_of_a_run_with_gaps_the_longest_stretch_is_compared(tmp_path):
    robot = chain(tmp_path, "revolute", "revolute")
    run = made_up(robot)
    valid = np.ones(len(run.time), dtype=bool)
    valid[2000:2100] = False
    path = saved(
        tmp_path,
        robot,
        valid=valid,
        velocity=run.velocity * valid[:, None],
        position=run.position * valid[:, None],
        blocks=(Block(0.1, 0.2, "jerk"), Block(4.6, 4.8, "jerk")),
    )
    found = compare_run(path, FEW)
    assert found.time[0] == run.time[2100]
    assert [event.start for event in found.events] == [4.6]
    assert "The run has gaps: compared from 0.53 s on." in found.remarks


def test_of_a_run_with_nothing_but_gaps_nothing_is_compared(tmp_path):
    robot = chain(tmp_path, "revolute")
    run = made_up(robot)
    still = np.zeros_like(run.velocity)
    valid = np.arange(len(run.time)) % 2 == 0
    path = saved(tmp_path, robot, valid=valid, velocity=still, position=still)
    with pytest.raises(RunError, match="expected .* at least 2 samples"):
        compare_run(path, FEW)


def test_an_event_between_two_samples_has_no_contrast(tmp_path):
    robot = chain(tmp_path, "revolute")
    found = compare_run(saved(tmp_path, robot, blocks=(Block(1.00001, 1.00002, "jerk"),)), FEW)
    assert np.isnan(found.contrast).all()


def test_mimic_joints_that_cannot_follow_move_by_themselves(tmp_path):
    follow = '<mimic joint="nobody"/>'
    found = compare_robot(arm(tmp_path, "revolute", "revolute", follow=follow), FEW)
    assert found.joints == 2
    assert "move by themselves" in found.remarks[0]


def test_mimic_joints_follow(tmp_path):
    follow = '<mimic joint="joint1" multiplier="2"/>'
    found = compare_robot(arm(tmp_path, "revolute", "revolute", follow=follow), FEW)
    assert found.joints == 1
    assert len(found.found.names) == 2


def test_robots_are_compared_many_at_once_and_alike(tmp_path):
    sources = [arm(tmp_path, "revolute", "revolute"), "ur3_empty", str(tmp_path / "none.urdf")]
    alone, together = (list(compare_all(sources, FEW, jobs=jobs)) for jobs in (1, 2))
    assert [type(one) for one in together] == [Compared, Failed, Failed]
    np.testing.assert_array_equal(alone[0].found.correlation, together[0].found.correlation)
    assert alone[1:] == together[1:]
    assert "empty" in together[1].message
    assert "there is no such URDF file" in together[2].message
    found, failed = sorted_out(together)
    assert (len(found), len(failed)) == (1, 2)
    assert pickle.dumps(found)  # what workers hand back


def test_sources_are_runs_and_robots_once_each(tmp_path):
    assert sources_of([tmp_path, tmp_path], "panda, go2,panda,") == [tmp_path, "panda", "go2"]
    assert sources_of([], "all") == list(ROBOTS)
    assert sources_of([], "") == []


@pytest.mark.parametrize(
    ("settings", "error", "message"),
    [
        ({"kinds": ("paper", "loud")}, UnknownKindError, "no kind 'loud' of noise; .*simplified"),
        ({"kinds": ("paper",)}, InspectorError, "are paper; expected two different ones or more"),
        ({"kinds": ("A", "A")}, InspectorError, "expected two different ones"),
        ({"geometry": "skin"}, GeometryError, "geometry 'skin' is not known, .* visual, collision"),
    ],
)
def test_settings_are_refused_before_anything_is_done(settings, error, message):
    with pytest.raises(error, match=message):
        Settings(**settings)


def test_runs_that_do_not_suffice_are_refused(tmp_path):
    robot = chain(tmp_path, "revolute")
    with pytest.raises(InspectorError, match="the run names no robot; `inspector import --robot`"):
        compare_run(saved(tmp_path, robot, robot=None), FEW)
    with pytest.raises(InspectorError, match="the run has no positions"):
        compare_run(saved(tmp_path, robot, position=None), FEW)
    with pytest.raises(UnknownRobotError, match="no robot 'robby'"):
        compare_run(saved(tmp_path, robot, robot="robby"), FEW)
    with pytest.raises(RunError, match="cannot be read"):
        compare_run(tmp_path / "none.npz", FEW)


def test_robots_that_cannot_be_had_are_refused(tmp_path):
    with pytest.raises(UnknownRobotError, match=r"no robot 'tallos'.*did you mean 'talos'"):
        compare_robot("tallos", FEW)
    with pytest.raises(RobotError, match="the URDF is empty"):
        compare_robot("ur3_empty", FEW)
    with pytest.raises(InspectorError, match="no link has a surface by geometry 'visual'"):
        compare_robot(arm(tmp_path, "revolute", shapes=[""]), Settings(geometry="visual"))
