import hashlib
from dataclasses import replace
from math import inf

import numpy as np
import pytest

import noiseclassifier as nc
from noiseclassifier.dataset import cut, cut_frames
from noiseclassifier.recording import Block, Recording

OURS = nc.LogBands().at(1000.0)
PAPER = replace(nc.Profile.paper(), rate=1000.0, length=400, hop=100, window=256, stride=48)
THEIRS = replace(nc.Profile.noisytest(), rate=1000.0, length=400, hop=100, window=256, stride=48)


def recording(*blocks, samples=3000, **changes):
    """A ramp, so that each value identifies its sample."""
    facts = {"name": "walk", "signal": np.arange(float(samples)), "rate": 1000.0, "blocks": blocks}
    return Recording(**{**facts, **changes})


def cut_block(begin, stop, profile=PAPER, *, training=True, **changes):
    block = Block(begin, stop, "impact")
    return cut(recording(block, **changes), block, profile, training=training)[0]


def first_frames(recording, profile=PAPER):
    """All frames that training cuts from a recording."""
    return np.concatenate([each for _, each in cut_frames(recording, profile, training=True)])


@pytest.mark.parametrize(
    ("block", "profile", "options", "samples"),
    [
        ((1.0, 1.5), PAPER, {}, (1000, 1500)),  # its start, and not its stop
        ((11.0, 11.5), PAPER, {"start": 10.0}, (1000, 1500)),
        ((2.5, inf), PAPER, {}, (2500, 3000)),
        ((2.5, inf), OURS, {"training": False}, (2500, 3000)),
        ((1.0, 1.25), PAPER, {}, (1000, 1400)),  # padded: odd reflection continues a ramp
        ((1.0, 1.2), PAPER, {"training": False}, (900, 1300)),  # widened on both sides
        ((0.0, 0.1), PAPER, {"training": False}, (0, 400)),  # or inside, near an end
        ((2.9, 3.0), PAPER, {"training": False}, (2600, 3000)),
        ((1.0, 1.5), THEIRS, {}, (1000, 1501)),  # NoisyTest takes the stop in
        ((0.0, 0.5), THEIRS, {}, (1, 501)),  # and loses the first sample
    ],
)
def test_a_block_is_cut_and_padded_in_training_or_else_widened(block, profile, options, samples):
    assert cut_block(*block, profile, **options).tolist() == list(range(*samples))


def test_noisytest_widens_by_a_sample_more_and_pads_at_the_ends():
    # Rounding to 32 bits determines whether the samples on both bounds are in: one frame anyhow.
    assert len(cut_block(1.0, 1.2, THEIRS, training=False)) in (401, 402)
    samples = cut_block(0.0, 0.1, THEIRS, training=False)
    assert samples.tolist() == list(range(1, 401))  # the ramp, padded behind 0.251 s


def test_what_cannot_be_cut_is_refused():
    with pytest.raises(nc.RecordingError, match="walk: 300 samples are too short"):
        cut_block(0.1, 0.2, training=False, samples=300)
    with pytest.raises(nc.RecordingError, match=r"from 1.0001 s to 1.0002 s holds no sample"):
        cut_block(1.0001, 1.0002)


def test_a_dataset_keeps_labels_runs_and_hashes():
    walk = recording(Block(0.0, 0.5, "ok"), Block(0.6, 0.7, "impact"))
    stand = recording(Block(1.0, 1.6, "ok"), name="stand", sha256="abc")
    dataset = nc.Dataset.of([walk, stand], PAPER)
    joined = nc.Dataset.joined(nc.Dataset.of([each], PAPER) for each in (walk, stand))
    for field in ("features", "labels", "runs"):
        assert np.array_equal(getattr(joined, field), getattr(dataset, field))
    assert joined.hashes == dataset.hashes
    assert dataset.labels.tolist() == ["ok", "ok", "impact", "ok", "ok", "ok"]
    assert dataset.runs.tolist() == ["walk"] * 3 + ["stand"] * 3
    frames = np.concatenate([first_frames(each) for each in (walk, stand)])
    assert frames[:, 0].tolist() == [0, 100, 600, 1000, 1100, 1200]
    assert np.array_equal(dataset.features, nc.features(frames, PAPER))
    assert dict(dataset.hashes) == {"walk": walk.sha256, "stand": "abc"}


def test_frames_that_touch_a_gap_are_left_out():
    valid = np.ones(3000, bool)
    valid[450] = False
    walk = recording(Block(0.0, 1.0, "ok"), Block(0.44, 0.46, "ok"), valid=valid)
    assert first_frames(walk)[:, 0].tolist() == [0, 500, 600]
    assert nc.Dataset.of([walk], PAPER).labels.tolist() == ["ok"] * 3


@pytest.mark.parametrize(
    ("recordings", "error", "reason"),
    [
        (
            [recording(Block(0.0, 1.0, "rattle"))],
            nc.RecordingError,
            "walk: label 'rattle' is no class; there are ok, impact",
        ),
        (
            [recording(Block(0.0, 1.0, "ok"), rate=970.0)],
            nc.RateError,
            r"rate of 970 Hz; .* 1000 Hz: recording 'walk'",
        ),
        ([recording(), recording()], nc.DatasetError, "two recordings are called 'walk'"),
        ([recording()], nc.NoFrameError, "no annotated frame in 1 recordings"),
    ],
)
def test_recordings_that_make_no_data_set_are_refused(recordings, error, reason):
    with pytest.raises(error, match=reason):
        nc.Dataset.of(recordings, PAPER)


@pytest.mark.parametrize(
    ("blocks", "reason"),
    [
        ([(1.0, 0.5, "ok")], "block 'ok' from 1 s to 0.5 s stops before it starts"),
        ([(1.0, 3.5, "ok")], "outside of the recording, which lasts from 0 s to 3 s"),
        ([(-1.0, 0.5, "ok")], "outside of the recording"),
        ([(3.001, inf, "ok")], "outside of the recording"),  # a sample beyond its end
        (
            [(0.0, 2.0, "ok"), (0.1, 0.2, "ok"), (1.9, 2.5, "impact")],
            "block 'ok' from 0 s to 2 s and block 'impact' from 1.9 s to 2.5 s overlap",
        ),
        ([(0.0, 2.0, "oscillations"), (1.9, 2.5, "impact")], "overlap and contradict"),
        ([(0.0, 2.0, "impact"), (1.9, 2.5, "oscillations")], "overlap and contradict"),
    ],
)
def test_blocks_that_cannot_be_are_refused(blocks, reason):
    with pytest.raises(nc.RecordingError, match=f"walk: .*{reason}"):
        recording(*blocks)


def test_annotations_may_be_off_by_a_sample():
    early, late = Block(-0.001, 1.001, "ok"), Block(1.0, 3.001, "impact")
    assert recording(early, late).blocks == (early, late)
    assert recording(Block(3.0, inf, "ok")).blocks[0].start == 3.0
    for wrong in (
        [Block(-0.0012, 1.0, "ok")],
        [Block(0.0, 3.0012, "ok")],
        [Block(0.0, 1.0012, "ok"), late],
        [Block(1.0, 1.0, "ok")],
    ):
        with pytest.raises(nc.RecordingError):
            recording(*wrong)


def test_a_recording_has_the_hash_of_its_samples_unless_one_is_given():
    one, other = np.arange(3.0), np.arange(3.0, 6.0)
    both = {"measured": one, "desired": other}
    found = recording(signal=both).sha256
    content = one.astype("<f8").tobytes() + other.astype("<f8").tobytes()
    assert found == hashlib.sha256(content).hexdigest()
    assert recording(signal=both, sha256="0" * 64).sha256 == "0" * 64


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"signal": np.zeros((3, 2))}, r"a signal of shape \(3, 2\)"),
        ({"signal": np.zeros(0)}, r"a signal of shape \(0,\)"),
        ({"signal": np.array([0.0, 1.0, np.nan])}, "sample 2 is not finite"),
        ({"valid": np.ones(5, bool)}, r"valid has shape \(5,\), the signal \(3000,\)"),
        ({"rate": 0.0}, "rate 0.0 Hz"),
        ({"start": inf}, "start inf s"),
    ],
)
def test_recordings_that_cannot_be_are_refused(changes, reason):
    with pytest.raises(nc.RecordingError, match=f"walk: .*{reason}"):
        recording(**changes)


@pytest.mark.parametrize("duration", [0.1, 0.2, 0.3, 0.7])
def test_our_profile_trains_on_failures_anywhere_in_a_frame(duration):
    blocks = (Block(0.5, 0.9, "ok"), Block(2.0, 2.0 + duration, "impact"))
    one = recording(*blocks, samples=4000)
    at_rest, *first = first_frames(one, OURS)[:, 0]
    assert at_rest == 500  # of ok, one frame
    first = np.array(first)
    overlap = np.minimum(first + 400, 2000 + 1000 * duration) - np.maximum(first, 2000)
    assert len(first) > 2
    assert overlap.min() >= min(1000 * duration, 200) - 1e-9
    assert first.min() == pytest.approx(2000 + min(1000 * duration, 200) - 400)
    measured = nc.Dataset.of([one], OURS, training=False).labels.tolist()
    assert measured == ["ok", *["impact"] * max(1, round(10 * duration - 3))]
