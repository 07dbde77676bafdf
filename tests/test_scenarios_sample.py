"""A sample has the noise of a run, and the recipe to reproduce it bit for bit."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import noisemodel as nm
from noiseclassifier import scenarios
from noiseclassifier.scenarios.limbs import limbs
from noiseclassifier.scenarios.sample import FORMAT, Sample, digest, is_sample
from noisemodel import Block, Run

SAMPLES = 200
META = {"scenario": "straight", "seed": 3, "duration": 0.02, "recipe": 1}


def random_run(robot: str = "solo12", *, samples: int = SAMPLES) -> Run:
    """A random run with all signals of a simulated one."""
    generator = np.random.default_rng(0)
    joints = scenarios.ROBOTS[robot].drives.joints

    def signal(width):
        return generator.normal(size=(samples, width)).astype(np.float32)

    pose = np.hstack((signal(3), np.tile(np.float32([0, 0, 0, 1]), (samples, 1))))
    floating = scenarios.ROBOTS[robot].family != "arm"
    return Run(
        time=np.arange(samples) * 1e-4,
        joint_names=joints,
        velocity=signal(len(joints)),
        position=signal(len(joints)),
        velocity_desired=signal(len(joints)),
        position_desired=signal(len(joints)),
        stages={"planned": signal(len(joints)), "commanded": signal(len(joints))},
        effort=signal(len(joints)),
        base_pose=pose if floating else None,
        base_velocity=signal(6) if floating else None,
        robot=robot,
        blocks=(Block(0.0, 0.004, "ok"), Block(0.005, 0.01, "impact")),
        meta=META,
    )


@pytest.fixture(scope="module")
def simulated() -> Run:
    return scenarios.simulate("panda", "obstacle-toe", 1, duration=3.0)


def test_standstill_is_silent():
    run = random_run("panda")
    still = np.zeros_like(run.velocity)
    sample = Sample.of(replace(run, velocity=still, velocity_desired=still, stages={}))
    assert all((signal == 0).all() for signal in sample.signals.values())


@pytest.mark.parametrize("robot", ["solo12", "panda"])
def test_the_noise_of_a_sample_is_the_simplified_noise_of_its_run(robot):
    run = random_run(robot)
    np.testing.assert_allclose(
        Sample.of(run).noise, nm.simplified(run.motion, run.velocity_desired), rtol=2e-7
    )


def test_limbs_and_base_make_the_whole():
    run = random_run()
    signals = Sample.of(run).signals
    for name, base in (("measured", run.base_velocity), ("desired", None), ("error", None)):
        parts = [signals[f"{name}_{frame}"] ** 2 for frame in limbs("solo12")]
        parts += [] if base is None else [np.square(base).sum(axis=1)]
        np.testing.assert_allclose(sum(parts), signals[name] ** 2, rtol=1e-5)


def test_limbs_are_the_joints_from_the_base_to_an_effector():
    assert limbs("talos") == {
        f"{side}_sole_link": tuple(f"leg_{side}_{number}_joint" for number in range(1, 7))
        for side in ("left", "right")
    }
    assert limbs("go2")["RL_foot"] == ("RL_hip_joint", "RL_thigh_joint", "RL_calf_joint")


def test_a_robot_with_one_effector_is_one_limb():
    assert limbs("panda") == {}
    assert set(Sample.of(random_run("panda")).signals) == {
        *("measured", "desired", "error", "planned", "commanded", "power", "power_desired")
    }


@pytest.mark.parametrize("robot", ["solo12", "panda"])
def test_the_powers_of_both_motions_make_the_extended_noise(robot):
    run = random_run(robot)
    body = nm.Robot.load(robot)
    surface = nm.Surface.of(body, "auto")
    q_desired, v_desired = body.desired(run)
    noise = nm.extended(
        body,
        surface,
        *body.configuration(run),
        "normal",
        q_desired=q_desired,
        v_desired=v_desired,
    )
    signals = Sample.of(run).signals
    np.testing.assert_allclose(signals["power"] + signals["power_desired"], noise.total, rtol=1e-6)


def test_the_error_is_between_desired_and_measured_joints():
    run = random_run()
    exact = run.velocity_desired.astype(float) - run.velocity
    np.testing.assert_allclose(
        Sample.of(run).signals["error"], np.linalg.norm(exact, axis=1), rtol=1e-6
    )


def test_a_sample_is_read_as_it_was_written(tmp_path):
    sample = Sample.of(random_run())
    sample.save(tmp_path / "a.npz")
    read = Sample.load(tmp_path / "a.npz")
    assert (read.robot, read.rate, read.blocks) == ("solo12", 10_000.0, sample.blocks)
    assert read.meta == json.loads(json.dumps(sample.meta))
    assert read.name == "solo12/straight-003"
    assert list(read.signals) == list(sample.signals)
    for name, signal in sample.signals.items():
        assert read.signals[name].dtype == np.float32
        np.testing.assert_array_equal(read.signals[name], signal)


def test_a_sample_has_the_norms_of_the_decimated_run_too(tmp_path):
    run = random_run()
    Sample.of(run).save(tmp_path / "a.npz")
    slower = nm.decimated(run, 1000.0)
    decimated = Sample.load(tmp_path / "a.npz", only=("error", "measured_FL_FOOT")).decimated
    assert list(decimated) == ["error", "measured_FL_FOOT"]
    exact = np.linalg.norm(slower.velocity_desired - slower.velocity, axis=1)
    np.testing.assert_allclose(decimated["error"], exact, rtol=1e-6)


def test_a_sample_gives_its_noise_at_either_rate_and_at_no_other():
    run = random_run()
    slower = nm.decimated(run, 1000.0)
    sample = Sample.of(run)
    assert sample.at(10_000.0).signals is sample.signals
    np.testing.assert_allclose(
        sample.at(1000.0).noise, nm.simplified(slower.motion, slower.velocity_desired), rtol=2e-7
    )
    with pytest.raises(scenarios.ScenarioError, match=r"keeps its noise at 10000 Hz and 1000 Hz"):
        sample.at(500.0)


def test_a_sample_has_joints_only_at_the_lower_rate(tmp_path):
    run = random_run()
    Sample.of(run).save(tmp_path / "a.npz")
    for only in (None, ("error",)):
        sample = Sample.load(tmp_path / "a.npz", only=only)
        assert not sample.at(10_000.0).joints
        wanted = nm.by_joint(nm.decimated(run, 1000.0))
        assert sample.at(1000.0).joints.keys() == wanted.keys()
        for name, signal in sample.at(1000.0).joints.items():
            assert signal.shape == (12, SAMPLES // 10)
            np.testing.assert_allclose(signal, wanted[name], rtol=1e-5, atol=1e-6)


def test_equal_runs_make_equal_files(tmp_path):
    for name in ("a.npz", "b.npz"):
        Sample.of(random_run()).save(tmp_path / name)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_any_bit_of_a_run_changes_its_digest():
    run = random_run()
    known = {digest(run)}
    for field in ("velocity", "position_desired", "effort", "base_pose"):
        changed = getattr(run, field).copy()
        changed[7, 0] = np.nextafter(changed[7, 0], np.float32(9))
        known.add(digest(replace(run, **{field: changed})))
    known.add(digest(replace(run, blocks=run.blocks[:1])))
    known.add(digest(replace(run, stages={"planned": run.stages["planned"]})))
    assert len(known) == 7
    assert digest(replace(run, meta={})) in known


def test_single_signals_can_be_read(tmp_path):
    Sample.of(random_run()).save(tmp_path / "a.npz")
    assert list(Sample.load(tmp_path / "a.npz", only=("error",)).signals) == ["error"]
    with pytest.raises(
        scenarios.SampleError, match=r"has no signal loud; it has measured, desired"
    ):
        Sample.load(tmp_path / "a.npz", only=("loud",))


def test_a_file_that_exists_is_kept(tmp_path):
    (tmp_path / "a.npz").write_text("precious")
    with pytest.raises(nm.OutputError, match=r"a\.npz: exists already"):
        Sample.of(random_run()).save(tmp_path / "a.npz")
    assert (tmp_path / "a.npz").read_text() == "precious"


def test_a_simulated_run_is_reproduced_bit_for_bit(simulated, tmp_path):
    Sample.of(simulated).save(tmp_path / "a.npz")
    run = scenarios.reproduce(Sample.load(tmp_path / "a.npz"))
    assert digest(run) == digest(simulated)
    assert run.meta == simulated.meta


def test_a_run_that_cannot_be_reproduced_names_recipe_and_versions(simulated, monkeypatch):
    module = sys.modules["noiseclassifier.scenarios.reproduction"]
    monkeypatch.setattr(module, "simulate", lambda *_, **__: simulated)
    sample = Sample.of(simulated)
    made = {**sample.meta, "sha256": "0" * 64, "recipe": 1, "versions": {"mujoco": "1.2.3"}}
    with pytest.raises(
        scenarios.ChangedRunError,
        match=r"panda/obstacle-toe-001 cannot be reproduced.* with recipe 1 \(mujoco 1\.2\.3\),"
        r" here is recipe \d+ \(mujoco \d.*numpy",
    ):
        scenarios.reproduce(replace(sample, meta=made))


def damaged(sample, path, **changes):
    """Write a sample with other arrays, or without those that are None."""
    sample.save(path, overwrite=True)
    with np.load(path) as archive:
        arrays = {**archive, **changes}
    np.savez(path, **{name: array for name, array in arrays.items() if array is not None})


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"format": "noise-sample/1"}, f"format 'noise-sample/1', expected '{FORMAT}'"),
        ({"format": "noise-run/1"}, f"format 'noise-run/1', expected '{FORMAT}'"),
        ({"format": None}, f"format 'none', expected '{FORMAT}'"),
        ({"measured": None}, "has no signal measured; it has desired, error"),
        ({"error": np.zeros(3)}, r"signals of different shapes: .*error \(3,\)"),
        ({"lowered_error": np.zeros(3)}, r"signals of different shapes: .*error \(3,\)"),
        ({"meta": "{"}, "damaged"),
        ({"meta": "{}"}, "its meta lacks duration, scenario, seed, sha256"),
        ({"block_label": np.array(["ok"])}, "damaged"),
        ({"rate": None}, "damaged"),
        ({"error": np.array([{}])}, "damaged"),
    ],
)
def test_an_incomplete_sample_is_one_line(tmp_path, changes, problem):
    damaged(Sample.of(random_run("panda")), tmp_path / "a.npz", **changes)
    with pytest.raises(scenarios.SampleError, match=r"a\.npz: " + problem) as caught:
        Sample.load(tmp_path / "a.npz")
    assert "\n" not in str(caught.value)


def test_a_file_that_is_cut_off_or_flipped_is_named(tmp_path):
    Sample.of(random_run()).save(tmp_path / "a.npz")
    whole = (tmp_path / "a.npz").read_bytes()
    (tmp_path / "cut.npz").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(scenarios.SampleError, match=r"cut\.npz: not a sample, or truncated"):
        Sample.load(tmp_path / "cut.npz")
    middle = len(whole) // 2
    flipped = whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :]
    (tmp_path / "flipped.npz").write_bytes(flipped)
    with pytest.raises(scenarios.SampleError, match=r"flipped\.npz: damaged"):
        Sample.load(tmp_path / "flipped.npz")
    with pytest.raises(scenarios.SampleError, match=r"gone\.npz: there is no such file"):
        Sample.load(tmp_path / "gone.npz")


def test_samples_are_distinguished_from_runs(tmp_path):
    run = random_run()
    run.save(tmp_path / "run.npz")
    Sample.of(run).save(tmp_path / "sample.npz")
    (tmp_path / "text.npz").write_text("sample")
    found = {path.stem: is_sample(path) for path in tmp_path.glob("*.npz")}
    assert found == {"run": False, "sample": True, "text": False}


def test_a_full_disk_leaves_no_file(tmp_path):
    Sample.of(random_run(samples=20_000)).save(tmp_path / "small.npz")
    code = (
        "import resource, sys; from noiseclassifier.scenarios import Sample; import noisemodel\n"
        "sample = Sample.load(sys.argv[1])\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))\n"
        "try:\n    sample.save(sys.argv[2])\n"
        "except noisemodel.OutputError as error:\n    print(error)\n"
    )
    arguments = [str(tmp_path / "small.npz"), str(tmp_path / "new.npz")]
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=True
    )
    assert "new.npz: cannot be written (File too large)" in done.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["small.npz"]
