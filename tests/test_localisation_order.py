"""Order of a finding: ripple of a drive is told from vibration of fixed frequency."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from inspector.analysis import Analysis
from inspector.audit import audit
from inspector.errors import Status
from inspector.localisation.order import Order, best_lines, order
from inspector.report import report, sentence
from inspector.report.formats import FORMATS, as_json, text
from inspector.report.picture import picture
from inspector.verdict import Finding, Verdict
from noiseclassifier import Event
from noisemodel import Run

RATE, SECONDS = 1000.0, 4.0
FINDING = Event("oscillations", 0.3, 1.5, 0.9)
TIME = np.arange(round(RATE * SECONDS)) / RATE
SPEED = 1.2 * np.sin(2 * np.pi * 0.3 * TIME)
ANGLE = 1.2 * (1 - np.cos(2 * np.pi * 0.3 * TIME)) / (2 * np.pi * 0.3)
NAMES = ("hip", "knee")


def ripple(size, teeth=160.0):
    return size * SPEED * np.cos(teeth * ANGLE + 0.7)


def tone(size, frequency=30.0):
    return size * np.sin(2 * np.pi * frequency * TIME)


def run_with(vibration, *, noise=1e-3, **changed):
    """Let two joints move at half and at full speed; the second one vibrates."""
    speed, angle = (np.outer(signal, (0.5, 1.0)) for signal in (SPEED, ANGLE))
    velocity = speed + noise * np.random.default_rng(1).standard_normal(speed.shape)
    velocity[:, 1] += vibration
    fields = {
        "time": TIME,
        "velocity": velocity,
        "velocity_desired": speed,
        "position": angle,
        "joint_names": NAMES,
    }
    return Run(**(fields | changed))


@pytest.mark.parametrize("teeth", [101.0, 160.0, 240.0, 480.0])
@pytest.mark.parametrize("missing", [(), ("position",), ("velocity_desired",)])
def test_ripple_has_the_order_of_its_gear(teeth, missing):
    known = order(run_with(ripple(0.05, teeth), **dict.fromkeys(missing)), FINDING)
    assert known is not None
    assert known.joint == "knee"
    assert known.periods_per_turn == pytest.approx(teeth, rel=0.01)


@pytest.mark.parametrize("size", [0.01, 0.1, 1.0])
@pytest.mark.parametrize("frequency", [15.0, 30.0, 90.0, 250.0])
def test_a_tone_has_no_order_however_the_speed_varies(size, frequency):
    run = run_with(tone(size, frequency))
    assert order(run, FINDING) is None
    _, over_angle, over_time = best_lines(run, FINDING)
    assert over_angle < over_time
    assert over_time > 0.97


def test_white_noise_blows_and_silence_have_no_order():
    noise = 0.3 * np.random.default_rng(2).standard_normal(len(TIME))
    blow = np.where(TIME >= 0.8, np.exp(-(TIME - 0.8) / 0.03), 0.0)
    for vibration in (noise, noise * SPEED, blow, np.zeros(len(TIME))):
        assert order(run_with(vibration), FINDING) is None


def test_ripple_of_a_steady_motion_cannot_be_told_from_a_tone():
    steady = np.outer(np.ones(len(TIME)), (0.5, 1.0))
    angle = np.outer(TIME, (0.5, 1.0))
    velocity = steady.copy()
    velocity[:, 1] += 0.05 * np.cos(160 * TIME)
    run = run_with(0.0, velocity=velocity, velocity_desired=steady, position=angle)
    best, over_angle, over_time = best_lines(run, FINDING)
    assert best.periods_per_turn == pytest.approx(160, rel=0.01)
    assert over_angle == pytest.approx(over_time, abs=0.01)
    assert order(run, FINDING) is None


def test_scale_units_and_the_direction_of_time_do_not_change_ripple():
    def same(one, other, factor=1.0):
        order = pytest.approx(factor * one[0].periods_per_turn, rel=1e-3)
        assert other[0].periods_per_turn == order
        assert other[1:] == pytest.approx(one[1:], abs=0.01)

    plain, quiet, loud = (
        best_lines(run_with(ripple(0.02 * k), noise=0.0), FINDING) for k in (1.0, 0.1, 10.0)
    )
    same(plain, quiet)
    same(plain, loud)
    run = run_with(ripple(0.02))
    signals = {name: 2.0 * getattr(run, name) for name in ("velocity", "velocity_desired")}
    doubled = replace(run, position=2.0 * run.position, **signals)
    same(best_lines(run, FINDING), best_lines(doubled, FINDING), 0.5)
    signals = {name: -getattr(run, name)[::-1] for name in ("velocity", "velocity_desired")}
    backwards = replace(run, position=run.position[::-1], **signals)
    mirrored = Event("oscillations", SECONDS - FINDING.stop, SECONDS - FINDING.start, 0.9)
    same(best_lines(run, FINDING), best_lines(backwards, mirrored))


def test_a_tone_in_the_loudest_joint_masks_the_ripple_of_another():
    run = run_with(tone(0.3))
    velocity = run.velocity.copy()
    velocity[:, 0] += ripple(0.1, 200.0) / 2
    assert order(replace(run, velocity=velocity), FINDING) is None


def test_ripple_is_found_through_turning_back_and_beside_gaps():
    long = Event("oscillations", 0.2, 3.8, 0.9)
    assert order(run_with(ripple(0.05)), long).periods_per_turn == pytest.approx(160, rel=0.01)
    valid = (TIME < 2.0) | (TIME >= 2.2)
    signals = {
        name: np.where(valid[:, None], getattr(run_with(ripple(0.05)), name), 0.0)
        for name in ("velocity", "velocity_desired", "position")
    }
    gap = run_with(0.0, valid=valid, **signals)
    assert order(gap, long).periods_per_turn == pytest.approx(160, rel=0.01)


def test_a_finding_in_a_gap_or_of_a_joint_at_rest_or_of_a_base_alone_has_no_order():
    valid = (TIME < 0.2) | (TIME >= 2.0)
    assert order(run_with(ripple(0.05), valid=valid), FINDING) is None
    rest = np.zeros((len(TIME), 2))
    still = run_with(0.0, velocity=rest + tone(0.01)[:, None], velocity_desired=rest, position=rest)
    assert best_lines(still, FINDING) == (None, 0.0, 0.0)
    shaken, none = tone(0.05)[:, None] * np.ones(6), rest[:, :0]
    alone = Run(time=TIME, joint_names=(), velocity=none, position=none, base_velocity=shaken)
    assert order(alone, FINDING) is None


def test_a_finding_that_is_shorter_than_a_part_or_a_run_is_no_error():
    assert order(run_with(ripple(0.05)), Event("impact", 1.0, 1.01, 0.9)) is not None
    short = run_with(ripple(0.05)).cut(0.5, 0.8)
    assert order(short, Event("impact", 0.5, 0.51, 0.9)) is None
    assert order(short.cut(0.5, 0.503), Event("impact", 0.5, 0.51, 0.9)) is None


KNEE = Order("knee", 160.04)
PHRASE = "goes with the speed of knee: 160 periods per turn"
FOUND = Verdict(
    Path("run.npz"),
    Status.FINDINGS,
    "general",
    (Finding.of(FINDING, order=KNEE), Finding("impact", 2.0, 2.1, 0.8)),
)


def test_every_format_says_with_which_joint_a_finding_goes():
    line = f"oscillations from 0.30 s to 1.50 s, {PHRASE}"
    first, second, _ = text([FOUND]).splitlines()[1:]
    assert first == f"    0.30 -   1.50 s   oscillations   {PHRASE}"
    assert second == "    2.00 -   2.10 s   impact"
    assert line in FORMATS["junit"]([FOUND])
    assert line in FORMATS["github"]([FOUND])
    (run,) = json.loads(as_json([FOUND]))["runs"]
    assert run["events"][0]["order"] == {"joint": "knee", "periods_per_turn": 160.0}
    assert run["events"][1]["order"] is None


def analysed(vibration, **changed):
    run = run_with(vibration)
    fields = {"name": "a", "status": Status.FINDINGS, "run": run, "audit": audit(run, {})}
    return Analysis(**(fields | {"spans": (FINDING,), "findings": (FINDING,)} | changed))


def test_report_and_list_of_events_say_it_beside_the_band():
    analysis = analysed(ripple(0.05))
    assert PHRASE in sentence(analysis, FINDING)
    assert f"; {PHRASE}\n" in report(analysis)
    assert PHRASE not in sentence(analysed(tone(0.05)), FINDING)
    (event,) = Verdict.of(Path("run.npz"), analysis).events
    assert event.order == order(analysis.run, FINDING) == analysis.orders[FINDING]
    assert analysed(ripple(0.05), spans=(), findings=()).orders == {}


@pytest.mark.parametrize("vibration", [tone(0.05), ripple(0.05)], ids=["tone", "ripple"])
def test_the_picture_has_a_line_for_each_order(vibration, monkeypatch):
    from matplotlib.axes import Axes

    titles = []
    monkeypatch.setattr(Axes, "set_title", lambda self, text, **_: titles.append(text))
    picture(analysed(vibration))
    wanted = [f"at 0.30 s: {PHRASE}"] if analysed(vibration).orders else []
    assert titles[0] == "\n".join(["filled: found", *wanted])
