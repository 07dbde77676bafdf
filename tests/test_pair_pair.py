import dataclasses
from functools import partial

import numpy as np
import pytest
import recordings

from inspector.compare import (
    Align,
    align,
    changes,
    compare,
    largest_change,
    part,
    report,
    spectra,
    steps,
    summary,
    whole,
)
from inspector.errors import InspectorError
from inspector.library import demo_run, load_library, model_files
from noiseclassifier import Event
from noisemodel import Block, Run

LOUDER = 20 * np.log10(2)


def moving(seconds=4.0, rate=1000, *, seed=0, **changes):
    """Make a run that moves as no other does: strokes at random times."""
    time = np.arange(round(seconds * rate)) / rate
    random = np.random.default_rng(seed)
    centres, sizes = random.uniform(0, seconds, 12), random.uniform(0.2, 1.0, 12)
    strokes = np.exp(-(((time[:, None] - centres) / 0.08) ** 2)) * sizes
    velocity = np.stack([strokes[:, :6].sum(axis=1), strokes[:, 6:].sum(axis=1)], axis=1)
    fields = {"time": time, "velocity": velocity, "joint_names": ("a", "b")}
    return Run(**(fields | changes))


panda = partial(recordings.panda, seconds=2.0, blocks=())


def compared(tmp_path, before, after, library=None, **options):
    before.save(tmp_path / "before.npz", overwrite=True)
    after.save(tmp_path / "after.npz", overwrite=True)
    library = {} if library is None else library
    return compare(tmp_path / "before.npz", tmp_path / "after.npz", library, **options)


@pytest.fixture(scope="module")
def library():
    return load_library(model_files())


@pytest.fixture(scope="module")
def itself(library):
    return compare(demo_run(), demo_run(), library)


def test_a_run_and_itself_differ_by_nothing(itself):
    assert itself.alignment.lag == 0
    assert itself.alignment.correlation == pytest.approx(1.0)
    assert (np.diff(steps(itself)[1], axis=1) == 0).all()
    for joint in ("", "panda_joint2"):
        before, after = spectra(itself, joint)
        assert (before.amplitude == after.amplitude).all()
    every = [*(c.level for c in changes(itself)), whole(itself)]
    assert {level.change for level in every} == {0.0}
    found = changes(itself)
    assert len(found) == len(itself.before.findings) > 0
    assert {change.kind for change in found} == {"unchanged"}
    assert f"findings: {len(found)} unchanged; vibration +0.0 dB" in summary(itself)


def test_a_run_that_starts_later_is_found_to_and_differs_by_nothing(tmp_path, library):
    run = Run.load(demo_run())
    late = part(run, round(0.7 * run.rate), len(run.time))
    late = dataclasses.replace(late, time=late.time - late.time[0], blocks=())
    pair = compared(tmp_path, run, late, library, robot=False)
    assert pair.alignment.seconds == pytest.approx(0.7)
    assert pair.time[0] == pytest.approx(run.time[0] + 0.7)
    assert (pair.before.noise == pair.after.noise).all()
    assert whole(pair).change == 0.0
    assert "by the motion: after starts +0.7000 s" in str(pair.alignment)
    assert any("The run before has 0.70 s that the other one has not" in r for r in pair.remarks)
    back = compared(tmp_path, late, run, robot=False)
    assert back.alignment.seconds == pytest.approx(-0.7)


def test_a_run_twice_as_loud_is_6_db_louder_everywhere(tmp_path):
    pair = compared(tmp_path, panda(), panda(2.0))
    assert whole(pair).change == pytest.approx(LOUDER)
    time, level = steps(pair)
    rattling = (time >= 0.55) & (time < 0.95)
    np.testing.assert_allclose(np.diff(level[rattling], axis=1), LOUDER)
    before, after = (noise.vibration for noise in pair.links)
    np.testing.assert_allclose(after, 4.0 * before, rtol=1e-9)


def test_events_of_one_class_that_overlap_are_unchanged_and_the_others_new_or_resolved(itself):
    def events(*found):
        return tuple(Event(label, start, stop, 1.0) for label, start, stop in found)

    before = events(("impact", 0.2, 0.6), ("oscillations", 1.0, 1.4), ("oscillations", 1.5, 1.8))
    after = events(("impact", 0.8, 1.2), ("oscillations", 1.3, 1.6))
    pair = dataclasses.replace(
        itself,
        before=dataclasses.replace(itself.before, findings=before, spans=before),
        after=dataclasses.replace(itself.after, findings=after, spans=after),
    )
    assert [(c.kind, c.label, c.start, c.stop) for c in changes(pair)] == [
        ("resolved", "impact", 0.2, 0.6),
        ("new", "impact", 0.8, 1.2),
        ("unchanged", "oscillations", 1.0, 1.8),
    ]


EXCHANGED = {"new": "resolved", "louder": "quieter", "unchanged": "unchanged"}


@pytest.mark.parametrize(
    ("scale", "kind"), [(2.0, "louder"), (1.3, "unchanged"), (1.0, "unchanged")]
)
def test_before_and_after_exchanged_new_becomes_resolved_and_louder_quieter(tmp_path, scale, kind):
    both, once = Block(0.5, 1.0, "oscillations"), Block(1.2, 1.6, "impact")
    quiet, loud = panda(blocks=(both,)), panda(scale, blocks=(both, once))
    there = changes(compared(tmp_path, quiet, loud, robot=False))
    back = changes(compared(tmp_path, loud, quiet, robot=False))
    assert [change.kind for change in there] == [kind, "new"]
    assert [change.kind for change in back] == [EXCHANGED[change.kind] for change in there]
    assert [change.level.change for change in back] == pytest.approx(
        [-change.level.change for change in there]
    )


def test_what_is_shown_first_is_the_new_failure_in_which_the_level_changed_most(tmp_path):
    weak, strong = Block(1.2, 1.6, "impact"), Block(0.5, 1.0, "oscillations")
    before = panda(blocks=())
    hum = np.sin(2 * np.pi * 90 * before.time) * ((before.time >= 0.5) & (before.time < 1.0))
    louder = before.velocity + 0.3 * hum[:, None]
    after = panda(velocity=louder, blocks=(weak, strong))
    pair = compared(tmp_path, before, after, robot=False)
    assert largest_change(pair, changes(pair)) == (0.5, 1.0)
    start, stop = largest_change(pair, ())
    time, level = steps(pair)
    most = time[np.abs(np.diff(level, axis=1)[:, 0]).argmax()]
    assert start < most < stop
    back = compared(tmp_path, after, before, robot=False)
    assert largest_change(back, changes(back)) == (0.5, 1.0)


def test_annotated_failures_are_matched_where_no_model_fits(tmp_path):
    blocks = (Block(0.5, 1.0, "oscillations"), Block(1.0, 1.5, "ok"))
    pair = compared(tmp_path, panda(), panda(blocks=blocks), robot=False)
    (change,) = changes(pair)
    assert (change.kind, change.label, change.start) == ("new", "oscillations", 0.5)
    assert "annotated failures: 1 new; vibration" in summary(pair)
    assert "| annotated | time [s] |" in report(pair)
    assert any(
        remark.startswith(
            ("Both: No labels: rate of 5000 Hz", "Both: No labels: logged at 5000 Hz")
        )
        for remark in pair.remarks
    )


TIME = np.arange(4000) / 1000
STILL, EVEN = (moving(velocity=np.full((4000, 2), speed)) for speed in (0.0, 0.3))
WALK = moving(velocity=np.sin(2 * np.pi * 2 * TIME)[:, None] * np.ones(2))
LATER = dataclasses.replace(part(WALK, 250, 4000), time=TIME[:3750])
RAMP = moving(velocity=TIME[:, None] * np.ones(2))
UNLIKE = [moving(seed=1), moving(seed=2)]


@pytest.mark.parametrize(
    ("before", "after"),
    [UNLIKE, (STILL, STILL), (STILL, moving()), (EVEN, EVEN), (EVEN, moving()), (WALK, LATER),
     (RAMP, RAMP)],
)  # fmt: skip
def test_unlike_even_repeated_and_ever_faster_motions_determine_no_lag(before, after):
    found = align(before, after)
    assert (found.refused, found.lag, found.how) == (True, 0, Align.START)
    assert str(found).startswith("from the start: the motions do not determine the lag (corr")


def test_runs_are_aligned_by_the_desired_motion_where_there_is_one():
    shaken = np.random.default_rng(3).normal(size=(4000, 2))
    good = moving(velocity_desired=moving().velocity)
    bad = moving(velocity=shaken, velocity_desired=moving().velocity)
    assert align(good, bad).lag == 0
    assert align(good, bad).correlation == pytest.approx(1.0)


def test_starts_and_clocks_are_taken_on_request_and_runs_that_share_no_time_refused(tmp_path):
    run = moving()
    later = dataclasses.replace(run, time=run.time + 1.5)
    assert align(run, later, Align.START).lag == 0
    assert align(run, later, Align.NONE).lag == 1500
    assert str(align(run, later, Align.NONE)).endswith("after starts +1.5000 s from before")
    assert align(run, later).lag == 0
    later = dataclasses.replace(run, time=run.time + 60)
    with pytest.raises(InspectorError, match=r"before lasts 4.00 s, and after starts \+60.00 s"):
        compared(tmp_path, run, later, how=Align.NONE)


def test_a_gap_of_either_misleads_no_alignment_and_counts_in_neither(tmp_path):
    valid = np.ones(10_000, dtype=bool)
    valid[2500:5000] = False  # where it rattles
    torn = panda()
    torn = panda(velocity=np.where(valid[:, None], torn.velocity, 0.0), valid=valid)
    pair = compared(tmp_path, panda(), torn, robot=False)
    assert whole(pair).change == pytest.approx(0.0, abs=1e-9)
    for each in spectra(pair):
        assert not ((each.time > 0.5) & (each.time < 1.0)).any()
    run = moving()
    strokes = moving(velocity=run.velocity * valid[1500:5500, None], valid=valid[1500:5500])
    assert align(run, strokes).lag == 0


def test_the_faster_run_is_decimated_and_both_have_one_level(tmp_path):
    pair = compared(tmp_path, moving(rate=4000), moving(rate=1000))
    assert pair.rate == 1000.0
    assert whole(pair).change == pytest.approx(0.0, abs=0.1)
    (remark,) = [r for r in pair.remarks if "decimated" in r]
    assert remark.startswith("The run before is decimated from 4000 Hz to the 1000 Hz of the other")


def test_only_the_stretch_that_both_cover_is_compared_and_blocks_move_with_their_run(tmp_path):
    run = moving(seconds=6.0)
    pair = compared(tmp_path, run, part(run, 0, 4000))
    assert len(pair.time) == len(pair.before.noise) == len(pair.after.noise) == 4000
    assert pair.remarks[0].startswith("The run before has 2.00 s that the other one has not")
    blocks = (Block(0.5, 1.0, "impact"),)
    late = dataclasses.replace(part(run, 1000, 6000), time=run.time[:5000], blocks=blocks)
    (block,) = compared(tmp_path, run, late).after.run.blocks
    assert (block.start, block.stop) == pytest.approx((1.5, 2.0))


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"robot": None}, "the run after has no robot that is known"),
        ({"robot": "hal9000"}, "the run after has no robot that is known"),
        ({"position": None}, "the run after has no positions"),
        ({"robot": "panda_collision"}, "panda and panda_collision are two robots"),
    ],
)
def test_what_is_not_one_robot_is_not_shown(tmp_path, changed, why):
    pair = compared(tmp_path, panda(), panda(**changed))
    assert pair.links is None
    assert f"- The robots are not shown: {why}." in report(pair)


def test_what_only_one_run_has_is_left_out_and_silence_in_both_is_no_change(tmp_path):
    wanted = moving(velocity_desired=moving().velocity)
    pair = compared(tmp_path, moving(), wanted)
    assert whole(pair).change == 0.0
    assert pair.remarks[0].startswith("Only the run after has desired velocities: they are left")
    pair = compared(tmp_path, STILL, STILL)
    assert whole(pair).change == 0.0
    assert "vibration +0.0 dB" in report(pair)
    assert "nothing found in either" in summary(pair)
