import dataclasses

import numpy as np
import pytest

from inspector.analysis import LOUDEST, analyse_file, gaps, worst
from noiseclassifier import Event
from noisemodel import Block, Run


def inspected(tmp_path, *, blocks=(), events=(), **changes):
    """A quiet run with a short knock at 1 s and a loud rattle from 2 s to 3 s."""
    time = np.arange(4000) / 1000
    velocity = 0.2 * np.cos(time) + 1.0 * ((time >= 1.0) & (time < 1.003))
    velocity += 2.0 * np.sin(2 * np.pi * 80 * time) * ((time >= 2.0) & (time < 3.0))
    fields = {"time": time, "velocity": velocity[:, None], "joint_names": ("a",), "blocks": blocks}
    path = tmp_path / "run.npz"
    tmp_path.mkdir(exist_ok=True)
    Run(**(fields | changes)).save(path)
    return dataclasses.replace(analyse_file(path, {}), findings=tuple(events), spans=tuple(events))


KNOCK, RATTLE = Event("impact", 0.9, 1.2, 3.0), Event("oscillations", 2.0, 3.0, 1.0)


def test_the_loudest_finding_comes_first_whatever_its_score(tmp_path):
    first, second = worst(inspected(tmp_path, events=(KNOCK, RATTLE)))
    assert (first.label, second.label) == ("oscillations", "impact")
    assert 2.0 <= first.peak <= 3.0
    assert second.peak == pytest.approx(1.0, abs=0.05)
    assert (first.start, first.stop) == (2.0, 3.0)


def test_annotations_count_where_nothing_was_found(tmp_path):
    blocks = (Block(0.0, 0.5, "ok"), Block(0.9, 1.2, "impact"))
    (only,) = worst(inspected(tmp_path, blocks=blocks))
    assert only.label == "impact"


def test_without_any_failure_it_is_the_loudest_moment(tmp_path):
    (only,) = worst(inspected(tmp_path))
    assert only.label == LOUDEST
    assert 2.0 <= only.peak <= 3.0
    assert (only.start, only.stop) == (0.0, 3.999)


def test_at_most_three_are_picked(tmp_path):
    events = [Event("impact", start, start + 0.1, 1.0) for start in np.arange(5) * 0.5]
    assert len(worst(inspected(tmp_path, events=events))) == 3


def test_gaps_last_from_their_first_sample_to_the_next_valid_one():
    fields = {"time": 5.0 + np.arange(8) / 1000, "velocity": np.ones((8, 1)), "joint_names": ("a",)}
    lost = Run(**fields, valid=~np.isin(np.arange(8), [0, 3, 4, 7]))
    found = [(start - 5.0, stop - 5.0) for start, stop in gaps(lost)]
    assert np.round(1000 * np.array(found), 6).tolist() == [[0.0, 1.0], [3.0, 5.0], [7.0, 7.0]]
    assert gaps(Run(**fields)) == []


def test_a_moment_ends_with_the_run_and_peaks_within_half_a_step(tmp_path):
    late = Event("impact", 3.5, 9.0, 1.0)
    early = Event("oscillations", -1.0, 0.5, 1.0)
    gone = Event("oscillations", 7.0, 8.0, 1.0)
    found = {each.label: each for each in worst(inspected(tmp_path, events=(late, early, gone)))}
    assert set(found) == {"impact", "oscillations"}
    assert (found["impact"].start, found["impact"].stop) == (3.5, 3.999)
    assert (found["oscillations"].start, found["oscillations"].stop) == (0.0, 0.5)
    short = Event("impact", 1.001, 1.002, 1.0)  # within one step of 50 ms, from 1.0 s
    (only,) = worst(inspected(tmp_path / "other", events=(short,)))
    assert only.peak == pytest.approx(1.025)
