import dataclasses

import numpy as np
import pytest

from inspector.analysis.analyse import analyse_file
from inspector.analysis.verdict import judge
from inspector.assets import demo_run, model_files
from inspector.library import load_library
from inspector.localisation.band import band
from inspector.localisation.localise import Origin, origins
from inspector.localisation.quiet import quiet
from inspector.localisation.stage import First
from inspector.report.html import found as tables
from inspector.report.markdown import report, sentence
from noisemodel import Block, Run

RATE, SECONDS = 2000.0, 6.0
SHAKE = Block(2.0, 3.5, "oscillations")


def shaken_run(low=80, high=100, *, blocks=(SHAKE,), **changed):
    """Move two joints slowly, with a hum of 30 Hz, and shake one in a band."""
    time = np.arange(round(RATE * SECONDS)) / RATE
    velocity = np.cos(np.outer(time, [2.0, 3.0])) + 0.3 * np.sin(2 * np.pi * 30 * time)[:, None]
    desired = velocity.copy()
    during = (time >= 2.0) & (time < 3.5)
    for frequency in range(low, high + 1, 4):
        velocity[during, 1] += 0.2 * np.sin(2 * np.pi * frequency * time[during] + frequency**2)
    fields = {
        "time": time,
        "velocity": velocity,
        "velocity_desired": desired,
        "joint_names": ("hip", "knee"),
        "blocks": blocks,
    }
    return Run(**(fields | changed))


def inspected(run, tmp_path, **changed):
    run.save(tmp_path / "run.npz", overwrite=True)
    return dataclasses.replace(analyse_file(tmp_path / "run.npz", {}), **changed)


@pytest.mark.parametrize(("low", "high"), [(20, 40), (80, 100), (300, 320)])
def test_a_failure_lies_in_the_band_in_which_it_shakes(low, high):
    found = band(shaken_run(low, high), SHAKE, [SHAKE])
    assert low - 5 <= found[0] < found[1] <= high + 5
    assert found[1] - found[0] >= 0.4 * (high - low)


def test_a_hum_that_is_always_there_is_no_failure():
    quiet_block = Block(4.5, 5.5, "impact")
    found = band(shaken_run(300, 320), quiet_block, [SHAKE, quiet_block])
    assert found is None or not found[0] <= 30 <= found[1] or found[1] - found[0] > 5


def test_a_short_blow_has_a_band_though_it_is_shorter_than_a_window():
    blow = Block(3.0, 3.01, "impact")
    assert band(shaken_run(), blow, [blow, SHAKE]) is not None


def test_a_failure_in_a_gap_has_no_band():
    valid = np.ones(round(RATE * SECONDS), dtype=bool)
    valid[3900:7100] = False
    assert band(shaken_run(valid=valid), SHAKE, [SHAKE]) is None


def test_quiet_stretches_keep_clear_of_failures_and_gaps():
    valid = np.ones(round(RATE * SECONDS), dtype=bool)
    valid[9000:9100] = False
    run = shaken_run(valid=valid)
    parts = quiet(run, [SHAKE], length=0.1, most=5)
    assert len(parts) == 5
    for part in parts:
        assert valid[part].all()
        assert not ((run.time[part] >= 2.0) & (run.time[part] < 3.5)).any()
    assert quiet(run, [Block(0.0, 6.0, "impact")], length=0.1) == []


def test_an_origin_says_stage_lead_and_band():
    found = Origin(First("commanded", "measured", 0.003, lasting=True), (85.0, 130.0))
    assert found.stage == "`commanded`, 3.0 ms before `measured`"
    assert found.frequencies == "85-130 Hz"
    assert Origin(First("measured", "", 0.0, lasting=False), (20.0, 20.0)).stage == "`measured`"
    assert Origin(None, None).stage == Origin(None, None).frequencies == ""


def test_every_failure_has_an_origin_and_what_is_ok_has_none():
    run = shaken_run(blocks=(Block(0.5, 1.5, "ok"), SHAKE))
    known = origins(run, ())
    assert list(known) == [SHAKE]
    assert known[SHAKE].first.stage == "measured"
    assert origins(shaken_run(blocks=()), ()) == {}


def test_findings_are_traced_to_what_a_view_of_their_run_says():
    library = load_library(model_files())
    verdict = judge(demo_run(), library, localise=True)
    assert verdict.events
    seen = analyse_file(demo_run(), library, links=False)
    assert verdict.events == seen.findings
    assert verdict.localisations == {event: seen.localisations[event] for event in seen.findings}


def test_the_report_says_stage_and_band_of_each_failure(tmp_path):
    analysis = inspected(shaken_run(), tmp_path)
    assert "| class | from [s] | to [s] | shows first in | by joints | band |" in report(analysis)
    low, high = analysis.localisations[SHAKE].band
    assert (
        f"| oscillations | 2.00 | 3.50 | `measured` | knee 100% | {low:.0f}-{high:.0f} Hz |"
        in report(analysis)
    )
    assert sentence(analysis, SHAKE).startswith(
        f"oscillations, 2.00 s to 3.50 s: first in `measured` by knee 100%; {low:.0f}-{high:.0f} Hz"
    )
    assert "No stages" not in report(analysis)


def test_a_run_without_desired_velocities_says_once_that_it_has_no_stages(tmp_path):
    blocks = (SHAKE, Block(4.0, 4.2, "impact"))
    analysis = inspected(shaken_run(velocity_desired=None, blocks=blocks), tmp_path)
    assert all(known.first is None for known in analysis.localisations.values())
    assert report(analysis).count("No stages") == 1
    (annotated,) = tables(analysis)
    assert annotated.note.startswith("No stages")


def test_the_page_has_the_same_columns_without_marks(tmp_path):
    (annotated,) = tables(inspected(shaken_run(), tmp_path))
    assert annotated.head[3:6] == ("shows first in", "by joints", "band")
    assert annotated.rows[0][3] == "measured"
