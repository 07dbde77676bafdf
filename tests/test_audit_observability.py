from dataclasses import replace

import numpy as np
import pytest
from generalmodel import fixed
from scipy.signal import butter, sosfilt
from test_audit_bandwidth import motion, noise, run_of

from inspector.audit import OSCILLATIONS, Observability, audit, band_edges, shortcomings, summary
from inspector.library import CannotTellError, demo_run, label_run, load_library, model_files
from inspector.verdict import Status, classify_file, exit_status
from noiseclassifier import Profile
from noiseclassifier.signals import MOTION
from noisemodel import Run, decimated

LIBRARY = load_library(model_files())
FAILURES = ("impact", "highaccelerations", "oscillations")


def of_one_rate():
    return {"slow": fixed(), "fast": fixed(rate=10_000.0)}


def noisy_run(rate, seconds=6.0, **signals):
    _, _, velocity = motion(rate, seconds)
    return run_of(velocity + noise(velocity.shape), rate, **signals)


def classes_of(run, library=LIBRARY):
    return {each.label: each for each in audit(run, library).classes}


def test_a_log_of_10_khz_shows_all_classes():
    found = classes_of(noisy_run(10_000.0))
    assert tuple(found) == FAILURES
    assert {each.observability for each in found.values()} == {Observability.OBSERVABLE}
    assert (found["oscillations"].low, found["oscillations"].high) == OSCILLATIONS
    assert shortcomings(audit(noisy_run(10_000.0), LIBRARY)) == ()


@pytest.mark.parametrize("rate", [1000.0, 1250.0, 2000.0, 5000.0])
def test_what_lies_outside_of_the_models_bands_is_not_observable(rate):
    found = classes_of(noisy_run(rate), of_one_rate())
    assert found["impact"].observability is Observability.OBSERVABLE
    oscillations = found["oscillations"]
    top = band_edges(of_one_rate()["slow"].profile)[-1]
    assert (oscillations.observability, oscillations.high) == (Observability.PARTLY, top)
    assert oscillations.needed == 10_000.0
    assert oscillations.reason == "the model of 1000 Hz ends there"


@pytest.mark.parametrize(
    ("rate", "library", "lowest"),
    [
        *((rate, of_one_rate, 1000.0) for rate in (30.0, 100.0, 500.0, 970.0)),
        *((rate, lambda: LIBRARY, 80.0) for rate in (30.0, 79.0)),
    ],
)
def test_below_every_model_nothing_is_observable(rate, library, lowest):
    found = audit(noisy_run(rate), library())
    assert not found.observable
    for each in found.classes:
        assert (each.observability, each.needed) == (Observability.CANNOT_TELL, lowest)
        assert each.reason == f"{rate:g} Hz is below the rate of every model"


def test_a_run_that_lacks_the_signals_of_all_models_shows_nothing_and_the_reason_is_given():
    alone = {"norms": fixed(MOTION)}
    found = audit(noisy_run(1000.0), alone)
    assert not found.observable
    reason = "no signal desired, error; there is noise, measured, measured_joints"
    assert {(each.needed, each.reason) for each in found.classes} == {(None, reason)}


def test_without_the_faster_model_twice_the_frequency_is_required():
    slow = {"slow": of_one_rate()["slow"]}
    assert classes_of(noisy_run(1000.0), slow)["oscillations"].needed == 2 * OSCILLATIONS[1]
    assert audit(noisy_run(1000.0), {}).classes == ()


def test_the_bands_are_those_of_the_profile():
    edges = band_edges(Profile.paper())
    assert edges[0] == pytest.approx(9.8, abs=0.1)  # the paper's f_min, Sec. III-A
    assert edges[-1] == pytest.approx(5000, abs=20)
    profile = of_one_rate()["fast"].profile
    assert tuple(band_edges(profile)) == profile.edges


@pytest.mark.parametrize(("cutoff", "degree"), [*zip((None, 100, 15), Observability, strict=True)])
def test_a_filter_limits_observability(cutoff, degree):
    velocity = noise((8000, 3), level=0.001)
    if cutoff:
        sections = butter(4, cutoff, fs=1000, output="sos")
        velocity = sosfilt(sections, velocity, axis=0)
    found = classes_of(run_of(velocity, 1000.0))
    assert found["impact"].observability is degree
    if degree is Observability.PARTLY:
        assert found["impact"].high == pytest.approx(100, rel=0.2)
        assert found["impact"].needed is None  # a higher rate would not help
        assert found["impact"].reason == "the log looks filtered"


def test_a_zero_order_hold_limits_observability_to_the_rate_of_its_values():
    _, _, velocity = motion(1000.0)
    noisy = velocity + noise(velocity.shape)
    for length, degree in ((4, Observability.PARTLY), (33, Observability.CANNOT_TELL)):
        held = run_of(np.repeat(noisy[::length], length, axis=0)[: len(noisy)], 1000.0)
        oscillations = classes_of(held, of_one_rate())["oscillations"]
        assert oscillations.observability is degree
        assert f"hold of {length} samples" in oscillations.reason


def test_with_quantisation_loud_failures_stay_observable():
    _, _, velocity = motion(10_000.0)
    found = classes_of(run_of(np.round(velocity / 0.01) * 0.01, 10_000.0))
    assert found["impact"].observability is Observability.PARTLY
    assert "quantisation masks amplitudes below" in found["impact"].reason


def test_a_frame_requires_a_stretch_without_a_gap():
    run = noisy_run(1000.0)
    gaps = np.ones(len(run.time), dtype=bool)
    gaps[::600] = False  # what lasts takes 600 samples
    for joined in (True, False):
        gaps[600] = joined
        broken = run_of(run.velocity * gaps[:, None], 1000.0, valid=gaps.copy())
        assert audit(broken, LIBRARY).observable == joined
    assert "no stretch of 0.6 s without a gap" in summary(audit(broken, LIBRARY))[0]
    with pytest.raises(CannotTellError, match="no stretch of 0.6 s without a gap"):
        label_run(broken, LIBRARY)


def test_warnings_end_with_a_full_stop_or_the_mark_of_their_question():
    found = audit(noisy_run(1000.0), LIBRARY)
    for warnings, line in ((("a", "b"), "Warnings: a; b."), (("a", "b?"), "Warnings: a; b?")):
        assert summary(replace(found, warnings=warnings), classes=False) == (line,)


def test_a_run_without_findings_in_which_nothing_is_observable_is_not_ok(tmp_path):
    still = noise((8000, 3), level=0.0005)
    sections = butter(4, 15.0, fs=1000, output="sos")
    run = run_of(sosfilt(sections, still, axis=0), 1000.0)
    run.save(tmp_path / "filtered.npz")
    verdict = classify_file(tmp_path / "filtered.npz", LIBRARY)
    assert label_run(run, LIBRARY).labels.events() == ()
    assert verdict.status is Status.CANNOT_TELL
    assert exit_status([verdict]) == 4
    assert "cannot be observed (the log looks filtered)" in verdict.message


def test_one_class_that_is_partly_observable_is_a_remark(tmp_path):
    zeros = np.zeros((6000, 2))
    run_of(zeros, 1000.0).save(tmp_path / "still.npz")
    verdict = classify_file(tmp_path / "still.npz", of_one_rate())
    assert verdict.status is Status.OK
    assert verdict.message == (
        "Nothing stands out, within the run or for any robot."
        " No desired velocity: tracking errors were not judged."
        " Oscillations above 440 Hz cannot be seen"
        " (the model of 1000 Hz ends there; all of it requires 10000 Hz)."
    )


def test_simulated_runs_have_no_warnings_at_any_rate():
    run = Run.load(demo_run())
    for rate in (10_000.0, 5000.0, 1000.0):
        found = audit(decimated(run, rate), LIBRARY)
        assert found.warnings == ()
        assert found.bandwidth.usable == rate / 2


def test_the_order_of_joints_does_not_matter():
    run = Run.load(demo_run())
    turned, plain = (run_of(run.velocity[:, ::step], run.rate) for step in (-1, 1))
    assert audit(turned, LIBRARY).classes == audit(plain, LIBRARY).classes


@pytest.mark.parametrize(
    ("meta", "jitter"),
    [
        ({"jitter": {"rms": 1e-4, "max": 2e-3}}, (1e-4, 2e-3)),
        *(({"jitter": each}, None) for each in (3, {"rms": "x"})),
        ({"differentiated": 7}, None),
    ],
)
def test_jitter_in_meta_is_reported_and_unknown_values_are_ignored(meta, jitter):
    assert audit(noisy_run(1000.0, meta=meta), LIBRARY).jitter == jitter
