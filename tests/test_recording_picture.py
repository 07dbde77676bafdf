import struct

import pytest

from inspector import compare
from inspector.analysis import analyse_file
from inspector.library import demo_run, load_library
from inspector.recording import viewer
from inspector.recording.run import write

picture = pytest.importorskip("picture")
pytestmark = pytest.mark.skipif(not picture.DRIVERS, reason=picture.MISSING)
ONE = {
    "Findings", "Robot, links coloured by level above 10 Hz", "class", "noise", "level",
    "probability", "spectrogram", "joints", "links",
}  # fmt: skip
TWO = {"Before → after", "Robot before", "Robot after", "Level", "Change"}


@pytest.mark.parametrize("runs", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_the_viewer_draws_the_demo_alone_and_beside_itself_and_reports_no_error(tmp_path, runs):
    path, demo, library = tmp_path / "demo.rrd", demo_run(), load_library()
    if runs == 1:
        write(analyse_file(demo, library), path)
    else:
        compare.write(compare.compare(demo, demo, library), path)
    for _ in range(2):  # a busy machine may draw too late for the first viewer
        with picture.headless_viewer() as client:
            png = picture.picture(client, path, 2.0)
            state = picture.final_state(client)
            errors = [entry for entry in client.get_logs() if entry.level == "ERROR"]
        if not any("timed out" in entry.message for entry in errors):
            break
    assert png.startswith(b"\x89PNG")
    assert struct.unpack(">II", png[16:24]) >= (1000, 500)
    assert (ONE if runs == 1 else TWO) <= {view.name for view in state.views}
    assert not [report for view in state.views for report in view.reports]
    assert not errors


@pytest.mark.slow
def test_a_picture_is_taken_without_a_display(tmp_path):
    write(analyse_file(demo_run(), {}), tmp_path / "demo.rrd")
    viewer.shoot(tmp_path / "demo.rrd", tmp_path / "out.png", 2.0)
    png = (tmp_path / "out.png").read_bytes()
    assert struct.unpack(">II", png[16:24]) == viewer.WINDOW
    assert len(png) > 10_000  # an empty window is 5 kB
