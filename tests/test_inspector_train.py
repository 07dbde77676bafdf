"""Training on many logs: those that a profile cannot be trained on are left out, and counted."""

import json

import numpy as np
import pytest
from commandline import call, printed, refused

import noiseclassifier as nc


def log(path, *, rate=1000.0, desired="planned", seed=0):
    """Two joints that follow a sine, and vibrate in the second half of four seconds."""
    time = np.arange(round(4 * rate)) / rate
    planned = np.stack([np.sin(2 * np.pi * 0.5 * time), np.cos(2 * np.pi * 0.5 * time)], axis=1)
    noise = 1e-3 * np.random.default_rng(seed).normal(size=planned.shape)
    velocity = planned + noise
    velocity[len(time) // 2 :, 0] += 0.5 * np.sin(2 * np.pi * 60 * time[len(time) // 2 :])
    columns = {"planned": planned, "zero": np.zeros_like(planned), "measured": velocity}
    given = {} if desired == "missing" else {"velocity_desired": columns[desired]}
    given |= {"block_start": [0, 2], "block_stop": [2, 4], "block_label": ["ok", "oscillations"]}
    np.savez(path, time=time, velocity=velocity, **given)
    return path


def train(*inputs, output, profile="logbands"):
    return call("train", *inputs, "-o", output, "--profile", profile, "--rate", 1000)


def test_logs_that_a_profile_cannot_be_trained_on_are_left_out_and_counted(tmp_path):
    (tmp_path / "logs").mkdir()
    for seed in range(2):
        log(tmp_path / "logs" / f"good{seed}.npz", seed=seed)
    log(tmp_path / "logs" / "slow.npz", rate=500.0)
    time = np.arange(1000) / 1000
    np.savez(tmp_path / "logs" / "bare.npz", time=time, velocity=np.sin(time)[:, None])
    status, out, err = train(tmp_path / "logs", output=tmp_path / "m.npz")
    assert (status, err) == (0, "")
    counts = "left out: 1 run without annotated blocks, 1 below 1000 Hz, e.g. bare"
    assert f"\n{counts}\n" in out
    assert "Subset accuracy" in out
    assert set(nc.load(tmp_path / "m.npz").runs) == {"good0", "good1"}
    alone = log(tmp_path / "missing.npz", desired="missing")  # the noise can be trained on
    status, out, _ = train(alone, output=tmp_path / "alone.npz")
    assert (status, "no run was left out" in out) == (0, True)


def test_nothing_left_to_train_on_is_one_line(tmp_path):
    path = log(tmp_path / "run.npz", rate=500.0)
    status, _, err = train(path, output=tmp_path / "m.npz")
    assert status == 3
    assert err.endswith("no run to train logbands on; left out: 1 run below 1000 Hz, e.g. run\n")
    assert err.count("\n") == 1


@pytest.mark.slow
def test_a_model_for_any_rate_is_trained_and_evaluated_on_logs_of_several_rates(tmp_path):
    logs, model = tmp_path / "logs", tmp_path / "m.npz"
    logs.mkdir()
    for seed, rate in enumerate((100.0, 125.0, 500.0, 50.0)):
        log(logs / f"log{rate:g}.npz", rate=rate, seed=seed)
    log(logs / "missing.npz", rate=250.0, desired="missing", seed=9)
    err = refused("train", logs, "-o", model, "--rate", 500, status=2)
    assert err == "inspector: profile general is for any rate; leave out --rate 500\n"
    assert "left out: 1 run below 80 Hz, e.g. log50" in printed("train", logs, "-o", model)
    assert set(nc.load(model).runs) == {"log100", "log125", "log500", "missing"}
    counts = np.sum(nc.load(model).metrics["training"]["confusion"], axis=1)
    assert counts[0] > 0.7 * counts[-1]  # of a few logs, all `ok` frames, as many as failures
    log(tmp_path / "new.npz", rate=200.0, seed=20)
    status, out, _ = call("evaluate", model, tmp_path / "new.npz", "--json")
    assert (status, json.loads(out)["runs"]) == (0, 1)
