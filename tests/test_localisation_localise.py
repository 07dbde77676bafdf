import dataclasses

import numpy as np
import pytest

from inspector.analysis import analyse_file
from inspector.library import demo_run, load_library, model_files
from inspector.localisation import Localisation, band, localise, quiet_stretches
from inspector.report import report, words
from inspector.verdict import Finding, classify_file
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


@pytest.mark.parametrize("hertz", [79, 80, 81, 82, 83, 84, 88, 98])
def test_the_band_of_a_tone_holds_its_frequency_and_so_do_its_words(hertz):
    low, high = band(shaken_run(hertz, hertz), SHAKE, [SHAKE])
    assert low <= hertz <= high <= low + 2.6
    told = words(Localisation("measured", band=(low, high)))[2].removesuffix(" Hz").split("-")
    assert float(told[0]) <= low
    assert high <= float(told[-1])


def test_a_hum_throughout_the_run_is_no_failure():
    quiet_block = Block(4.5, 5.5, "impact")
    found = band(shaken_run(300, 320), quiet_block, [SHAKE, quiet_block])
    assert found is None or not found[0] <= 30 <= found[1] or found[1] - found[0] > 5


def test_a_blow_shorter_than_a_window_has_a_band_and_a_failure_in_a_gap_none():
    short = Block(3.0, 3.01, "impact")
    assert band(shaken_run(), short, [short, SHAKE]) is not None
    valid = np.ones(round(RATE * SECONDS), dtype=bool)
    valid[3900:7100] = False
    assert band(shaken_run(valid=valid), SHAKE, [SHAKE]) is None


def test_quiet_stretches_keep_clear_of_failures_and_gaps():
    valid = np.ones(round(RATE * SECONDS), dtype=bool)
    valid[9000:9100] = False
    run = shaken_run(valid=valid)
    parts = quiet_stretches(run, [SHAKE], length=0.1, most=5)
    assert len(parts) == 5
    for part in parts:
        assert valid[part].all()
        assert not ((run.time[part] >= 2.0) & (run.time[part] < 3.5)).any()
    assert quiet_stretches(run, [Block(0.0, 6.0, "impact")], length=0.1) == []


def test_a_run_of_measured_velocities_alone_names_the_joint_but_no_stage():
    alone = shaken_run(velocity_desired=None, desired_joint_names=())
    found = localise(alone, [SHAKE])[SHAKE]
    assert (found.stage, found.following, found.joints[0][0]) == ("", "", "knee")


def test_the_words_for_a_localisation_are_stage_lead_joints_and_band():
    joints = (("knee", 0.8), ("hip", 0.04))
    found = Localisation("commanded", "measured", 0.003, joints=joints, band=(85.0, 130.0))
    assert words(found) == ("commanded, 3.0 ms before measured", "knee 80%", "85-130 Hz")
    slow = dataclasses.replace(found, lag=0.0123)
    assert words(slow)[0] == "commanded, 12.3 ms before measured"
    assert words(Localisation("measured", band=(20.0, 20.0))) == ("measured", "", "20 Hz")
    assert words(Localisation()) == ("", "", "")


def test_every_failure_is_localised_and_what_is_ok_is_not():
    run = shaken_run(blocks=(Block(0.5, 1.5, "ok"), SHAKE))
    known = localise(run, ())
    assert list(known) == [SHAKE]
    assert known[SHAKE].stage == "measured"
    assert localise(shaken_run(blocks=()), ()) == {}


def test_the_localisation_of_a_verdict_is_that_of_a_view_of_its_run():
    library = load_library(model_files())
    verdict = classify_file(demo_run(), library)
    assert verdict.events
    seen = analyse_file(demo_run(), library, links=False)
    known = [Finding.of(event, localisation=seen.localisations[event]) for event in seen.findings]
    assert list(verdict.events) == known


def test_the_report_states_stage_and_band_of_each_failure(tmp_path):
    analysis = inspected(shaken_run(), tmp_path)
    low, high = analysis.localisations[SHAKE].band
    assert (
        "- **oscillations**, 2.00 s to 3.50 s: joints knee 100%;"
        f" {low:.0f}-{high:.0f} Hz; first in measured\n" in report(analysis)
    )
    assert "No stages" not in report(analysis)


def test_a_run_without_desired_velocities_has_one_remark_on_missing_stages(tmp_path):
    blocks = (SHAKE, Block(4.0, 4.2, "impact"))
    analysis = inspected(shaken_run(velocity_desired=None, blocks=blocks), tmp_path)
    assert all(known.stage == "" for known in analysis.localisations.values())
    assert report(analysis).count("No stages") == 1
