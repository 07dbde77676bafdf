"""Motion of any rate is labelled by a general model while it comes in."""

import numpy as np
import pytest
from generalmodel import run_at, trained

from inspector.library import label_run
from inspector.live.labels import Labeller


def library():
    return {"general": trained()}


def live(run):
    """Labels of a run that comes in chunks, and what the labeller remarks."""
    labeller = Labeller(library(), run.rate, {"velocity": 3, "velocity_desired": 3})
    motion = np.hstack((run.velocity, run.velocity_desired))
    ones = np.ones(len(motion), dtype=bool)
    parts = [labeller.push(motion[i : i + 37], ones[i : i + 37]) for i in range(0, len(motion), 37)]
    fields = ("start", "label", "scores")
    return labeller, {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in fields
    }


@pytest.mark.parametrize("rate", [80.0, 125.0, 333.0, 1000.0, 2500.0])
def test_live_motion_of_any_rate_is_labelled_as_it_comes(rate):
    run = run_at(rate, "oscillations")
    labeller, found = live(run)
    assert (labeller.model, labeller.remark) == ("general", "")
    whole = label_run(run, library()).labels
    count = len(found["start"])
    assert len(whole) - count in (0, 1)  # the last frame comes with the end of the run
    for name, each in found.items():
        np.testing.assert_allclose(
            each, getattr(whole, name)[:count]
        ) if name != "label" else np.testing.assert_array_equal(each, whole.label[:count])
