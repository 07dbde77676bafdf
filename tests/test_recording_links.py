import numpy as np

from inspector.recording.links import STATES, levels, shades, states
from noisemodel import Robot, Run
from noisemodel.links import link_noise


def rattling():
    """A UR5 moves slowly; its last joint rattles at 100 Hz from 2 s to 2.5 s."""
    time = np.arange(4000) / 1000
    position = np.sin(np.outer(time, np.linspace(0.5, 1.5, 6)))
    velocity = 0.5 * np.cos(np.outer(time, np.linspace(0.5, 1.5, 6)))
    during = (time >= 2.0) & (time < 2.5)
    velocity[during, 5] += 0.2 * np.sin(2 * np.pi * 100 * time[during])
    names = Robot.load("ur5").joint_names
    return Run(time=time, velocity=velocity, position=position, joint_names=names, robot="ur5")


def test_levels_are_relative_to_the_loudest_peak():
    found = levels(link_noise(rattling()))
    assert found.level.max() == 0.0
    assert 2.0 <= found.time[np.unravel_index(found.level.argmax(), found.level.shape)[0]] < 2.5


def test_states_do_not_flicker_around_a_threshold():
    level = np.array([-30.0, -19.9, -20.1, -19.9, -20.1, -22.9, -23.1, -5.0, -8.0, -9.1])
    assert states(level) == [
        "quiet",
        *["elevated"] * 5,
        "quiet",
        "critical",
        "critical",
        "high",
    ]
    assert states(np.array([-np.inf])) == ["quiet"]


def test_shades_go_from_quiet_to_critical_in_few_steps():
    rgba = shades(np.linspace(-60, 0, 1000))
    assert rgba[0].tolist() == [*STATES["quiet"], 255]
    assert rgba[-1].tolist() == [*STATES["critical"], 255]
    assert len(np.unique(rgba, axis=0)) <= 16
    assert shades(np.array([-np.inf]))[0].tolist() == [*STATES["quiet"], 255]
    assert list(STATES) == ["quiet", "elevated", "high", "critical"]
