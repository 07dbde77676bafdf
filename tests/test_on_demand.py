"""Runs whose arrays stay in their file: the same as in memory, in little memory."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import noiseclassifier as nc
from inspector.analysis import analyse
from inspector.library import load_library, signal_names, signals_of
from inspector.logs.read import open_run
from inspector.verdict import Verdict
from noisemodel import Run, RunError, RunFileError, decimated, runfile
from noisemodel.hold import hold_length
from noisemodel.run import pieces_of
from noisemodel.runfile import OnDemand

LIBRARY = load_library()
RATE = 1000.0


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Every signal stays in its file, and pieces are of some hundred samples."""
    monkeypatch.setattr(runfile, "LARGE", 0)
    monkeypatch.setattr(runfile, "AT_ONCE", 2**13)


def shaken(*, samples=4000, rate=RATE, joints=3, kind=np.float64, gap=True):
    """A run that moves, with a vibration in its middle, a gap and all that a run can have."""
    time = np.arange(samples) / rate
    phase = np.arange(joints)
    random = np.random.default_rng(1)
    position = np.sin(2 * np.pi * 0.3 * time[:, None] + phase)
    desired = 2 * np.pi * 0.3 * np.cos(2 * np.pi * 0.3 * time[:, None] + phase)
    velocity = desired + 1e-3 * random.standard_normal(desired.shape)
    during = (time > 1.5) & (time < 2.2)
    velocity[during, 1] += np.sin(2 * np.pi * 90.0 * time[during])
    signals = {"position": position, "velocity": velocity, "velocity_desired": desired}
    signals |= {"effort": 1.0 + random.standard_normal(desired.shape)}
    valid = np.ones(samples, dtype=bool)
    if gap:
        valid[3000:3100] = False
    signals = {name: (each * valid[:, None]).astype(kind) for name, each in signals.items()}
    names = tuple(f"j{number}" for number in range(joints))
    return Run(time=time, joint_names=names, valid=valid, **signals)


def arrays_of(run):
    names = ("time", "velocity", "position", "velocity_desired", "effort", "valid")
    return {name: getattr(run, name) for name in names} | {"joint_names": np.array(run.joint_names)}


def test_an_array_on_demand_computes_as_one_in_memory(tmp_path):
    run = shaken()
    base = np.random.default_rng(2).standard_normal((len(run.time), 6)) * run.mask[:, None]
    run = replace(run, base_velocity=base)
    run.save(tmp_path / "run.npz")
    found = Run.load(tmp_path / "run.npz", on_demand=True)
    ours, theirs = found.velocity, run.velocity
    assert isinstance(ours, OnDemand)
    assert (len(ours), ours.shape, ours.ndim) == (len(theirs), theirs.shape, theirs.ndim)
    assert (ours.size, ours.nbytes, ours.dtype) == (theirs.size, theirs.nbytes, theirs.dtype)
    np.testing.assert_array_equal(
        2 * ours - found.velocity_desired, 2 * theirs - run.velocity_desired
    )
    np.testing.assert_array_equal(np.abs(ours).max(axis=0), np.abs(theirs).max(axis=0))
    np.testing.assert_array_equal(ours.T, theirs.T)
    assert ours.astype(np.float32)[5:9].dtype == np.float32
    np.testing.assert_array_equal(np.asarray(ours.astype(np.float32)), theirs.astype(np.float32))
    assert found.motion.shape == (len(run.time), 6 + len(run.joint_names))
    np.testing.assert_array_equal(found.motion[1000:1010], run.motion[1000:1010])
    np.testing.assert_array_equal(np.asarray(found.motion), np.hstack((base, run.velocity)))


def findings(analysis):
    """All that an analysis says."""
    verdict = Verdict.of(Path("run"), analysis)
    labels = analysis.labels
    return (
        str(replace(verdict, seconds=0.0)),
        analysis.audit,
        analysis.remarks,
        labels is None or plain(labels),
    )


def plain(labels):
    """Fields of labels, to compare."""
    return {each.name: np.asarray(getattr(labels, each.name)).tolist() for each in fields(labels)}


@pytest.mark.parametrize(("rate", "kind"), [(RATE, np.float64), (4000.0, np.float32)])
def test_a_run_on_demand_has_the_labels_findings_and_audit_of_one_in_memory(tmp_path, kind, rate):
    path = tmp_path / "run.npz"
    run = shaken(rate=rate, samples=int(4 * rate), kind=kind)
    np.savez(path, **arrays_of(run))
    there = open_run(path).run
    assert isinstance(there.velocity, OnDemand)
    assert len(list(pieces_of(there))) > 4
    ours, theirs = analyse(there, LIBRARY), analyse(Run.load(path), LIBRARY)
    assert theirs.findings
    assert findings(ours) == findings(theirs)


def held(run, count):
    rows = np.arange(len(run.time)) // count * count
    names = ("velocity", "velocity_desired", "position")
    return replace(run, **{name: getattr(run, name)[rows] for name in names})


def without(name, run):
    arrays = arrays_of(run)
    del arrays[name]
    return arrays


VARIANTS = {
    "held": lambda: arrays_of(held(shaken(gap=False), 5)),
    "held positions": lambda: without("velocity", held(shaken(gap=False), 5)),
    "without velocities": lambda: without("velocity", shaken(gap=False)),
    "no desired motion": lambda: arrays_of(replace(shaken(), velocity_desired=np.zeros((4000, 3)))),
    "desired is measured": lambda: arrays_of(replace(shaken(), velocity_desired=shaken().velocity)),
    "faster than the model": lambda: without("effort", shaken(rate=12_500.0, samples=25_000)),
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_what_is_computed_before_labelling_is_the_same_on_demand(tmp_path, variant):
    """The rounding differs where pieces are filtered: by far less than any threshold."""
    path = tmp_path / "run.npz"
    np.savez(path, **VARIANTS[variant]())
    there, here = (Run.load(path, on_demand=each) for each in (True, False))
    np.testing.assert_allclose(np.asarray(there.velocity), here.velocity, atol=1e-9)
    assert hold_length(there.velocity, there.mask) == hold_length(here.velocity, here.mask)
    ours, theirs = analyse(there, LIBRARY), analyse(here, LIBRARY)
    assert isinstance(ours.run.velocity, OnDemand)
    assert (ours.status, ours.model, ours.remarks) == (theirs.status, theirs.model, theirs.remarks)
    assert theirs.labels is not None
    assert ours.labels.label.tolist() == theirs.labels.label.tolist()
    np.testing.assert_allclose(ours.labels.scores, theirs.labels.scores, atol=1e-6)
    assert [e.label for e in ours.findings] == [e.label for e in theirs.findings]
    for mine, other in zip(ours.findings, theirs.findings, strict=True):
        np.testing.assert_allclose((mine.start, mine.stop), (other.start, other.stop), atol=1e-9)


@pytest.mark.parametrize(("up", "down"), [(1, 3), (2, 5), (1, 25), (4, 5)])
def test_a_run_is_decimated_in_pieces_as_in_memory(tmp_path, up, down):
    run = shaken(samples=5003)
    run.save(tmp_path / "run.npz")
    there = Run.load(tmp_path / "run.npz", on_demand=True)
    ours, theirs = (decimated(each, RATE * up / down) for each in (there, run))
    assert isinstance(ours.velocity, OnDemand)
    np.testing.assert_allclose(np.asarray(ours.velocity), theirs.velocity, atol=1e-12)
    np.testing.assert_allclose(ours.velocity[77:91], theirs.velocity[77:91], atol=1e-12)


def test_a_signal_in_pieces_has_the_labels_of_the_whole_one_bit_for_bit():
    run = shaken()
    model = LIBRARY["general"].at(run.rate, signal_names(run))
    whole = model.classify(signals_of(run), run.rate, valid=run.mask)
    cut = ((signals_of(piece), piece.mask) for piece in pieces_of(run, samples=333))
    ours = model.classify_pieces(cut, run.rate)
    assert plain(ours) == plain(whole)


def test_a_file_that_changes_while_it_is_read_is_refused(tmp_path):
    path = tmp_path / "run.npz"
    shaken().save(path)
    run = Run.load(path, on_demand=True)
    shaken(samples=5000).save(path, overwrite=True)
    with pytest.raises(RunFileError, match="was changed while it was read"):
        analyse(run, LIBRARY)


def test_names_of_signals_are_those_of_the_signals():
    for run in (shaken(), replace(shaken(), velocity_desired=shaken().velocity)):
        assert set(signal_names(run)) == set(signals_of(run))
    assert "error" not in signal_names(replace(shaken(), velocity_desired=shaken().velocity))
    assert set(nc.signals.JOINTS) < set(signal_names(shaken()))


@pytest.mark.parametrize("row", [1, 7, 8, 9, 20, 39])
def test_a_step_that_is_uneven_is_named_wherever_pieces_of_the_time_begin(monkeypatch, row):
    monkeypatch.setattr(runfile, "AT_ONCE", 8 * 8)
    time = np.arange(40) / 10.0
    time[row:] += 0.05
    with pytest.raises(RunError, match=rf"not uniform, the step to row {row} is 0.15 s"):
        Run(time=time, velocity=np.zeros((40, 1)), joint_names=("a",))
