import numpy as np
import pytest
from generalmodel import relative
from scipy.fft import dct as scipy_dct
from scipy.signal import get_window

import noiseclassifier as nc
from noiseclassifier.features import (
    band_shares,
    compress,
    dct,
    feature_count,
    frame_features,
    pool,
    spectrogram,
)
from noiseclassifier.signals import JOINTS, MOTION

RANDOM = np.random.default_rng(7)
PROFILES = [
    *(nc.Profile.noisytest(kernel) for kernel in ("rbf", "linear")),
    *(nc.Profile.paper(kernel) for kernel in ("rbf", "linear")),
    *(nc.LogBands().at(rate) for rate in (250.0, 333.0, 1000.0, 10_000.0, 48_000.0)),
    *(relative(rate=rate) for rate in (250.0, 1000.0, 10_000.0)),
]
QUICK = relative()
NAMES = [f"{each.name}-{each.estimator}-{each.kernel}-{each.rate:g}" for each in PROFILES]


def tone(profile, frequency, amplitude=1.0):
    """One frame of a sine on top of a slow motion's constant noise."""
    time = np.arange(profile.length) / profile.rate
    return (3.0 + amplitude * np.sin(2 * np.pi * frequency * time))[None]


@pytest.mark.parametrize("profile", PROFILES, ids=NAMES)
def test_every_profile_gives_finite_features_of_its_count(profile):
    for frames in (RANDOM.random((3, profile.length)), np.zeros((3, profile.length))):
        features = nc.features(frames, profile)
        assert features.shape == (3, feature_count(profile))
        assert np.isfinite(features).all()


@pytest.mark.parametrize("profile", PROFILES, ids=NAMES)
def test_a_frames_features_do_not_depend_on_other_frames(profile):
    frames = RANDOM.random((5, profile.length))
    together = nc.features(frames, profile)
    alone = np.vstack([nc.features(frames[i : i + 1], profile) for i in range(5)])
    np.testing.assert_allclose(together, alone, rtol=1e-6 if profile.bands == "comb" else 1e-9)


def test_the_spectrogram_transforms_stretches_under_a_periodic_hann_window():
    frames = RANDOM.random((2, 4000))
    ours = spectrogram(frames, window=1024, stride=834)
    for time in range(4):
        stretch = frames[:, time * 834 : time * 834 + 1024]
        theirs = np.abs(np.fft.rfft(stretch * get_window("hann", 1024)))
        np.testing.assert_allclose(ours[:, time], theirs, atol=1e-10)
    assert ours.shape == (2, 4, 513)


def test_the_papers_bands_are_three_adjacent_bins():
    bins = RANDOM.random((2, 4, 513))
    expected = bins.reshape(2, 4, 171, 3).sum(axis=3)
    np.testing.assert_allclose(compress(bins), expected)


def test_the_comb_is_the_matrix_that_noisytest_builds():
    line = np.tile([1.0] * 3 + [0.0] * 513, 171)[: 513 * 171].reshape(513, 171)
    bins = RANDOM.random((1, 4, 513))
    np.testing.assert_allclose(compress(bins, comb=True), bins @ line)


def test_the_cosine_transform_is_scipys():
    energies = RANDOM.random((2, 8, 171))
    np.testing.assert_allclose(
        dct(energies), scipy_dct(energies, norm="ortho", axis=1).swapaxes(1, 2), atol=1e-12
    )


@pytest.mark.parametrize("frequency", [60.0, 200.0, 1000.0, 3333.0])
def test_a_tone_lands_in_its_band(frequency):
    paper = nc.Profile.paper()
    amplitude = spectrogram(tone(paper, frequency) - 3.0, window=1024, stride=834)
    loudest = compress(amplitude)[0].argmax(axis=1)
    width = 3 * paper.rate / paper.window
    assert np.abs(loudest * width - frequency).max() <= width

    ours = nc.LogBands().at(10_000.0)
    mean = nc.features(tone(ours, frequency), ours)[0, : len(ours.edges) - 1]
    low, high = ours.edges[mean.argmax()], ours.edges[mean.argmax() + 1]
    assert low <= frequency <= high


@pytest.mark.parametrize("rate", [333.0, 1000.0, 48_000.0])
def test_log_bands_of_a_tone_are_equal_at_any_rate(rate):
    def mean(profile):
        return nc.features(tone(profile, 61.0), profile)[0, 4]

    low, high = nc.LogBands().at(rate), nc.LogBands().at(10_000.0)
    # At 333 Hz, a window of 34 samples is a fiftieth longer than 0.1 s.
    assert mean(low) == pytest.approx(mean(high), abs=0.08)


def test_log_bands_do_not_depend_on_the_time_of_a_burst():
    profile = nc.LogBands().at(10_000.0)
    burst = RANDOM.standard_normal(300)
    frames = np.zeros((2, 4000))
    frames[0, 1100:1400] = frames[1, 2100:2400] = burst
    early, late = nc.features(frames, profile)
    np.testing.assert_allclose(early, late, atol=1e-9)


def test_each_band_shares_out_its_power_once():
    for profile in PROFILES[4:]:
        for each in profile.resolutions:
            shares = band_shares(profile.rate, each)
            assert shares.shape == (each.window // 2 + 1, len(each.edges) - 1)
            np.testing.assert_allclose(shares.sum(axis=0), 1.0)


def test_quick_windows_separate_a_short_burst_from_a_longer_one():
    profile = QUICK
    hiss = RANDOM.standard_normal(20)
    frames = np.full((2, 400), 1.0)
    frames[0, 190:210] += 0.3 * hiss
    frames[1, 160:240] += 0.15 * np.resize(hiss, 80)
    bands = len(profile.quick_edges) - 1
    burst, murmur = nc.features(frames, profile)[:, -2 * bands - 1 : -bands - 1]
    assert (burst[1:] - murmur[1:] > 0.5).all()  # the loudest moment, in all but the speed's band


def test_the_first_quick_band_alone_holds_the_speed():
    profile = QUICK
    quick = len(profile.quick_edges) - 1
    steady = nc.features(np.full((1, 400), 5.0), profile)[0]
    mean = steady[-3 * quick - 1 : -2 * quick - 1] + steady[-1]
    np.testing.assert_allclose(mean[1:], np.log(profile.floor), atol=1e-3)
    assert mean[0] > np.log(5.0)


def test_a_steady_level_has_no_deviation():
    pooled = pool(np.full((2, 13, 5), 4.0))
    assert np.array_equal(pooled, np.full((2, 3, 5), [[4.0], [4.0], [0.0]]))


def test_three_signals_that_grow_alike_change_the_level_of_the_whole_frame_alone():
    profile = relative(MOTION)
    frames = 1e6 * RANDOM.standard_normal((2, 3, 400))
    change = nc.features(8.0 * frames, profile) - nc.features(frames, profile)
    np.testing.assert_allclose(change[:, :-1], 0.0, atol=1e-6)
    np.testing.assert_allclose(change[:, -1], np.log(8.0), atol=1e-6)


def test_a_signal_that_grows_alone_is_relative_to_the_frame_and_to_its_neighbours():
    profile = relative(MOTION)
    frames = 1e6 * RANDOM.standard_normal((1, 3, 400))
    louder = frames * np.array([1.0, 8.0, 1.0])[:, None]
    change = (nc.features(louder, profile) - nc.features(frames, profile))[0]
    # Desired, measured and error above the frame; measured above desired, error above measured.
    expected = np.array([-1.0, 2.0, -1.0, 3.0, -3.0]) / 3.0 * np.log(8.0)
    first = 0
    for each in profile.resolutions:
        bands = len(each.edges) - 1
        spectra = change[first : first + 15 * bands].reshape(5, 3, bands)
        for number, wanted in enumerate((expected, expected, np.zeros(5))):  # mean, most, deviation
            np.testing.assert_allclose(
                spectra[:, number], np.tile(wanted[:, None], bands), atol=1e-6
            )
        first += 15 * bands
    assert change[first] == pytest.approx(np.log(8.0) / 3.0, abs=1e-6)
    assert first == len(change) - 1


def test_a_constant_signal_has_power_only_at_zero_hertz():
    profile = nc.LogBands().at(1000.0)
    features = nc.features(np.full((1, 400), 5.0), profile)
    silent, bands = np.log(profile.floor), len(profile.edges) - 1
    np.testing.assert_allclose(features[0, : 2 * bands], silent, atol=1e-6)


def test_single_precision_rounds_to_32_bits():
    profile = nc.Profile.noisytest()
    frames = RANDOM.random((2, 4000))
    features = nc.features(frames, profile)
    assert np.array_equal(features, features.astype(np.float32))
    assert np.array_equal(features, nc.features(frames.astype(np.float32), profile))


EACH = relative((*MOTION, *JOINTS))
BROKEN = np.zeros((3, 4000))
BROKEN[1, 7] = np.inf
ROWS = r"400\), expected \(frames, 3 \+ 3 joints, 400\)"


@pytest.mark.parametrize(
    ("frames", "profile", "reason"),
    [
        (np.zeros((2, 400)), nc.Profile.paper(), r"shape \(2, 400\), expected \(frames, 4000\)"),
        (np.zeros(4000), nc.Profile.paper(), r"shape \(4000,\), expected \(frames, 4000\)"),
        (BROKEN, nc.Profile.paper(), "frame 1 holds a value that is not finite"),
        *((np.zeros((1, rows, 400)), EACH, rf"shape \(1, {rows}, {ROWS}") for rows in (3, 5, 7)),
    ],
)
def test_frames_of_another_shape_or_that_are_not_finite_are_refused(frames, profile, reason):
    with pytest.raises(nc.SignalError, match=reason):
        nc.features(frames, profile)


def joined(norms, joints):
    """Frames of rows: three norms, then all joints of three signals, (frames, 3, joints, n)."""
    return np.concatenate((norms, joints.reshape(len(joints), -1, joints.shape[-1])), axis=1)


def split(features):
    """Features as (spectra, mean most deviation, bands) of each resolution."""
    spectra, first = [], 0
    for each in EACH.resolutions:
        bands = len(each.edges) - 1
        spectra.append(features[first : first + 39 * bands].reshape(13, 3, bands))
        first += 39 * bands
    assert first == len(features) - 1 == feature_count(EACH) - 1
    return spectra


def test_the_order_of_joints_does_not_matter():
    norms, joints = RANDOM.standard_normal((2, 3, 400)), RANDOM.standard_normal((2, 3, 5, 400))
    swapped = joints[:, :, [3, 1, 4, 0, 2]]
    np.testing.assert_allclose(
        nc.features(joined(norms, swapped), EACH),
        nc.features(joined(norms, joints), EACH),
        atol=1e-9,
    )


def test_joints_that_all_do_the_same_are_one_joint_and_none_is_above_the_others():
    norms, one = RANDOM.standard_normal((1, 3, 400)), RANDOM.standard_normal((1, 3, 1, 400))
    alone = nc.features(joined(norms, one), EACH)[0]
    many = nc.features(joined(norms, np.tile(one, (7, 1))), EACH)[0]
    np.testing.assert_allclose(many, alone, atol=1e-9)
    for spectra in split(alone):
        np.testing.assert_allclose(spectra[10:], 0.0, atol=1e-9)


def test_joints_leave_the_features_of_the_norms_as_they_are():
    norms, joints = RANDOM.standard_normal((1, 3, 400)), RANDOM.standard_normal((1, 3, 5, 400))
    whole = nc.features(joined(norms, joints), EACH)[0]
    alone = nc.features(norms, relative(MOTION))[0]
    first = 0
    for spectra in split(whole):
        own = spectra[:5].ravel()
        np.testing.assert_allclose(own, alone[first : first + len(own)], atol=1e-12)
        first += len(own)
    assert whole[-1] == pytest.approx(alone[-1], abs=1e-12)


def test_one_joint_whose_error_grows_is_above_the_mean_of_all():
    joints = 1e6 * RANDOM.standard_normal((1, 3, 1, 400)) * np.ones((4, 1))
    norms = 1e6 * RANDOM.standard_normal((1, 3, 400))
    louder = joints.copy()
    louder[0, 2, 1] *= 8.0
    change = nc.features(joined(norms, louder), EACH) - nc.features(joined(norms, joints), EACH)
    # Loudest desired, measured, error; measured less desired, error less measured; above the mean.
    expected = np.log(8.0) * np.array([0, 0, 1, 0, 1, 0, 0, 3 / 4])
    for spectra in split(change[0]):
        np.testing.assert_allclose(spectra[:5], 0.0, atol=1e-6)
        for number in range(2):  # mean and maximum
            wanted = np.tile(expected[:, None], spectra.shape[-1])
            np.testing.assert_allclose(spectra[5:, number], wanted, atol=1e-6)
        np.testing.assert_allclose(spectra[:, 2], 0.0, atol=1e-6)


@pytest.mark.parametrize(("samples", "frames"), [(400, 1), (499, 1), (500, 2), (1000, 7)])
def test_as_many_frames_as_hops_fit_are_a_view_that_cannot_be_written(samples, frames):
    signal = np.arange(float(samples))
    cut = nc.frame(signal, length=400, hop=100)
    assert cut.shape == (frames, 400)
    assert np.shares_memory(cut, signal)
    assert not cut.flags.writeable
    assert np.array_equal(cut[:, 0], 100.0 * np.arange(frames))


def test_frames_are_of_the_paper_by_default():
    cut = nc.frame(np.arange(10_000.0))
    assert cut.shape == (7, 4000)
    assert cut[:, 0].tolist() == [1000.0 * number for number in range(7)]


def test_a_flush_frame_covers_the_tail_once():
    def starts(samples):
        return frame_features(np.ones(samples), nc.LogBands().at(1000.0))[0].tolist()

    assert starts(500) == [0, 100]
    assert starts(501) == [0, 100, 101]


def test_several_signals_are_framed_alike():
    signals = np.arange(2000.0).reshape(2, 1000)
    frames = nc.frame(signals, length=400, hop=100)
    assert frames.shape == (7, 2, 400)
    np.testing.assert_array_equal(frames[:, 1], nc.frame(signals[1], length=400, hop=100))


def test_signals_that_are_too_short_or_of_more_axes_are_not_framed():
    with pytest.raises(nc.SignalError, match="399 samples is too short: one frame takes 400"):
        nc.frame(np.zeros(399), length=400, hop=100)
    with pytest.raises(nc.SignalError, match=r"shape \(3, 1000, 2\), expected \(samples,\)"):
        nc.frame(np.zeros((3, 1000, 2)), length=400, hop=100)
