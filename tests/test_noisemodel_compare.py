import dataclasses
import pickle
import sys
from itertools import count

import numpy as np
import pytest
import workers
from chains import BAR, as_run, chain, motion
from scipy.signal import spectrogram

from noisemodel import (
    Block,
    Comparisons,
    GeometryError,
    LeftOut,
    NoiseModelError,
    Robot,
    Surface,
    UnknownKindError,
    compare,
    extended,
    parallel,
    simplified,
)
from noisemodel.compare import COMPARED, Comparison, contrasts, ends, excitation, moving
from noisemodel.noise import vibrating
from noisemodel.robot import limits_of

RATE = 1000.0


@pytest.fixture(scope="module")
def panda():
    robot = Robot.load("panda")
    return robot, Surface.of(robot)


def swinging(robot, samples=2000):
    """Every joint swings at its own rate."""
    time = np.arange(samples)[:, None] / RATE
    rates = 2 * np.pi * np.linspace(0.7, 3.1, robot.nv)
    return np.sin(rates * time) / rates, np.cos(rates * time)


def compared(robot, q, v, kinds=COMPARED, *, rate=RATE):
    """The comparison of one motion."""
    return alone(as_run(robot, q, v, rate), kinds, surface="visual")


def test_a_run_has_the_noise_of_its_measured_and_desired_motion_and_shares_of_its_terms(panda):
    robot, surface = panda
    (q, v), (q_desired, v_desired) = swinging(robot), motion(robot, samples=2000)
    wanted = {"position_desired": q_desired, "velocity_desired": v_desired}
    found = alone(as_run(robot, q, v, **wanted), COMPARED, surface="visual")
    shares = dict(zip(found.kinds, found.shares, strict=True))
    pressure = dict(zip(found.kinds, found.pressure, strict=True))
    powers = {"simplified": simplified(v, v_desired) ** 2}
    for kind in ("paper", "normal"):
        noise = extended(robot, surface, q, v, kind, q_desired=q_desired, v_desired=v_desired)
        assert np.allclose(shares[kind], noise.shares, rtol=1e-12)
        powers[kind] = noise.total
    for kind, power in powers.items():
        assert np.allclose(pressure[kind] ** 2, power / power.mean(), rtol=1e-12)
    squares = (v**2 + v_desired**2).sum(axis=0)
    assert np.allclose(shares["simplified"], squares / squares.sum(), rtol=1e-12)
    assert np.allclose(found.shares.sum(axis=1), 1.0, rtol=1e-12)
    assert found.terms.shape == (9, 3)
    assert np.allclose(found.terms.sum(axis=1), shares["paper"], rtol=1e-12)


def test_a_joint_that_follows_has_no_share_of_the_simplified_noise():
    found = compare("panda", kinds=["simplified", "normal"])[0]
    assert found.shares[0, -1] == 0.0
    assert found.shares[0, -2] > 0.0
    assert found.shares[0].sum() == pytest.approx(1.0)


def test_distances_are_those_of_log_spectra_after_their_mean(tmp_path):
    """A slider's carrier without geometry vibrates: "C" has no link that shows it."""
    robot = chain(tmp_path, "revolute", "prismatic", shapes=["", BAR])
    q, v = swinging(robot, samples=4000)
    v[:, 0] += 0.5 * np.cos(2 * np.pi * 200 * np.arange(4000) / RATE)
    v[:500] = 0.0  # what is silent is 100 dB below the loudest line
    found = compared(robot, q, v, ["C", "paper"])
    frequency, _, magnitude = spectrogram(
        found.pressure, RATE, np.hanning(102), noverlap=51, detrend=False, mode="magnitude"
    )
    loudest = magnitude.max(axis=(1, 2), keepdims=True)
    one, other = np.maximum(20 * np.log10(np.maximum(magnitude / loudest, 1e-99)), -100.0)
    apart = np.sqrt(np.mean((one - other - (one - other).mean()) ** 2, axis=1))
    np.testing.assert_allclose(found.frequency, frequency)
    (one, two), (other, same) = found.distance_by_frequency
    for both in (two, other):
        np.testing.assert_allclose(both, apart, rtol=1e-6)
    assert not np.any([one, same])
    assert found.distance[0, 1] == pytest.approx(np.sqrt(np.mean(apart**2)), rel=1e-6)
    assert apart[np.abs(frequency - 200).argmin()] > 2 * np.median(apart)


def test_silence_is_compared_without_a_warning(panda):
    robot, _ = panda
    q, v = swinging(robot)
    found = compared(robot, q, 0 * v)
    assert not found.pressure.any()
    assert np.isnan(found.correlation).all()
    assert not found.distance.any()
    assert not found.shares.any()
    assert not found.terms.any()
    assert np.isnan(contrasts(found.pressure, found.time, RATE, [Block(0.1, 0.2, "jerk")])).all()


def test_without_events_or_without_anything_else_there_is_no_contrast(panda):
    comparison = compared(panda[0], *swinging(panda[0]))
    whole = Block(-1.0, 3.0, "fall")
    for events in ((), (whole,), (Block(0.1, 0.2, "jerk"), whole)):
        found = contrasts(comparison.pressure, comparison.time, RATE, events)
        assert found.shape == (len(comparison.kinds), len(events))
        assert np.isnan(found).all()
    during = (comparison.time > 1.0) & (comparison.time < 1.2)
    alone = contrasts(
        comparison.pressure * during, comparison.time, RATE, [Block(0.9, 1.3, "jerk")]
    )
    assert (alone == np.inf).all()


@pytest.mark.parametrize(
    ("samples", "rate", "fits"),
    [
        (1024, 10_000.0, True),
        (1023, 10_000.0, False),
        (4, 40.0, True),
        (3, 40.0, False),
        (100, 34.0, False),
    ],
)
def test_a_motion_has_one_spectrum_at_least_of_four_samples(tmp_path, samples, rate, fits):
    robot = chain(tmp_path, "revolute", "prismatic")
    found = compare(as_run(robot, *swinging(robot, samples), rate), kinds=FEW)
    text = f"{samples} samples at {rate:g} Hz, expected 0.1024 s at least and 40 Hz"
    assert [one.reason for one in found.left_out] == ([] if fits else [text])


def test_envelopes_are_root_mean_squares_of_20_milliseconds(tmp_path):
    robot = chain(tmp_path, "revolute", "prismatic")
    q, v = swinging(robot, samples=1990)
    found = compared(robot, q, v, ["simplified", "mean", "rms"])
    surface = Surface.of(robot)
    power = [simplified(v) ** 2]
    power += [extended(robot, surface, q, v, kind).power.sum(axis=1) for kind in ("mean", "rms")]
    rms = np.sqrt(np.array(power)[:, :1980].reshape(3, 99, 20).mean(axis=2))
    np.testing.assert_allclose(found.correlation, np.corrcoef(rms), rtol=1e-9)
    np.testing.assert_allclose(found.frequency, np.arange(52) * RATE / 102)
    odd = compared(robot, q, v, ["simplified", "mean"], rate=1010.0)
    np.testing.assert_allclose(odd.frequency, np.arange(52) * 1010.0 / 103)
    assert odd.distance_by_frequency.shape == (2, 2, 52)


def test_motions_are_estimated_in_chunks_as_whole(tmp_path, monkeypatch):
    robot = chain(tmp_path, "revolute", "prismatic", floating_base=True)
    q, v = motion(robot, samples=200)
    whole = compared(robot, q, v)
    monkeypatch.setattr(sys.modules["noisemodel.compare"], "CHUNK", 7)
    chunks = compared(robot, q, v)
    for name in ("correlation", "distance", "shares", "terms"):
        np.testing.assert_allclose(getattr(chunks, name), getattr(whole, name), rtol=1e-9)
    squares = np.mean(v**2, axis=0)
    shares = np.array([squares[:6].sum(), squares[6], squares[7]]) / squares.sum()
    np.testing.assert_allclose(whole.shares[0], shares, rtol=1e-12)


comparing = sys.modules["noisemodel.compare"]
FEW = ("simplified", "C", "paper", "normal")
ARM, SLIDING = ("revolute", "revolute"), ("revolute", "revolute", "prismatic")


def arm(folder, *kinds, **options):
    return str(chain(folder, *kinds, **options).path)


def saved(folder, moved, **changes):
    run = dataclasses.replace(excitation(moved), **changes)
    run.save(folder / "run.npz", overwrite=True)
    return folder / "run.npz"


def alone(source, kinds=FEW, **options):
    """What a comparison of one robot finds."""
    found = compare(source, kinds=kinds, **options)
    assert found.left_out == ()
    (one,) = found
    return one


def reason(source, **options):
    """Why a comparison leaves a robot out."""
    found = compare(source, **options)
    assert len(found) == 0
    (left_out,) = found.left_out
    assert left_out.name == str(source)
    return left_out.reason


def test_on_one_joint_all_models_agree(tmp_path):
    """With one degree of freedom every kind is the joint's speed times a constant."""
    found = alone(arm(tmp_path, "revolute"))
    np.testing.assert_allclose(found.correlation, 1.0, rtol=1e-9)
    np.testing.assert_allclose(found.distance, 0.0, atol=1e-6)
    np.testing.assert_allclose(found.contrast, found.contrast[[0]] * np.ones((4, 1)), rtol=1e-6)
    np.testing.assert_allclose(found.pressure, found.pressure[[0]] * np.ones((4, 1)), rtol=1e-9)
    np.testing.assert_allclose(np.mean(found.pressure**2, axis=1), 1.0, rtol=1e-12)


@pytest.mark.parametrize(
    ("kinds", "reference"),
    [("paper,normal,mean", "normal"), ("mean,paper", "mean"), ("paper,A,simplified", "simplified")],
)
def test_the_reference_is_normal_else_mean_else_the_last(tmp_path, kinds, reference):
    found = alone(arm(tmp_path, "revolute"), ("simplified", "C", "paper"))
    named = dataclasses.replace(found, kinds=tuple(kinds.split(",")))
    assert named.kinds[named.reference] == reference


def test_joints_that_are_not_in_the_log_are_named(tmp_path):
    robot = chain(tmp_path, "revolute", "revolute")
    one = {name: getattr(excitation(robot), name)[:, :1] for name in ("velocity", "position")}
    names = {"joint_names": ("joint1",), "desired_joint_names": ()}
    found = alone(saved(tmp_path, robot, **one, **names))
    assert found.remarks == ("Not in the log, assumed stationary: joint2.",)


def test_mimic_joints_that_cannot_be_coupled_move_independently(tmp_path):
    follow = '<mimic joint="unknown"/>'
    found = alone(arm(tmp_path, "revolute", "revolute", follow=follow))
    assert found.joints == 2
    assert "move independently" in found.remarks[0]


@pytest.fixture(scope="module")
def urdfs(tmp_path_factory):
    """An arm, and another with a slider."""
    return [arm(tmp_path_factory.mktemp("arm"), *kinds) for kinds in (ARM, SLIDING)]


def test_a_run_brings_its_robot_and_its_motion_a_robot_the_excitation_of_a_seed(urdfs, tmp_path):
    robot = Robot.load(urdfs[0])
    run = excitation(robot, seed=3)
    run.save(tmp_path / "run.npz")
    paths = (tmp_path / "run.npz", str(tmp_path / "run.npz"))
    found = compare([run, *paths], kinds=FEW)
    expected = alone(urdfs[0], seed=3)
    assert [one.name for one in found] == [urdfs[0], str(paths[0]), paths[1]]
    for one in found:
        np.testing.assert_array_equal(one.pressure, expected.pressure)
        assert (one.events, one.rate) == (run.blocks, 4000.0)
    first, zero = (alone(urdfs[0], **seed).pressure for seed in ({}, {"seed": 0}))
    np.testing.assert_array_equal(first, zero)
    assert not np.array_equal(first, expected.pressure)


def test_a_robot_that_kills_its_worker_is_left_out(tmp_path, monkeypatch):
    def die(name, *others):
        return workers.die() if name == "ur5" else compare_one(name, *others)

    compare_one = comparing._compare
    monkeypatch.setattr(comparing, "_compare", die)
    workers.simulate(monkeypatch)
    found = compare([arm(tmp_path, *ARM), "ur5"], kinds=FEW, jobs=2)
    assert len(found) == 1
    assert [(each.name, each.reason) for each in found.left_out] == [("ur5", parallel.DIED)]


def test_robots_are_compared_many_at_once_and_alike(tmp_path):
    robot = chain(tmp_path, "revolute", "revolute")
    sources = [str(robot.path), robot, excitation(robot), "ur3_empty", str(tmp_path / "none.urdf")]
    one, two = (compare(sources, kinds=FEW, jobs=jobs) for jobs in (1, 2))
    assert one.to_arrow().to_pylist() == two.to_arrow().to_pylist()
    assert one.left_out == two.left_out
    assert len(two) == 3
    assert pickle.dumps(two)  # what workers hand back


def test_robots_that_are_left_out_are_named_with_the_reason(urdfs, tmp_path):
    missing = str(tmp_path / "none.urdf")
    found = compare([missing, urdfs[0], "tallos"], kinds=FEW)
    assert [one.name for one in found] == [urdfs[0]]
    first, second = found.left_out
    assert first == LeftOut(missing, "there is no such URDF file")
    assert second.name == "tallos"
    assert "did you mean 'talos'" in second.reason
    assert str(found).splitlines()[-2:] == [str(first), str(second)]
    assert str(first) == f"{missing}: left out: there is no such URDF file"
    none = compare("tallos", kinds=FEW)
    assert (list(none), str(none)) == ([], str(second))
    with pytest.raises(NoiseModelError, match="no robot was compared; tallos: left out: no robot"):
        none.to_arrow()


def test_runs_and_robots_that_do_not_suffice_are_left_out(tmp_path):
    robot = chain(tmp_path, "revolute")
    assert "the run names no robot; `inspector import --robot`" in reason(
        saved(tmp_path, robot, robot=None)
    )
    assert "the run has no positions" in reason(saved(tmp_path, robot, position=None))
    assert "no robot 'robby'" in reason(saved(tmp_path, robot, robot="robby"))
    assert "cannot be read" in reason(tmp_path / "none.npz")
    run = excitation(robot)
    still, valid = np.zeros_like(run.velocity), np.arange(len(run.time)) % 2 == 0
    gaps = saved(tmp_path, robot, valid=valid, velocity=still, position=still)
    assert "1 samples from 0 s to 0.00025 s, expected 2 at least" in reason(gaps)
    empty = arm(tmp_path, "revolute", shapes=[""])
    assert reason(empty, surface="visual") == "no link has a surface by geometry 'visual'"


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"kinds": ("paper", "loud")}, UnknownKindError, "no kind 'loud' of noise; .*simplified"),
        ({"kinds": "paper"}, NoiseModelError, "are paper; expected two different ones or more"),
        ({"kinds": ("A", "A")}, NoiseModelError, "expected two different ones"),
        ({"surface": "skin"}, GeometryError, "geometry 'skin' is not known, .* visual, collision"),
        ({"robots": []}, NoiseModelError, "no robots to compare"),
        ({"robots": ["panda", 3]}, NoiseModelError, "a robot is of type int, expected a robot"),
        ({"seed": -1}, NoiseModelError, "seed is -1, expected 0 or more"),
        ({"jobs": 0}, NoiseModelError, "jobs is 0, expected 1 or more"),
    ],
)
def test_what_cannot_be_compared_is_refused_before_any_work(options, error, message):
    with pytest.raises(error, match=message):
        compare(**({"robots": ["panda", "go2"]} | options))


KINDS = ("paper", "normal", "C")
LABELS = ("jerk", "oscillations", "fall")


def made(name, *, seed, floating_base=False, labels=LABELS, remarks=()):
    """A comparison with numbers that are all different, and some that do not exist."""
    golden = (0.3 * seed + number * (np.sqrt(5.0) - 1.0) / 2.0 for number in count())

    def spread(low, high, shape):
        """Numbers between two limits."""
        parts = np.fromiter(golden, float, int(np.prod(shape))) % 1.0
        return low + (high - low) * parts.reshape(shape)

    frequency = np.arange(0.0, 500.0 + 1000.0 * floating_base, 10.0)
    by_frequency = spread(1.0, 30.0, (3, 3, len(frequency)))
    terms = spread(0.0, 1.0, (6, 3))
    correlation = spread(-1.0, 1.0, (3, 3))
    correlation[1, 2] = np.nan if seed in (1, 2, 3) else correlation[1, 2]
    shares = spread(0.0, 1.0, (3, 6))
    distance = spread(0.0, 20.0, (3, 3))
    return Comparison(
        name=name,
        floating_base=floating_base,
        joints=5,
        time=np.arange(300) / 1000.0,
        rate=1000.0,
        events=tuple(
            Block(place / 10, place / 10 + 0.05, each) for place, each in enumerate(labels)
        ),
        kinds=KINDS,
        links_with_surface=4,
        pressure=np.ones((3, 300)),
        links=("base", "hip", "knee", "foot", "wheel", "hand"),
        correlation=correlation,
        distance=distance,
        frequency=frequency,
        distance_by_frequency=by_frequency,
        contrast=spread(-5.0, 40.0, (3, len(labels))),
        shares=shares / shares.sum(axis=1, keepdims=True),
        terms=terms / terms.sum(),
        remarks=remarks,
    )


MANY = """\
Reference 'normal'; F: floating base; last: the loudest link
                             share in paper  correlation  distance [dB]
                                 A    B    C  paper     C  paper    C
arm                            37%  33%  30%  -0.21     -    1.6  6.3   29% hand
…lder/with/a/long/arm.urdf     33%  30%  37%   0.39     -    7.6 12.3   33% foot
exactly/26/letters/arm.urd     33%  30%  38%   0.99     -   13.6 18.3   32% wheel
walker                     F   37%  33%  30%   0.05  0.52    4.2  9.0   32% base
runner                     F   33%  30%  38%   0.65 -0.88   10.2 15.0   32% hip
glider                     F   40%  26%  34%  -0.75 -0.28   16.2  1.0   31% knee
swimmer                    F   29%  37%  34%  -0.15  0.32    2.2  7.0   28% hand
median of 3 fixed              33%  30%  37%   0.39     -    7.6 12.3
median of 4 floating           35%  31%  34%  -0.05  0.02    7.2  8.0

Of all 7, medians
                                   distance by frequency [dB]        contrast of events above 10 Hz [dB]
                              0-20 Hz 20-100 Hz 100-500 Hz 500 Hz up  jerk oscillations fall
paper                            18.3      17.0       17.8      17.6  17.7         16.9 -0.2
normal                           18.3      18.1       17.7      17.6  24.6         10.4 21.8
C                                16.5      17.9       17.4      17.6  21.0          3.8 28.7
walker: one finger is left out
walker: it has no hand
swimmer: wet
tallos: left out: there is no such robot"""  # noqa: E501

ONE = """\
By kind
                                   distance by frequency [dB]
                              0-20 Hz 20-100 Hz 100-500 Hz 500 Hz up
paper                            18.2      16.9       17.2         -
normal                           22.5      19.0       17.4         -
C                                14.3      17.9       17.5         -"""


def test_many_robots_print_as_a_table_with_medians_of_three_or_more():
    hands = ("one finger is left out", "it has no hand")
    found = Comparisons(
        (
            made("arm", seed=1),
            made("a/folder/with/a/long/arm.urdf", seed=2, labels=LABELS[:1]),
            made("exactly/26/letters/arm.urd", seed=3, labels=(LABELS[0], LABELS[0])),
            made("walker", seed=4, floating_base=True, remarks=hands),
            made("runner", seed=5, floating_base=True),
            made("glider", seed=6, floating_base=True, labels=()),
            made("swimmer", seed=7, floating_base=True, remarks=("wet",)),
        ),
        (LeftOut("tallos", "there is no such robot"),),
    )
    assert str(found) == MANY
    two = str(Comparisons(found.robots[1:3]))
    assert "Of all 2, medians" in two
    assert "median of" not in two


def test_one_robot_without_events_prints_as_a_table_by_kind():
    one = made("arm", seed=1, labels=())
    assert str(Comparisons((one,))) == str(one)
    assert str(one).split("\n\n") == ["\n".join(MANY.splitlines()[:4]), ONE]


def test_a_row_of_an_arrow_table_has_the_numbers_of_its_kind():
    one = made("walker", seed=4, floating_base=True, labels=("jerk", "fall", "jerk"))
    table = Comparisons((made("arm", seed=1), one)).to_arrow().to_pylist()
    found = one
    for kind in range(3):
        frequency, squares = found.frequency, found.distance_by_frequency[kind, 1] ** 2
        bands = np.split(squares, np.searchsorted(frequency, [20.0, 100.0, 500.0]))
        names = ("0_20", "20_100", "100_500", "500_up")
        expected = {
            "name": "walker",
            "floating_base": True,
            "joints": 5,
            "links": 6,
            "links_with_surface": 4,
            "rate_hz": 1000.0,
            **{f"share_{term}": found.terms[:, at].sum() for at, term in enumerate("ABC")},
            "kind": KINDS[kind],
            "reference": "normal",
            "correlation": found.correlation[kind, 1],
            "distance_db": found.distance[kind, 1],
            **{f"distance_{n}_db": np.sqrt(b.mean()) for n, b in zip(names, bands, strict=True)},
            "contrast_jerk_db": (one.contrast[kind, 0] + one.contrast[kind, 2]) / 2,
            "contrast_oscillations_db": np.nan,
            "contrast_fall_db": one.contrast[kind, 1],
            "loudest_share": found.shares[kind].max(),
            "loudest_link": found.links[found.shares[kind].argmax()],
        }
        assert list(table[3 + kind]) == list(expected)
        for name, value in table[3 + kind].items():
            text = isinstance(value, str)
            wanted = expected[name]
            assert value == (wanted if text else pytest.approx(wanted, rel=1e-12, nan_ok=True))


def test_the_contrast_of_an_event_is_its_mean_power_over_that_outside_of_all(tmp_path):
    """Events last from their start to before their stop; the slow motion is left out."""
    robot = chain(tmp_path, "revolute", "prismatic")
    events = (Block(1.0, 1.5, "jerk"), Block(1.5, 1.50025, "fall"), Block(3.0, 4.0, "jerk"))
    found = alone(saved(tmp_path, robot, blocks=(Block(0.5, 0.9, "ok"), *events)))
    assert found.events == events
    power = vibrating(found.pressure.T, np.ones(len(found.time), dtype=bool), 4000.0).T ** 2
    rest = np.ones(len(found.time), dtype=bool)
    means = []
    for first, stop in ((4000, 6000), (6000, 6001), (12_000, 16_000)):
        rest[first:stop] = False
        means.append(power[:, first:stop].mean(axis=1))
    expected = 10 * np.log10(np.array(means).T / power[:, rest].mean(axis=1, keepdims=True))
    np.testing.assert_allclose(found.contrast, expected, rtol=1e-9)
    np.testing.assert_allclose(found.by_label(1, ["jerk"]), expected[1, [0, 2]].mean(), rtol=1e-9)


def test_of_equal_stretches_the_first_is_compared_with_what_it_has_of_the_blocks(tmp_path):
    robot = chain(tmp_path, "revolute", shapes=[""])
    run = excitation(robot)
    valid = np.ones(len(run.time), dtype=bool)
    valid[[0, *range(8001, 8011), *range(16_011, len(run.time))]] = False  # two of 8000 samples
    edges = run.time[[1, 8000]]
    blocks = (
        Block(run.time[0], 0.1, "jerk"),
        Block(edges[0] + 0.2, 0.3, "ok"),
        Block(0.3, 0.4, "jerk"),
        Block(1.5, edges[1], "fall"),
        Block(edges[1], 2.2, "jerk"),
    )
    signals = {"velocity": run.velocity * valid[:, None], "position": run.position * valid[:, None]}
    gaps = dataclasses.replace(run, valid=valid, blocks=blocks, **signals)
    _, found, remarks = moving(gaps)
    assert (len(found.time), found.time[0], found.time[-1]) == (8000, *edges)
    last = Block(edges[1], run.time[8001], "jerk")  # whose sample is the last one
    assert found.blocks == (Block(edges[0], 0.1, "jerk"), *blocks[1:4], last)
    assert remarks == ("The run has gaps: compared from 0.00 s on.",)


ODD = (
    "panda",  # prismatic, mimic
    "tiago",  # continuous, prismatic, slow
    "baxter",  # mimic, little room
    "double_pendulum",  # no room and no speed
    "iris_rotors",  # limits of 1e16
    "hector",  # nothing but a base
    "talos",
)


@pytest.mark.parametrize("name", ODD)
def test_every_joint_moves_within_its_limits_and_the_base_sways_if_it_can(name):
    robot = Robot.load(name, mimic=True)
    run, bounds = excitation(robot), limits_of(robot)
    for position, each in zip(run.position.T, map(bounds.get, robot.joint_names), strict=True):
        assert (np.abs(position - each.centre) <= (each.upper - each.lower) / 2).all()
    assert np.isfinite(run.position).all()
    assert (np.ptp(run.velocity, axis=0) > 0.0).all()
    slope = np.diff(run.position, axis=0) * 4000.0
    np.testing.assert_allclose(slope, run.velocity[1:], atol=1e-7)
    assert (run.base_velocity is not None) == robot.floating_base
    if robot.floating_base:
        assert 0.0 < np.sqrt(np.mean(run.base_velocity**2)) < 0.3


def tree(folder, *joints, **options):
    """A robot of links that are named after their joints: name, kind and parent link of each."""
    text = '<robot name="tree"><link name="base"/>'
    for name, kind, parent, *limit in joints:
        lower, upper, speed = limit or (-9, 9, 1)
        follow = f'<mimic joint="{kind}"/>' if kind in [each[0] for each in joints] else ""
        text += f"""<link name="{name}"/>
          <joint name="{name}" type="{"revolute" if follow else kind}">
            <parent link="{parent}"/><child link="{name}"/><axis xyz="0 0 1"/>{follow}
            <limit lower="{lower}" upper="{upper}" effort="1" velocity="{speed}"/></joint>"""
    path = folder / "tree.urdf"
    path.write_text(text + "</robot>")
    return Robot.load(path, mimic=True, **options)


def test_the_ends_of_a_robot_with_branches(tmp_path):
    joints = [
        ("a", "revolute", "base"),  # ends after one joint
        ("b", "prismatic", "base"),
        ("b1", "revolute", "b"),  # carries as many as c, further from the base
        ("b2", "revolute", "b1"),
        ("b3", "prismatic", "b2"),  # so b2 is as deep as d2, and carries more
        ("c", "revolute", "base"),
        ("c1", "prismatic", "c"),
        ("c2", "prismatic", "c"),
        ("d", "prismatic", "base"),
        ("d1", "prismatic", "d"),
        ("d2", "revolute", "d1"),
        ("d3", "d2", "d2"),  # follows d2
    ]
    robot = tree(tmp_path, *joints)
    assert ends(robot) == ("c", "b2")  # d2 carries the one that follows it
    continuous = [
        (name, kind.replace("revolute", "continuous"), *rest) for name, kind, *rest in joints
    ]
    assert ends(tree(tmp_path, *continuous[:-1])) == ("c", "d2")
    assert ends(chain(tmp_path, "prismatic")) == ()
    assert ends(chain(tmp_path, "revolute")) == ("joint1",)


def test_a_joint_uses_nine_tenths_of_its_range_or_of_its_speed(tmp_path):
    robot = tree(
        tmp_path,
        ("near", "revolute", "base", -9, 9, 0),
        ("room", "revolute", "near", -0.1, 0.3, 0),
        ("slide", "prismatic", "room", 0.5, 0.6, 0),
        ("slow", "revolute", "slide", -9, 9, 0.2),
        ("far", "revolute", "slow", 0, 0, 0),
    )
    run = excitation(robot)
    assert ends(robot) == ("near", "far")
    motion = {name: run.position[:, column] for column, name in enumerate(run.joint_names)}
    for name, low, high in (("room", -0.1, 0.3), ("slide", 0.5, 0.6)):
        middle, part = (low + high) / 2, 0.9 * (high - low) / 2
        assert motion[name].min() == pytest.approx(middle - part)
        assert motion[name].max() == pytest.approx(middle + part)
    slow = run.velocity[:, run.joint_names.index("slow")]
    assert np.abs(slow).max() == pytest.approx(0.9 * 0.2)


def test_an_excitation_has_its_events_and_names_its_robot(tmp_path):
    robot = chain(tmp_path, "revolute", "revolute", "revolute")
    run = excitation(robot)
    assert [(each.label, each.start, each.stop) for each in run.blocks] == [
        ("shake-near", 1.0, 1.8),
        ("shake-far", 2.6, 3.4),
        ("jerk", 4.6, 4.8),
    ]
    assert len(run.time) == 24_000
    assert run.meta == {"scenario": "excitation", "seed": 0}
    assert run.robot == str(robot.path)
    assert excitation(Robot.load("ur5")).robot == "ur5"


def test_the_motion_of_a_seed_is_that_of_every_version(tmp_path):
    """Published comparisons of robots are of this motion."""
    run = excitation(chain(tmp_path, "revolute", "revolute"), seed=3)
    rows = [0, 2000, 5600, 12_000, 18_399, 18_400, 18_520]
    velocity = [
        [-0.07820193, 0.45347247],
        [0.01313872, 0.38817184],
        [-0.51856615, -0.20342396],
        [-0.31665961, 0.34829821],
        [0.24144115, -0.70048673],
        [0.03878427, -0.89895923],
        [0.2015232, -0.7907143],
    ]
    np.testing.assert_allclose(run.velocity[rows], velocity, atol=1e-7)
    position = [[0.83834273, 0.09076577], [-0.14725058, 0.2486426], [-0.49451081, -0.35726221]]
    np.testing.assert_allclose(run.position[[0, 12_000, 23_999]], position, atol=1e-7)
    kinds = ("revolute", "prismatic", "continuous")
    run = excitation(chain(tmp_path, *kinds, floating_base=True), seed=3)
    position = [[-0.84389403, 0.55354212, 0.23328043], [0.82167029, -0.36427901, 0.07670249]]
    np.testing.assert_allclose(run.position[[0, 12_000]], position, atol=1e-7)
    base = [
        [-0.14462932, -0.09301684, 0.00441875, -0.11877586, -0.13491998, 0.07743631],
        [0.02078784, -0.11738944, -0.02167325, -0.06799074, -0.02787297, 0.12561495],
    ]
    np.testing.assert_allclose(run.base_velocity[[0, 18_400]], base, atol=1e-7)
