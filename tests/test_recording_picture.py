import struct

import pytest

from inspector.analysis import analyse_file
from inspector.library import demo_run, load_library, model_files
from inspector.recording.run import write

picture = pytest.importorskip("picture")
pytestmark = pytest.mark.skipif(not picture.DRIVERS, reason=picture.MISSING)


def test_the_viewer_draws_the_demo_and_reports_no_error(tmp_path):
    path = tmp_path / "demo.rrd"
    write(analyse_file(demo_run(), load_library(model_files())), path)
    for _ in range(2):  # a busy machine may draw too late for the first viewer
        with picture.headless_viewer() as client:
            png = picture.picture(client, path, 2.0)
            state = picture.final_state(client)
            errors = [entry for entry in client.get_logs() if entry.level == "ERROR"]
        if not any("timed out" in entry.message for entry in errors):
            break
    assert png.startswith(b"\x89PNG")
    assert struct.unpack(">II", png[16:24]) >= (1000, 500)
    shown = {view.name for view in state.views}
    assert {
        "Findings",
        "Robot, links coloured by level above 10 Hz",
        "class",
        "noise",
        "level",
        "probability",
        "spectrogram",
        "joints",
        "links",
    } <= shown
    assert not [report for view in state.views for report in view.reports]
    assert not errors
