"""Wide domains are shown: order spectra, and the table, picture and sounds of a data set."""

import json
import sys
import wave
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from noiseclassifier.scenarios.dataset import Folder, Task
from noiseclassifier.scenarios.domains import DISTRIBUTION, Limits
from noisemodel import Block, Run

RATE = 2000.0
PNG = b"\x89PNG"


@pytest.fixture
def orders(monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).parents[1])
    from benchmarks import orders

    return orders


@pytest.fixture
def domains(monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).parents[1])
    from benchmarks import domains

    monkeypatch.setattr(domains, "home", lambda: run_with("good"))
    return domains


def swinging(share, gear):
    """Velocity of a joint that swings ever faster, with ripple by its speed."""
    time = np.arange(round(10 * RATE)) / RATE
    angle = 0.4 * (1 - np.cos(2 * np.pi * (0.1 * time + 0.02 * time**2)))
    speed = np.gradient(angle, 1 / RATE)
    return speed + share * speed * np.cos(gear * angle)


def test_ripple_at_order_100_peaks_at_100_whatever_the_speed(orders):
    spectra = orders.order_spectra(swinging(0.01, 100.0), rate=RATE)
    mean = np.sqrt(np.square(spectra).mean(axis=0))
    shown = orders.ORDERS > 60
    peak = np.argmax(np.where(shown, mean, 0.0))
    assert orders.ORDERS[peak] == pytest.approx(100.0, abs=8.0)
    assert mean[peak] > 5 * np.median(mean[shown])


def test_an_order_has_the_amplitude_of_its_ripple(orders):
    steady, angle = 0.5, 0.5 * np.arange(20_000) / RATE
    spectra = orders.order_spectra(steady + 0.004 * np.cos(150 * angle), rate=RATE)
    assert spectra.max() == pytest.approx(0.004, rel=0.05)


def test_a_smooth_motion_has_no_orders(orders):
    spectra = orders.order_spectra(swinging(0.0, 100.0), rate=RATE)
    assert np.median(spectra[:, orders.ORDERS > 60]) < 1e-4


def test_a_joint_that_hardly_moves_and_one_with_gaps_everywhere_have_no_spectra(orders):
    velocity = swinging(0.01, 100.0)
    nowhere = np.zeros(len(velocity), dtype=bool)
    assert orders.order_spectra(0.01 * velocity, rate=RATE).shape == (0, len(orders.ORDERS))
    assert len(orders.order_spectra(velocity, rate=RATE, valid=nowhere)) == 0


def run_with(scenario, robot="panda"):
    """A run as of wide domains; its first joint oscillates for a while, or does not."""
    velocity = np.stack([swinging(0.01, 100.0) * scale for scale in (1.0, 0.8)], axis=1)
    time = np.arange(len(velocity)) / RATE
    smooth = velocity.copy()
    events, blocks = [], (Block(0.0, 10.0, "ok"),)
    if scenario != "good":
        velocity[:, 0] += 0.5 * ((time > 4) & (time < 5)) * np.sin(2 * np.pi * 60 * time)
        events = [{"label": "oscillations", "start": 4.0, "stop": 5.0, "labelled": 1.0}]
        blocks = (Block(0.0, 3.9, "ok"), Block(4.0, 5.0, "oscillations"))
    domain = replace(DISTRIBUTION.domain(np.random.default_rng(3), Limits()), control="pd")
    return Run(
        time=time,
        joint_names=("a", "b"),
        velocity=velocity.astype(np.float32),
        position=(np.cumsum(velocity, axis=0) / RATE).astype(np.float32),
        velocity_desired=smooth.astype(np.float32),
        stages={"planned": smooth.astype(np.float32)},
        blocks=blocks,
        robot=robot,
        meta={"scenario": scenario, "seed": 10_000, "events": events, "domain": domain.as_dict()},
    )


@pytest.fixture
def data(tmp_path):
    folder = Folder.opened(tmp_path / "data", wide=True)
    for robot in ("panda", "go2"):
        (folder.path / robot).mkdir()
        for scenario in ("good", "tone"):
            run_with(scenario, robot).save(folder.file(Task(robot, scenario, 10_000)))
    for robot, problem in (("go2", "it fell"), ("a1", "a joint moved at 51.2 rad/s")):
        (folder.path / robot).mkdir(exist_ok=True)
        path = folder.path / robot / "good-10001.fallen.json"
        path.write_text(json.dumps({"problem": problem}))
    return folder.path


def test_a_data_set_is_shown_as_table_picture_and_sound(
    domains, data, tmp_path, capsys, monkeypatch
):
    picture, sounds = tmp_path / "domains.png", tmp_path / "sounds"
    monkeypatch.setattr(sys, "argv", [
        *("domains", str(data), "--picture", str(picture), "--sound", str(sounds)),
        *("--real", str(tmp_path / "nowhere")),
    ])  # fmt: skip
    domains.main()
    table = {line.split(" | ")[0]: line for line in capsys.readouterr().out.splitlines()}
    assert table["| panda"].startswith("| panda | 2 | none | 1 pd | 0 to 0 | 0.0")
    assert table["| panda"].endswith("| 1 of 1 |")
    assert table["| go2"].startswith("| go2 | 3 | 1 it fell | 1 pd |")
    assert (
        table["| a1 (target)"]
        == "| a1 (target) | 1 | 1 a joint moved | none | none | none | 0 of 0 |"
    )
    assert table["| all"] == "| all | 6 | 2 | | | | 2 of 2 |"
    assert picture.read_bytes().startswith(PNG)
    assert {path.name for path in sounds.iterdir()} == {
        "arm-good-panda-10000.wav",
        "arm-oscillations-panda-tone-10000.wav",
        "quadruped-good-go2-10000.wav",
        "quadruped-oscillations-go2-tone-10000.wav",
        "home-panda-straight-0.wav",
    }
    with wave.open(str(sounds / "arm-good-panda-10000.wav")) as sound:
        assert sound.getnframes() == pytest.approx(10 * sound.getframerate(), rel=0.01)
        loudest = np.abs(np.frombuffer(sound.readframes(sound.getnframes()), dtype="<i2")).max()
    assert 0.85 * 32767 < loudest < 32767
