"""What a live session did, to be printed at its end."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Summary:
    """What became of the samples of a session.

    Attributes:
        samples: That came.
        rate: Nominal samples per second, in [Hz].
        model: Name of the model that labelled, empty without.
        labels: Frames that were labelled, by class.
        troubles: What could not be shown, by kind.
        delays: From a frame's last sample to its label in the recording, of the latest labels,
            in [s].
        where: Where it was shown.
    """

    samples: int
    rate: float
    model: str
    labels: Mapping[str, int]
    troubles: Mapping[str, int]
    delays: Sequence[float]
    where: str

    def __str__(self) -> str:
        heard = ", ".join(f"{count} {label}" for label, count in self.labels.items())
        lines = [
            f"{self.samples} samples, {self.samples / self.rate:.2f} s at {self.rate:g} Hz,"
            f" {self.where}",
            f"labels by {self.model}: {heard}" if heard else "no labels",
        ]
        if self.delays:
            median, late = (1e3 * delay for delay in np.percentile(self.delays, [50, 99]))
            lines.append(
                f"delay from a sample to its label: median {median:.1f} ms,"
                f" 99 % within {late:.1f} ms"
            )
        lines += [f"{count} {kind}" for kind, count in self.troubles.items()]
        return "\n".join(lines)
