"""`inspector smoothness`: measures, scores of runs, their order, and what the command prints."""

import json
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from commandline import call, complaint, printed
from hypothesis import given, settings
from hypothesis import strategies as st
from samplelogs import JOINTS, write_lerobot

from inspector.commands.check import Scores
from inspector.smoothness import (
    SCORES,
    as_text,
    default_order,
    level_above,
    log_dimensionless_jerk,
    ranked,
    scored,
    sparc,
    speed_of,
    squared_difference,
)
from noisemodel import Run
from noisemodel.run import SAMPLED

FAST_RATE = 200.0


def minimum_jerk(duration=1.0, amplitude=1.0, rate=FAST_RATE):
    """Velocity of a minimum-jerk movement from rest to rest (Flash and Hogan, 1985)."""
    share = np.linspace(0.0, 1.0, round(duration * rate) + 1)
    return (amplitude / duration * 30 * share**2 * (1 - share) ** 2)[:, None]


def with_oscillation(velocity, frequency, size, rate=FAST_RATE, phase=0.0):
    time = np.arange(len(velocity)) / rate
    return velocity + size * np.sin(2 * np.pi * frequency * time + phase)[:, None]


def test_a_minimum_jerk_movement_has_its_analytic_dimensionless_jerk():
    # Integral of the squared jerk: 720 A² / T⁵; peak speed: 15/8 A / T (Hogan and Sternad, 2009).
    exact = -np.log(720.0 / 1.875**2)
    found = log_dimensionless_jerk(minimum_jerk(rate=5000.0), 5000.0)
    assert found == pytest.approx(exact, abs=2e-3)


def test_sparc_of_a_gaussian_speed_is_that_of_its_authors():
    time = np.arange(-1, 1, 0.01)
    assert sparc(np.exp(-5 * time**2), 100.0) == pytest.approx(-1.41403, abs=1e-5)


CLEAN = minimum_jerk()


@pytest.mark.parametrize(
    "rough",
    [with_oscillation(CLEAN, each, 0.3) for each in (3.0, 6.0, 9.0)] + [np.vstack((CLEAN, CLEAN))],
)
def test_an_oscillation_or_a_second_movement_lowers_sparc_and_log_dimensionless_jerk(rough):
    assert sparc(speed_of(rough), FAST_RATE) < sparc(speed_of(CLEAN), FAST_RATE)
    assert log_dimensionless_jerk(rough, FAST_RATE) < log_dimensionless_jerk(CLEAN, FAST_RATE)


@settings(deadline=None, max_examples=25)
@given(st.floats(1e-3, 1e3))
def test_amplitude_does_not_count_in_dimensionless_measures(amplitude):
    rough = with_oscillation(minimum_jerk(), 6.0, 0.2)
    assert sparc(speed_of(amplitude * rough), FAST_RATE) == pytest.approx(
        sparc(speed_of(rough), FAST_RATE)
    )
    assert log_dimensionless_jerk(amplitude * rough, FAST_RATE) == pytest.approx(
        log_dimensionless_jerk(rough, FAST_RATE)
    )


@pytest.mark.parametrize("factor", [0.5, 2.0, 4.0])
def test_duration_does_not_count_in_dimensionless_measures(factor):
    rough = with_oscillation(minimum_jerk(), 6.0, 0.2)
    slower = log_dimensionless_jerk(rough, FAST_RATE / factor)  # the same samples, further apart
    assert slower == pytest.approx(log_dimensionless_jerk(rough, FAST_RATE))
    speed = speed_of(minimum_jerk())  # its spectrum ends far below the cut-off
    assert sparc(speed, FAST_RATE / factor) == pytest.approx(sparc(speed, FAST_RATE), rel=1e-3)


def test_sparc_is_blind_above_its_cut_off():
    clean = 0.5 + minimum_jerk(2.0)
    chatter = with_oscillation(clean, 40.0, 0.4)  # the speed stays positive
    assert sparc(speed_of(chatter), FAST_RATE) == pytest.approx(
        sparc(speed_of(clean), FAST_RATE), abs=0.02
    )
    wider = sparc(speed_of(chatter), FAST_RATE, cutoff=FAST_RATE / 2)
    assert wider < sparc(speed_of(clean), FAST_RATE, cutoff=FAST_RATE / 2)


@pytest.mark.parametrize("rate", [50.0, 200.0, 10_000.0])
def test_the_level_of_a_fast_sine_is_its_root_mean_square_and_slow_motion_has_none(rate):
    time = np.arange(round(4 * rate)) / rate
    fast, slow = np.sin(2 * np.pi * 20.0 * time), np.sin(2 * np.pi * 1.0 * time)
    assert level_above(fast[:, None], rate, 10.0) == pytest.approx(np.sqrt(0.5), rel=0.03)
    assert level_above(slow[:, None], rate, 10.0) < 0.01
    both = np.column_stack((fast, slow, fast))
    assert level_above(both, rate, 10.0) == pytest.approx(1.0, rel=0.03)


def test_differences_count_steps_and_the_second_one_passes_constant_rates():
    ramp = np.outer(np.arange(10), (3.0, 4.0))
    assert squared_difference(ramp) == pytest.approx(25.0)
    assert squared_difference(ramp, order=2) == 0.0
    zigzag = np.tile([0.0, 1.0], 5)[:, None]
    assert squared_difference(zigzag) == 1.0
    assert squared_difference(zigzag, order=2) == 4.0


def test_standstill_constant_speed_and_a_rate_that_is_too_low_are_not_nan():
    still, constant = np.zeros((100, 3)), np.ones((100, 3))
    assert sparc(speed_of(still), FAST_RATE) is None
    assert log_dimensionless_jerk(still, FAST_RATE) is None
    assert log_dimensionless_jerk(constant, FAST_RATE) is None
    assert level_above(still, FAST_RATE, 10.0) == squared_difference(still) == 0.0
    assert level_above(constant, 20.0, 10.0) is None


RATE = 50.0
TIME = np.arange(200) / RATE


def rollout(chatter=0.0, frequency=18.0, phase=0.0, *, samples=200, **changes):
    """Two joints that reach a minimum-jerk target every two seconds, and chatter in the actions."""
    share = (TIME % 2.0) / 2.0
    path = np.floor(TIME / 2.0) + share**3 * (10 - 15 * share + 6 * share**2)
    vibration = chatter * np.sin(2 * np.pi * frequency * TIME + phase)
    action = np.column_stack((path + vibration, -0.5 * path))
    lagging = np.column_stack((path + 0.5 * vibration, -0.5 * path))
    fields = {
        "time": TIME,
        "position": lagging,
        "velocity": np.gradient(lagging, 1 / RATE, axis=0),
        "position_desired": action,
        "joint_names": ("shoulder", "elbow"),
    } | changes
    for name in {*SAMPLED} & {name for name, value in fields.items() if value is not None}:
        fields[name] = fields[name][:samples]
    return Run(**fields)


@settings(deadline=None, max_examples=40)
@given(st.floats(1e-3, 0.3), st.floats(11.0, 24.0), st.floats(0.0, 6.3))
def test_chatter_never_ranks_an_episode_smoother(size, frequency, phase):
    clean, rough = scored(rollout(), "clean"), scored(rollout(size, frequency, phase), "rough")
    for by in ("", "level", "ldlj", "action_rate", "action_curvature"):
        order = ranked([rough, clean], by=by)
        assert [episode.log for episode in order.episodes] == ["clean", "rough"], by


@settings(deadline=None, max_examples=15)
@given(st.integers(1, 40), st.booleans())
def test_short_and_standing_episodes_have_numbers_or_reasons(samples, still):
    names = ("position", "velocity", "position_desired") if still else ()
    run = rollout(samples=samples + 1, **dict.fromkeys(names, np.zeros((200, 2))))
    episode = scored(run, "short")
    assert set(episode.scores) == set(SCORES)
    for name, value in episode.scores.items():
        assert (value is None) == (name in episode.reasons)
        assert value is None or np.isfinite(value)
    assert "nan" not in as_text(ranked([episode]))


def test_an_episode_that_stands_still_has_no_dimensionless_score():
    noise = 1e-4 * np.random.default_rng(0).standard_normal((200, 2))
    episode = scored(rollout(velocity=noise, position=None, position_desired=None), "still")
    assert episode.scores["sparc"] is None
    assert episode.reasons["ldlj"] == "no joint is faster than 0.01 rad/s"
    assert episode.scores["level"] < 1e-3


def test_the_longest_stretch_between_gaps_is_scored():
    valid = np.ones(200, dtype=bool)
    valid[60:70] = False
    run = rollout()
    signals = {
        name: np.where(valid[:, None], getattr(run, name), 0.0)
        for name in ("position", "velocity", "position_desired")
    }
    episode = scored(rollout(valid=valid, **signals), "gaps")
    assert episode.duration == pytest.approx(2.6)
    assert episode.remarks == ("The longest stretch without a gap was scored.",)
    assert scored(run, "whole").remarks == ()
    assert episode.scores["level"] < 0.2  # of the jump from 0 it would be 0.5


def test_velocities_that_were_smoothed_are_replaced_by_differences(tmp_path):
    chattering = rollout(0.05)
    path = tmp_path / "run.npz"
    np.savez(path, time=TIME, position=chattering.position)
    loaded = scored(Run.load(path), "run")
    smoothed = scored(Run(time=TIME, velocity=Run.load(path).velocity, joint_names=("a", "b")), "")
    assert "Velocities are first differences of positions." in loaded.remarks
    assert loaded.scores["level"] > 3 * smoothed.scores["level"]


@pytest.mark.parametrize("hold", [10, 2.5, 10 / 3])
def test_actions_that_a_log_holds_are_counted_once(hold):
    run = rollout(0.02)
    places = np.arange(int(200 * hold)) / hold
    faster = Run(
        time=places / RATE,
        velocity=np.random.default_rng(0).standard_normal((len(places), 2)),
        position_desired=run.position_desired[(places + 1e-9).astype(int)],
        joint_names=run.joint_names,
    )
    held, plain = (scored(each, "").scores for each in (faster, run))
    for name in ("action_rate", "action_curvature"):
        assert held[name] == pytest.approx(plain[name], rel=0.05)


def test_an_angle_that_wraps_is_no_jump():
    turning = 3.0 * TIME[:, None] * np.ones(2)
    wrapped = (turning + np.pi) % (2 * np.pi) - np.pi
    episodes = [
        scored(rollout(position=each, position_desired=each, velocity=0 * each + 3.0), "")
        for each in (turning, wrapped)
    ]
    for name in ("action_rate", "action_curvature"):
        first, second = (episode.scores[name] for episode in episodes)
        assert second == pytest.approx(first, abs=1e-12)


def test_a_command_beyond_half_a_turn_is_a_jump_if_the_joint_does_not_wrap():
    grip = np.where(TIME[:, None] // 1 % 2, [80.0, 6.2], 0.0)  # in mm, and nearly a turn
    smooth = [np.convolve(each, np.ones(9) / 9, "same") for each in grip.T]
    episode = scored(rollout(position=np.transpose(smooth) / 5, position_desired=grip), "")
    exact = np.square(np.diff(grip, axis=0)).sum(axis=1).mean()
    assert episode.scores["action_rate"] == pytest.approx(exact)


def test_the_order_is_by_actions_where_all_are_episodes_of_data_sets_with_actions():
    none, logged = scored(rollout(position_desired=None), "none"), scored(rollout(), "logged")
    assert none.reasons["action_rate"] == "the log has no desired positions"
    of_set = replace(logged, episode="0")
    assert default_order([of_set]) == "action_curvature"
    assert default_order([logged]) == "level"  # logs, by their measured velocities
    assert default_order([logged, none]) == "level"
    assert default_order([of_set, replace(none, episode="1")]) == "level"
    assert ranked([scored(rollout(samples=2), "", episode="0")]).by == "action_rate"


def test_episodes_with_the_same_actions_are_ordered_by_what_tells_them_apart():
    rough = rollout(0.05)
    same = [
        scored(replace(rough, position_desired=rollout().position_desired), "rough", episode="1"),
        scored(rollout(), "clean", episode="0"),
    ]
    order = ranked(same)
    assert order.by == "level"
    assert [episode.log for episode in order.episodes] == ["clean", "rough"]


def test_equal_episodes_have_one_rank_and_those_without_the_score_none():
    rough = replace(rollout(0.05), position_desired=rollout().position_desired)
    order = ranked([scored(rollout(), "a"), scored(rough, "b")], by="action_curvature")
    assert order.ranks == (1, 1)
    last = "All are equal by 2nd diff.: `--by` orders them by another score."
    assert as_text(order).splitlines()[-1] == last
    order = ranked([scored(rollout(samples=5), "short"), scored(rollout(), "long")], by="level")
    assert [episode.log for episode in order.episodes] == ["long", "short"]
    assert order.ranks == (1, None)


@pytest.fixture
def folder(tmp_path):
    for name, chatter in (("smooth", 0.0), ("rough", 0.1), ("middle", 0.01)):
        rollout(chatter).save(tmp_path / f"{name}.npz")
    (tmp_path / "notes.md").write_text("no log")
    return tmp_path


def test_a_folder_is_ranked_in_one_table(folder):
    lines = printed("smoothness", folder).splitlines()
    assert lines[0] == "3 episodes, the smoothest first by level of the velocities above 10 Hz"
    assert [line.split()[1] for line in lines[4:7]] == ["smooth.npz", "middle.npz", "rough.npz"]
    assert lines[-1] == f"The roughest by >10 Hz: inspector view {folder / 'rough.npz'}"
    assert not any("empty" in line for line in lines)


def test_json_has_the_numbers_of_each_episode(folder):
    assert set(get_args(Scores)) == set(SCORES)
    found = json.loads(call("smoothness", folder, "--format", "json", "--by", "ldlj")[1])
    assert (found["format"], found["settings"]["sparc_cutoff_hz"]) == ("noise-smoothness/2", 10.0)
    assert [episode["rank"] for episode in found["episodes"]] == [1, 2, 3]
    for episode in found["episodes"]:
        own = scored(Run.load(episode["log"]), "")
        assert (episode["missing"], episode["ldlj"]) == ({}, own.scores["ldlj"])


def test_one_bad_log_is_named_and_the_others_are_ranked(folder):
    (folder / "bad.csv").write_text("hello\nworld\n")
    rollout(position_desired=None).save(folder / "free.npz")
    status, out, err = call("smoothness", folder)
    assert status == 3
    assert out.startswith("4 episodes")
    assert err.startswith(f"inspector: {folder / 'bad.csv'}: ")
    for title in ("action rate", "2nd diff."):
        assert f"{title}: empty for 1 of 4, the log has no desired positions" in out.splitlines()


def test_a_folder_without_logs_says_what_it_looked_for(tmp_path):
    status, out, err = call("smoothness", tmp_path)
    assert (status, out) == (3, "0 episodes\n")
    assert err.startswith(f"inspector: {tmp_path}: a folder without logs (.bag")


def test_a_lerobot_data_set_is_ranked_by_episode(tmp_path):
    states = [rollout(chatter).position[:, [0, 1, 1]] for chatter in (0.1, 0.0)]
    names = [f"{joint}.pos" for joint in JOINTS]
    data = write_lerobot(tmp_path / "set", states, names=names, fps=50)
    assert "LeRobot does not log the unit" in complaint("smoothness", data)
    lines = printed("smoothness", data, "--units", "radians").splitlines()
    assert [line.split()[1:4] for line in lines[4:6]] == [["set", "episode", n] for n in "10"]
    command = f"inspector import {data} --episode 0 -o roughest.npz"
    assert lines[-1] == f"The roughest by 2nd diff.: {command}"
