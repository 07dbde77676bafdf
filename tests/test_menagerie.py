"""Robots of MuJoCo Menagerie, where they are at hand: in its package's cache, or in a checkout."""

import pytest

from benchmarks.menagerie import agreement, measured
from noisemodel import Robot

FAST = ("franka_emika_panda", "universal_robots_ur5e", "robotiq_2f85", "unitree_go2", "unitree_g1")
"""One of each kind: an arm with fingers, one of OBJ meshes, coupled joints, legs, a humanoid."""


def at_hand(name):
    """Whether a robot can be read without a download."""
    menagerie = pytest.importorskip("mujoco_menagerie")
    cache = menagerie.Cache()
    return (cache.root / name).is_dir() if cache.root else cache.is_cached(menagerie.get(name))


def needed(name):
    if not at_hand(name):
        pytest.skip(f"`mujoco-menagerie prefetch {name}` downloads it")
    return f"menagerie/{name}"


@pytest.mark.parametrize("name", FAST)
def test_a_robot_of_the_menagerie_moves_is_loud_and_is_drawn(name):
    row = measured(needed(name))
    assert row.problem == ""
    assert row.joints > 0
    assert row.shaped > 0
    assert row.level > 0
    assert row.drawn >= row.shaped


@pytest.mark.slow
def test_most_robots_of_the_menagerie_are_supported():
    menagerie = pytest.importorskip("mujoco_menagerie")
    rows = [measured(f"menagerie/{name}") for name in menagerie.names() if at_hand(name)]
    if len(rows) < 30:
        pytest.skip(f"{len(rows)} robots are at hand; `mujoco-menagerie prefetch` downloads all")
    assert sum(not row.problem and row.level > 0 and row.drawn > 0 for row in rows) >= 30
    for row in rows:
        assert "\n" not in row.problem


@pytest.mark.parametrize(
    ("urdf", "name", "within"),
    [
        ("panda", "franka_emika_panda", 1e-9),
        ("go1", "unitree_go1", 1e-9),
        ("g1", "unitree_g1", 1e-5),  # its MJCF has rotations of six digits
    ],
)
def test_the_same_joints_move_the_same_links_in_both_formats(urdf, name, within):
    names, difference = agreement(Robot.load(urdf), Robot.load(needed(name)))
    arm = [place for place, joint in enumerate(names) if "finger" not in joint]
    assert len(arm) >= 7
    assert difference[arm].max() < within  # a finger's own axes are turned by half a turn
