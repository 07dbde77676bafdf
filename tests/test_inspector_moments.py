import dataclasses

import numpy as np
import pytest

from inspector.analysis.analyse import analyse_file
from inspector.analysis.moments import worst
from models import Event
from noisemodel import Block, Run


def inspected(tmp_path, *, blocks=(), events=(), **changes):
    """A quiet run with a short knock at 1 s and a loud rattle from 2 s to 3 s."""
    time = np.arange(4000) / 1000
    velocity = 0.2 * np.cos(time) + 1.0 * ((time >= 1.0) & (time < 1.003))
    velocity += 2.0 * np.sin(2 * np.pi * 80 * time) * ((time >= 2.0) & (time < 3.0))
    fields = {"time": time, "velocity": velocity[:, None], "joint_names": ("a",), "blocks": blocks}
    path = tmp_path / "run.npz"
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
    assert only.failure


def test_without_any_failure_it_is_the_loudest_moment(tmp_path):
    (only,) = worst(inspected(tmp_path))
    assert not only.failure
    assert 2.0 <= only.peak <= 3.0
    assert (only.start, only.stop) == (0.0, 3.999)


def test_at_most_three_are_picked(tmp_path):
    events = [Event("impact", start, start + 0.1, 1.0) for start in np.arange(5) * 0.5]
    assert len(worst(inspected(tmp_path, events=events))) == 3
