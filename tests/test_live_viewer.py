from contextlib import suppress

import numpy as np
import pytest

import inspector
from inspector.live import drawing
from inspector.recording import viewer

picture = pytest.importorskip("picture")
pytestmark = [pytest.mark.slow, pytest.mark.skipif(not picture.DRIVERS, reason=picture.MISSING)]


def test_a_viewer_follows_a_session_and_reports_no_error(monkeypatch):
    monkeypatch.setattr(viewer, "CONNECT_TIMEOUT", 60.0)
    monkeypatch.setattr(drawing, "FLUSH_TIMEOUT", 60.0)
    time_ = np.arange(3000) / 1000
    swing = 0.5 * np.cos(time_[:, None] * np.arange(1, 8))
    with picture.headless_viewer() as client:
        port = client.url.rpartition(":")[2].partition("/")[0]
        names = [f"panda_joint{i}" for i in range(1, 8)]
        with inspector.LiveSession(
            1000.0, robot="panda", joint_names=names, connect=port
        ) as session:
            for first in range(0, 3000, 50):
                piece = slice(first, first + 50)
                session.push(time=time_[piece], velocity=swing[piece], position=swing[piece])

        def caught_up():
            with suppress(Exception):  # it responds late under load
                state = client.get_state()
                return any(recording_end(state) > 2.9) and following(state)

        viewer.until(caught_up, 300.0, 0.3)
        state = client.get_state()
        views = picture.final_state(client).views
        errors = [entry for entry in client.get_logs() if entry.level == "ERROR"]
    assert session.summary.warnings == {}
    assert recording_end(state).max() == pytest.approx(2.999, abs=1e-6)
    assert len(state.recordings) == 1
    assert following(state)
    assert {"Robot", "Classes", "Noise"} <= {v.name for v in views}
    assert not [report for view in views for report in view.reports]
    assert not errors


def recording_end(state):
    ends = [line.end for each in state.recordings for line in each.timelines if line.name == "time"]
    return np.array(ends) / 1e9


def following(state):
    return all(each.current_time / 1e9 > 2.9 for each in state.recordings)
