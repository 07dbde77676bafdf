"""Labels of a noise signal sample by sample, the same as those of the whole signal."""

import numpy as np

from noiseclassifier.classifier import Classifier
from noiseclassifier.errors import RateError
from noiseclassifier.framefeatures import FrameFeatures, Frames
from noiseclassifier.labels import Labels
from noiseclassifier.profile import NOMINAL
from noiseclassifier.signals import Signals, stacked
from noiseclassifier.types import Mask


class Stream:
    """A classifier of samples one by one, or in chunks of any size.

    Its labels are those of `Classifier.classify` for the whole signal: both have the same features
    and decision values of each frame, bit for bit (of support vector machines, decision values up
    to rounding: one product of matrices is faster for many frames, but its rounding depends on how
    many they are). The label of a frame comes with its last sample.

    Args:
        classifier: The model.
        rate: Sample rate of the signal, in [Hz], which must be the model's; the model's unless
            given.
        start: Time of the first sample, in [s].
        joints: Number of joints, if the model takes signals joint by joint.

    Raises:
        RateError: If the model is of another rate. Motion can be decimated before it becomes
            noise; the noise itself cannot.
    """

    def __init__(
        self,
        classifier: Classifier,
        *,
        rate: float | None = None,
        start: float = 0.0,
        joints: int = 1,
    ) -> None:
        self.classifier = classifier
        self.rate = classifier.rate if rate is None else rate
        self.start = start
        if not abs(self.rate / classifier.rate - 1.0) <= NOMINAL:
            raise RateError(
                self.rate, [classifier.rate], "lower the motion's rate, or take another model"
            )
        profile = classifier.profile
        rows = profile.norms + (len(profile.signals) - profile.norms) * joints
        self._frames = FrameFeatures(profile, rows)
        nothing = np.empty((0, classifier.estimator.width))
        self._nothing = classifier.labels(nothing, np.empty(0, np.intp), self.rate, start=start)

    @property
    def count(self) -> int:
        """Samples so far."""
        return self._frames.count

    def push(self, samples: Signals, valid: Mask | None = None) -> Labels:
        """Labels of the frames that samples complete.

        Args:
            samples: Any number of them, also none, shape (samples,), or of each signal by name,
                of that shape or, joint by joint, (joints, samples).
            valid: False in gaps, shape (samples,); frames that touch a gap are left out.

        Returns:
            Labels, most often none.

        Raises:
            SignalError: If the samples are not finite, not one-dimensional, or not all that the
                model needs; none is taken.
        """
        plain = stacked(samples, self.classifier.profile.signals)
        return self._labels(self._frames.push(plain, valid))

    def skip(self, samples: int) -> None:
        """Skip a gap: the same as pushing so many samples that are not valid.

        Args:
            samples: How many were lost; a gap of hours takes no longer than one of seconds.
        """
        self._frames.skip(samples)

    def finish(self) -> Labels:
        """End the signal; what is pushed next begins another one.

        Returns:
            The label of the last frame, flush with the end, if the profile asks for one where no
            hop leads.
        """
        return self._labels(self._frames.finish())

    def _labels(self, frames: Frames) -> Labels:
        starts, features = frames
        if not len(starts):
            return self._nothing
        decisions = self.classifier.decide(features)
        return self.classifier.labels(decisions, starts, self.rate, start=self.start)
