import re
from dataclasses import replace

import numpy as np
import pytest
from commandline import printed
from generalmodel import fixed

from inspector.library import CannotTellError, label_run, load_library, model_files
from noiseclassifier.signals import JOINTS, MOTION
from noisemodel import Run

LIBRARY = load_library(model_files())


def of_panda():
    """Models of 1 kHz that know a Panda."""
    return {"noise": fixed(), "norms": fixed(MOTION), "joints": fixed((*MOTION, *JOINTS))}


def run_of(velocity, rate):
    names = tuple(f"joint{i}" for i in range(velocity.shape[1]))
    time = np.arange(len(velocity)) / rate
    return Run(time=time, velocity=velocity, velocity_desired=velocity, joint_names=names)


@pytest.mark.parametrize("rate", [1000.0, 10_000.0])
def test_standstill_uniform_and_smooth_motion_without_sensor_noise_have_no_findings(rate):
    time = np.arange(int(4 * rate)) / rate
    smooth = np.sin(2 * np.pi * 0.3 * np.outer(time, np.linspace(0.5, 1, 7)))
    for velocity in (0 * smooth, 0 * smooth + 0.3, smooth):
        assert label_run(run_of(velocity, rate), LIBRARY).labels.events() == ()


def test_a_faster_run_is_decimated_and_a_slower_one_is_not_classified():
    labelled = label_run(run_of(np.zeros((20_000, 1)), 5000.0), of_panda())
    assert (
        labelled.remark
        == "Labelled at 1000 Hz, the rate of model noise: nothing above 500 Hz is left."
    )
    with pytest.raises(CannotTellError, match="500 Hz"):
        label_run(run_of(np.zeros((2000, 1)), 500.0), of_panda())
    labelled = label_run(run_of(np.zeros((20_000, 1)), 20_000.0), LIBRARY)
    assert labelled.remark == (
        "Labelled at 10000 Hz, the rate of model general: nothing above 5000 Hz is left."
    )
    with pytest.raises(CannotTellError, match="79 Hz"):
        label_run(run_of(np.zeros((2000, 1)), 79.0), LIBRARY)


def test_the_model_with_most_of_the_signals_of_a_run_is_taken():
    generator = np.random.default_rng(0)
    noisy = 0.1 + 1e-3 * generator.normal(size=(3000, 3))
    assert label_run(run_of(noisy, 1000.0), of_panda()).model == "noise"  # desired is measured
    time, names = np.arange(3000) / 1000.0, ("a", "b", "c")
    followed = Run(time=time, velocity=noisy, velocity_desired=0 * noisy + 0.1, joint_names=names)
    assert label_run(followed, of_panda()).model == "joints"
    alone = {name: of_panda()[name] for name in ("noise", "norms")}
    assert label_run(followed, alone).model == "norms"
    apart = replace(followed, desired_joint_names=("tool", "wrist", "base"))
    assert label_run(apart, of_panda()).model == "noise"  # no joint that is both
    measured = Run(time=time, velocity=noisy, joint_names=names)
    assert label_run(measured, of_panda()).model == "noise"
    with pytest.raises(CannotTellError, match="no signal desired, error; there is noise, measured"):
        label_run(measured, {"norms": of_panda()["norms"]})


def test_a_run_out_of_distribution_is_never_ok_and_its_frames_are_counted():
    generator = np.random.default_rng(0)
    odd = 1e4 * generator.normal(size=(6000, 3))
    names = ("a", "b", "c")
    run = Run(
        time=np.arange(6000) / 1000.0, velocity=odd, velocity_desired=0 * odd, joint_names=names
    )
    whole = label_run(run, LIBRARY)
    assert "ok" not in whole.labels.label
    assert whole.labels.novel.all()
    count = len(whole.labels)
    remark = f"{count} of {count} frames are out of distribution for model general."
    assert whole.remark == remark
    known = np.where(run.time[:, None] < 3.0, odd, 0.1 + 1e-7 * odd)
    labelled = label_run(replace(run, velocity=known, velocity_desired=0 * odd + 0.1), LIBRARY)
    assert "frames are out of distribution for model general" in labelled.remark
    assert set(labelled.labels.label[~labelled.labels.novel]) == {"ok"}


@pytest.mark.parametrize("rate", [91.0, 1000.0, 5000.0])
@pytest.mark.parametrize("samples", [2, 0.3])
def test_a_run_too_short_for_a_frame_is_no_bad_input(tmp_path, rate, samples):
    velocity = np.ones((samples if samples == 2 else int(samples * rate), 2))
    run_of(velocity, rate).save(tmp_path / "short.npz")
    run_of(np.zeros((5000, 2)), 1000.0).save(tmp_path / "standing.npz")
    out = printed("classify", tmp_path / "short.npz", tmp_path / "standing.npz", status=4)
    assert re.search("short.npz +cannot tell", out)
    assert "too short" in out
    printed("view", tmp_path / "short.npz", "-o", tmp_path / "report.html")
