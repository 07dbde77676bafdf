"""A tiny general model, trained in a second, and logs of three joints at any rate."""

import json
from dataclasses import replace
from functools import cache

import numpy as np

import noiseclassifier as nc
import noisemodel as nm
from noiseclassifier.signals import JOINTS, MOTION, NOISE

RECIPE = replace(nc.ANY, rounds=8, leaves=4)
RATES = (80.0, 125.0, 500.0, 1000.0)
SECONDS = 5.0


def relative(names=(NOISE,), rate=1000.0):
    """A profile of one rate, relative to the level of a frame as models of earlier versions are."""
    recipe = nc.LogBands(
        floor=1e-3, quick=0.02, speed=True, estimator="detector", alarm=0.6, rounds=8, leaves=4
    )
    return replace(recipe.at(rate), signals=names, relative=True)


def signals(rate, label="ok", seed=0, names=(*MOTION, *JOINTS), seconds=SECONDS):
    """Three joints that follow a motion; a failure shakes the second one."""
    random = np.random.default_rng([seed, len(label)])
    time = np.arange(round(seconds * rate)) / rate
    phase = random.uniform(0, 6, (3, 1))
    desired = np.array([[0.9], [0.3], [0.1]]) * np.sin(2 * np.pi * 0.5 * time + phase)
    error = 0.01 * random.normal(size=desired.shape)
    if label == "oscillations":
        error[1] += 0.3 * np.sin(2 * np.pi * 27 * time)
    if label == "impact":
        error[1] += np.exp(-np.mod(time, 0.4) / 0.02) * random.normal(size=len(time))
    joints = dict(zip(JOINTS, (desired, desired + error, error), strict=True))
    norms = {name: np.linalg.norm(joints[f"{name}_joints"], axis=0) for name in MOTION}
    every = {**norms, **joints, NOISE: np.hypot(norms["measured"], norms["desired"])}
    return {name: every[name] for name in names}


def run_at(rate, label="ok", seed=3, seconds=5.0, **changes):
    """Three joints that follow a motion; a failure shakes the second one."""
    found = signals(rate, label, seed, seconds=seconds)
    desired, measured = (
        np.ascontiguousarray(found[f"{name}_joints"].T) for name in ("desired", "measured")
    )
    fields = {"velocity": measured, "velocity_desired": desired, "joint_names": ("a", "b", "c")}
    return nm.Run(time=np.arange(len(measured)) / rate, **(fields | changes))


def recording(rate, label, seed, names=(*MOTION, *JOINTS)):
    blocks = (nc.Block(0.0, SECONDS, label),)
    found = signals(rate, label, seed, names)
    return nc.Recording(f"panda/{label}-{rate:g}-{seed:03d}", found, rate, blocks)


@cache
def frames(recipe=RECIPE):
    recordings = [
        recording(rate, label, seed)
        for rate in RATES
        for seed in range(2)
        for label in ("ok", "impact", "oscillations")
    ]
    return nc.Dataset.joined(nc.frames_of(recordings, recipe))


@cache
def trained():
    return nc.General.train(frames(), RECIPE)


@cache
def fixed(names=(NOISE,), rate=1000.0):
    """A model of one rate trained on a Panda, by the noise alone unless told."""
    profile = relative(names, rate)
    recordings = [
        recording(rate, label, seed, names)
        for seed in range(2)
        for label in ("ok", "impact", "oscillations")
    ]
    still = {name: np.zeros_like(each) for name, each in recordings[0].signal.items()}
    recordings.append(replace(recordings[0], name="panda/still-009", signal=still))
    return nc.Classifier.train(nc.Dataset.of(recordings, profile), profile)


def rewrite(path, manifest=(), /, **changes):
    """Write a model file anew, with changes of its manifest and arrays; None leaves one out."""
    with np.load(path, allow_pickle=False) as members:
        arrays = dict(members) | changes
    if manifest:
        whole = json.loads(str(arrays["manifest"])) | dict(manifest)
        kept = {name: value for name, value in whole.items() if value is not None}
        arrays["manifest"] = np.array(json.dumps(kept))
    kept = {name: array for name, array in arrays.items() if array is not None}
    np.savez(path, allow_pickle=True, **kept)
