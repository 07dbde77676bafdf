"""The law of cutting: a verdict does not depend on what came before, and good pieces stay ok."""

from dataclasses import replace

import numpy as np
import pytest

from inspector import LiveSession
from inspector.analysis import analyse
from inspector.errors import Status
from inspector.library import load_library
from noiseclassifier.lasting import SHORTEST
from noisemodel import Run, decimated

LIBRARY = load_library(["general"])
SECONDS, RATE = 9.0, 500.0


def run_of(kind, *, shake=0.0, frequency=55.0, noise=2e-3, during=(3.0, 6.0)):
    """An arm that swings or a leg that steps, and a chatter for a while."""
    time, generator = np.arange(round(SECONDS * RATE)) / RATE, np.random.default_rng(5)
    wanted = np.stack([0.6 * np.sin(2 * np.pi * f * time) for f in (0.3, 0.5, 0.7)], axis=1)
    error = noise * generator.standard_normal(wanted.shape)
    if kind == "leg":
        for step in np.arange(0.4, SECONDS, 0.4):  # feet touch down, each time as hard
            since = np.maximum(time - step, 0.0)
            thump = 0.15 * np.exp(-since / 0.02) * np.sin(2 * np.pi * 20 * since)
            error += (thump * (time >= step))[:, None]
    inside = (time >= during[0]) & (time < during[1])
    error[:, 1] += inside * shake * np.sqrt(2.0) * np.sin(2 * np.pi * frequency * time)
    names = ("hip", "knee", "ankle")
    return Run(time=time, velocity=wanted + error, velocity_desired=wanted, joint_names=names)


def located(run):
    """The only finding of a run whose knee chatters, by its joint and frequency."""
    analysis = analyse(run, LIBRARY)
    (event,) = analysis.findings
    where = analysis.localisations[event]
    assert (event.label, where.joints[0][0]) == ("oscillations", "knee")
    assert where.joints[0][1] > 0.8
    assert where.band == pytest.approx((54.0, 56.0), abs=0.5)
    return event


@pytest.mark.parametrize("kind", ["arm", "leg"])
def test_chatter_of_a_whole_run_is_located_though_its_motion_begins_later(kind):
    run, chatter = run_of(kind), run_of(kind, shake=0.15, during=(0.0, 9.0))
    moves = (run.time >= 0.6)[:, None]
    velocity = moves * run.velocity + (chatter.velocity - run.velocity)
    run = replace(run, velocity=velocity, velocity_desired=moves * run.velocity_desired)
    event = located(run)
    assert (event.start, event.stop) == pytest.approx((0.0, 9.0), abs=0.005)


@pytest.mark.parametrize("kind", ["arm", "leg"])
@pytest.mark.parametrize("shake", [0.15, 10.0])
def test_chatter_that_is_found_in_its_run_is_found_without_what_comes_before(kind, shake):
    run = run_of(kind, shake=shake)
    event = located(run)
    assert (event.start, event.stop) == pytest.approx((3.0, 6.0), abs=0.06)  # a step at 6 s
    generator = np.random.default_rng(6)
    pieces = [(event.start - 0.1, event.stop + 0.1), (3.1, 5.9), (4.0, 4.0 + SHORTEST + 0.05)]
    pieces += [(generator.uniform(0.0, 2.9), generator.uniform(6.1, 9.0)) for _ in range(4)]
    for start, stop in pieces:
        found = analyse(run.cut(start, stop), LIBRARY).findings
        assert [each.label for each in found] == ["oscillations"]


@pytest.mark.parametrize("kind", ["arm", "leg"])
def test_pieces_of_good_motion_are_ok(kind):
    run, generator = run_of(kind), np.random.default_rng(7)
    assert analyse(run, LIBRARY).status is Status.OK
    for _ in range(10):
        start = generator.uniform(0.0, 7.0)
        piece = run.cut(start, start + generator.uniform(SHORTEST + 0.05, 9.0 - start))
        assert analyse(piece, LIBRARY).status is Status.OK


def test_a_piece_that_is_too_short_to_tell_what_lasts_is_not_ok():
    found = analyse(run_of("arm").cut(2.0, 2.0 + SHORTEST - 0.05), LIBRARY)
    assert found.status is Status.CANNOT_TELL
    assert f"no stretch of {SHORTEST:g} s without a gap" in found.reason


@pytest.mark.parametrize("shake", [0.1, 100.0])
def test_a_chatter_does_not_become_ok_by_being_louder_coarser_slower_or_held(shake):
    run = run_of("arm", shake=shake, frequency=40.0, during=(-np.inf, np.inf))
    velocity = run.velocity
    held = velocity[np.arange(len(velocity)) // 4 * 4]
    alone = (velocity, np.round(velocity / 0.05) * 0.05, held)
    copies = [replace(run, velocity=each, velocity_desired=None) for each in alone]
    for copy in (run, *copies, decimated(run, 125.0)):
        found = analyse(copy, LIBRARY).findings
        assert [each.label for each in found] == ["oscillations"]


def test_the_first_motion_after_standing_is_compared_with_the_motion_that_follows():
    run = run_of("leg")
    early = run.time[:, None] < 1.9
    velocity = np.where(early, 1e-3 * run.velocity, run.velocity)
    desired = np.where(early, 0.0, run.velocity_desired)
    still = replace(run, velocity=velocity, velocity_desired=desired)
    assert analyse(still, LIBRARY).status is Status.OK


def test_what_lasts_is_found_live_as_in_a_file(tmp_path):
    run = run_of("arm", shake=0.3, during=(-np.inf, np.inf))
    path = tmp_path / "live.rrd"
    with LiveSession(RATE, joint_names=run.joint_names, library=LIBRARY, save=path) as session:
        for first in range(0, len(run.time), 37):
            part = slice(first, first + 37)
            session.push(velocity=run.velocity[part], velocity_desired=run.velocity_desired[part])
        summary = session.close()
    (live,), (found,) = summary.findings, analyse(run, LIBRARY).findings
    assert live.label == found.label == "oscillations"
    assert (live.start, live.stop) == pytest.approx((found.start, found.stop), abs=0.1)
