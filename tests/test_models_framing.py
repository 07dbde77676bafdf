import numpy as np
import pytest

import noiseclassifier as nc
from noiseclassifier.features import frame_features


@pytest.mark.parametrize(("samples", "frames"), [(400, 1), (499, 1), (500, 2), (1000, 7)])
def test_as_many_frames_as_hops_fit(samples, frames):
    cut = nc.frame(np.arange(float(samples)), length=400, hop=100)
    assert cut.shape == (frames, 400)
    assert np.array_equal(cut[:, 0], 100.0 * np.arange(frames))


def test_frames_are_of_the_paper_by_default():
    cut = nc.frame(np.arange(10_000.0))
    assert cut.shape == (7, 4000)
    assert cut[:, 0].tolist() == [1000.0 * number for number in range(7)]


def test_frames_are_a_view_that_cannot_be_written():
    signal = np.arange(1000.0)
    cut = nc.frame(signal, length=400, hop=100)
    assert np.shares_memory(cut, signal)
    assert not cut.flags.writeable


def test_a_flush_frame_covers_the_tail_once():
    def starts(samples):
        return frame_features(np.ones(samples), nc.LogBands().at(1000.0))[0].tolist()

    assert starts(500) == [0, 100]
    assert starts(501) == [0, 100, 101]


def test_a_signal_shorter_than_a_frame_is_refused():
    with pytest.raises(nc.SignalError, match="399 samples is too short: one frame takes 400"):
        nc.frame(np.zeros(399), length=400, hop=100)


def test_several_signals_are_framed_alike():
    signals = np.arange(2000.0).reshape(2, 1000)
    frames = nc.frame(signals, length=400, hop=100)
    assert frames.shape == (7, 2, 400)
    np.testing.assert_array_equal(frames[:, 1], nc.frame(signals[1], length=400, hop=100))


def test_a_signal_of_more_axes_is_refused():
    with pytest.raises(nc.SignalError, match=r"shape \(3, 1000, 2\), expected \(samples,\)"):
        nc.frame(np.zeros((3, 1000, 2)), length=400, hop=100)
