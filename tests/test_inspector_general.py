"""Runs of any rate, labelled by a general model: what could not be seen, and held values."""

from dataclasses import replace

import numpy as np
import pytest
from generalmodel import RATES, fixed, run_at, trained
from scipy.signal import butter, sosfilt

import noiseclassifier as nc
import noisemodel as nm
from inspector.analysis import analyse
from inspector.audit import Observability, audit
from inspector.errors import Status
from inspector.library import CannotTellError, label_run, signals_of
from inspector.logs.clocks import without_hold
from inspector.report import report
from inspector.training import classified


def library():
    """A model of any rate."""
    return {"general": trained()}


def of_one_rate():
    return {"fixed": fixed()}


def held(run, count, lead=0):
    """Each sample ``count`` times; ``lead`` samples of another hold come first."""
    places = np.repeat(np.arange(len(run.time)), count)[count - lead if lead else 0 :]
    names = ("velocity", "velocity_desired", "valid")
    fields = {name: getattr(run, name)[places] for name in names}
    return replace(run, time=np.arange(len(places)) / (run.rate * count), blocks=(), **fields)


@pytest.mark.parametrize(
    ("rate", "edge"), [(80.0, 35), (125.0, 55), (250.0, 110), (1000.0, 440), (2000.0, 880)]
)
def test_a_verdict_says_which_oscillations_cannot_be_seen(rate, edge):
    found = analyse(run_at(rate), library())
    sentence = f"At {rate:g} Hz, oscillations above {edge} Hz cannot be seen."
    assert found.model == "general"
    assert found.message.count(sentence) == 1
    assert found.remarks.count(sentence) == 1
    assert sum("cannot be seen" in remark for remark in found.remarks) == 1
    assert "can show" not in found.message
    assert report(found).count(sentence) == 1


def test_at_5_khz_every_class_can_be_seen():
    found = analyse(run_at(5000.0, seconds=2.0), library())
    assert "cannot be seen" not in found.message
    assert "The log can show impact and oscillations." in found.remarks
    assert {each.needed for each in found.audit.classes} == {None}


@pytest.mark.parametrize("rate", [80.0, 1000.0])
def test_the_rate_that_is_needed_shows_all_oscillations(rate):
    oscillations = audit(run_at(rate), library()).classes[-1]
    assert oscillations.observability is Observability.PARTLY
    assert oscillations.reason == f"half the rate of {rate:g} Hz"
    enough = audit(run_at(oscillations.needed, seconds=2.0), library()).classes[-1]
    assert enough.observability is Observability.OBSERVABLE
    fewer = audit(run_at(oscillations.needed - 2.0, seconds=2.0), library()).classes[-1]
    assert fewer.observability is Observability.PARTLY


@pytest.mark.parametrize("rate", [20.0, 79.0])
def test_below_80_hz_there_is_no_verdict_and_the_rate_that_is_needed_is_told_once(rate):
    for run, hold in (
        (run_at(rate, seconds=8.0), ""),
        (held(run_at(rate, seconds=8.0), 25), "measured values are held: "),
    ):
        found = analyse(run, library())
        assert found.status is Status.CANNOT_TELL
        told = f"{hold}logged at {rate:g} Hz, the model needs 80 Hz or more"
        assert found.message.startswith(told)
        assert sum("80 Hz" in remark for remark in found.remarks) == 1
        assert {each.needed for each in found.audit.classes} == {80.0}


def test_a_filter_or_differentiation_ends_what_can_be_seen_earlier():
    run = run_at(1000.0, seconds=10.0)
    sections = butter(4, 100, fs=1000, output="sos")
    noise = np.random.default_rng(0).normal(0, 0.01, run.velocity.shape)
    slow = replace(run, velocity=run.velocity_desired + sosfilt(sections, noise, axis=0))
    (line,) = (each for each in analyse(slow, library()).remarks if "cannot be seen" in each)
    high = audit(slow, library()).classes[0].high
    assert line == (
        f"Impact and oscillations above {high:.4g} Hz cannot be seen (the log looks filtered)."
    )
    assert high == pytest.approx(100, rel=0.2)
    run = run_at(1000.0)
    position = np.cumsum(run.velocity, axis=0) / 1000.0
    central = np.gradient(position, 1e-3, axis=0)
    log = replace(run, velocity=central, position=position, velocity_desired=None)
    (line,) = (each for each in analyse(log, library()).remarks if "cannot be seen" in each)
    assert "(velocities were differentiated)" in line


@pytest.mark.parametrize(("count", "lead"), [(2, 0), (4, 0), (4, 3), (8, 1)])
@pytest.mark.parametrize("rate", RATES)
def test_a_held_log_has_the_labels_of_the_log_that_was_not_held(rate, count, lead):
    plain = run_at(rate, "oscillations")
    log = held(plain, count, lead)
    ours, theirs = label_run(log, library()), label_run(plain, library())
    # Samples of a hold before the first whole one have no time of their own.
    skip = 1 if lead else 0
    if lead:
        theirs = label_run(plain.cut(plain.time[1] - 1e-6, np.inf), library())
    assert ours.remark.split(".")[0] == f"Labelled at {rate:g} Hz, the rate of its values"
    np.testing.assert_array_equal(ours.labels.label, theirs.labels.label)
    np.testing.assert_array_equal(ours.labels.scores, theirs.labels.scores)
    offset = lead / log.rate - skip / rate
    np.testing.assert_allclose(ours.labels.start, theirs.labels.start + offset, atol=1e-9)


def test_a_held_log_says_what_the_log_that_was_not_held_says():
    plain = run_at(125.0)
    found = analyse(held(plain, 8), library())
    evidence = "Nothing stands out, within the run or for any robot."
    limit = "At 125 Hz, oscillations above 55 Hz cannot be seen."
    assert analyse(plain, library()).message == f"{evidence} {limit}"
    assert found.message == (
        f"{evidence} Labelled at 125 Hz, the rate of its values. {limit} Warnings: measured values"
        " have a zero-order hold of 8 samples: they come at 125 Hz."
    )


def test_held_positions_alone_are_labelled_as_those_that_were_not_held(tmp_path):
    found = []
    for rate, places in ((1000.0, np.arange(5000) // 4), (250.0, np.arange(1250))):
        position = np.cumsum(run_at(250.0, "oscillations").velocity, axis=0) / 250.0
        time = np.arange(len(places)) / rate
        np.savez(tmp_path / "run.npz", time=time, position=position[places])
        found.append(analyse(tmp_path / "run.npz", library()))
    ours, theirs = found
    np.testing.assert_array_equal(without_hold(ours.run).velocity, theirs.run.velocity)
    assert ours.status == theirs.status
    assert ours.audit.bandwidth.usable == pytest.approx(theirs.audit.bandwidth.usable)


def test_a_finding_of_held_values_is_that_of_the_log_that_was_not_held():
    plain = run_at(125.0, "oscillations")
    ours, theirs = (analyse(each, library()) for each in (held(plain, 4), plain))
    assert theirs.findings
    assert ours.findings == theirs.findings
    assert ours.localisations == theirs.localisations


def test_a_model_of_one_rate_labels_a_held_log_at_that_rate():
    log = held(run_at(250.0), 4)
    labelled = label_run(log, of_one_rate())
    whole = fixed().classify(signals_of(log), 1000.0)
    np.testing.assert_array_equal(labelled.labels.scores, whole.scores)
    assert "Labelled" not in labelled.remark
    plain = run_at(1000.0)
    ours, theirs = label_run(held(plain, 4), of_one_rate()), label_run(plain, of_one_rate())
    np.testing.assert_array_equal(ours.labels.scores, theirs.labels.scores)
    with pytest.raises(CannotTellError, match="measured values are held: logged at 500 Hz"):
        label_run(held(run_at(100.0), 5), of_one_rate())


def test_only_values_that_are_there_equally_often_are_taken_once():
    run = run_at(1000.0)
    assert without_hold(run) is run
    assert without_hold(replace(run, velocity=np.round(run.velocity, 2))).rate == 1000.0
    places = np.arange(5000) * 3 // 10  # a hold of 3 1/3 samples
    fractional = replace(run, velocity=run.velocity[places])
    assert without_hold(fractional) is fractional
    shifted = held(run_at(250.0), 4)
    moved = np.concatenate((np.arange(1001), np.arange(1000, len(shifted.time) - 1)))
    apart = replace(shifted, velocity=shifted.velocity[moved])  # by a sample, after a second
    assert without_hold(apart) is apart


def test_a_run_without_its_hold_keeps_all_that_it_has_and_its_gaps():
    blocks = (nm.Block(0.5, 1.0, "ok"),)
    base = np.arange(5000.0)[:, None] * np.ones(6)
    log = held(run_at(250.0), 4)
    log = replace(log, blocks=blocks, base_velocity=base, stages={"sent": log.velocity})
    found = without_hold(log)
    assert (found.rate, found.blocks, found.joint_names) == (250.0, blocks, ("a", "b", "c"))
    np.testing.assert_array_equal(found.base_velocity, base[::4])
    np.testing.assert_array_equal(found.stages["sent"], found.velocity)
    np.testing.assert_array_equal(found.velocity, run_at(250.0).velocity)
    plain, valid = run_at(250.0), np.ones(1250, dtype=bool)
    valid[300:400] = False
    gaps = replace(plain, velocity=plain.velocity * valid[:, None], valid=valid)
    np.testing.assert_array_equal(without_hold(held(gaps, 4)).mask, valid)


def test_evaluation_takes_held_logs_as_classify_does(tmp_path):
    block = nm.Block(0.0, 5.0, "ok")
    plain = replace(run_at(250.0), blocks=(block,))
    replace(held(plain, 4), blocks=(block,)).save(tmp_path / "held.npz")
    ((ours, run),) = classified([tmp_path / "held.npz"], None)
    assert (ours.rate, run.rate) == (250.0, 1000.0)
    np.testing.assert_array_equal(ours.signal["measured"], signals_of(plain)["measured"])
    ((ours, _),) = classified([tmp_path / "held.npz"], 1000.0)
    assert ours.rate == 1000.0
    replace(held(run_at(40.0), 25), blocks=(block,)).save(tmp_path / "slow.npz")
    ((slow, _),) = classified([tmp_path / "slow.npz"], None)
    assert isinstance(slow, nc.Unanswered)
    assert slow.reason == "rate 40 Hz < 80 Hz"
