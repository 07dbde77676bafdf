import numpy as np

from inspector.analysis import SHOWN, Analysis, Status, chosen
from inspector.audit.audit import audit
from inspector.levels import STEP
from noiseclassifier import Event
from noisemodel import Run

TIME = np.arange(100) * 0.05


def analysed(*findings):
    run = Run(time=np.arange(10) / 100, velocity=np.zeros((10, 1)), joint_names=("a",))
    return Analysis(name="a", status=Status.OK, run=run, audit=audit(run, {}), findings=findings)


def test_rows_are_the_loudest_during_findings_in_the_order_of_the_robot():
    level = np.full((100, 20), -60.0)
    level[10, :10] = 20.0  # loud while nothing is wrong
    level[60, [17, 12]] = -10.0
    found = chosen(analysed(Event("impact", 3.0, 3.1, 0.9)), TIME, level)
    assert len(found) == SHOWN == len(set(found))
    assert found == sorted(found)
    assert {12, 17} <= set(found)


def test_rows_of_a_run_without_findings_are_the_loudest_at_any_time():
    level = np.full((100, 20), -60.0)
    level[10, 5:9] = 20.0
    level[20] = np.nan  # a gap
    assert set(range(5, 9)) <= set(chosen(analysed(), TIME, level))


def test_steps_that_a_finding_only_touches_do_not_count():
    finding = Event("impact", 3.0, 3.5, 0.9)
    time = np.array([3.0 - STEP, 3.0 - STEP + 1e-6, 3.5 - 1e-6, 3.5])
    level = np.full((4, 12), -60.0)
    level[0, :2] = level[3, 2:4] = 20.0  # loud just before and just after
    level[1, 4:8] = level[2, 8:] = 0.0
    assert chosen(analysed(finding), time, level) == list(range(4, 12))
    again = Event("impact", 9.0, 9.5, 0.9)  # in no step: any other finding counts
    assert chosen(analysed(again, finding), time, level) == list(range(4, 12))


def test_a_joint_without_a_level_is_the_quietest():
    level = np.full((100, 12), -60.0)
    level[:, :4] = np.nan
    assert chosen(analysed(), TIME, level) == list(range(4, 12))
    assert chosen(analysed(), TIME[:0], level[:0]) == list(range(8))


def test_a_robot_of_few_joints_has_a_row_for_each():
    assert chosen(analysed(), TIME, np.full((100, 3), -np.inf)) == [0, 1, 2]
