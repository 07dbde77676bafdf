"""A resolution: short Fourier transforms of one length, and the bands that they are summed to."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Resolution:
    """Long windows tell frequencies apart, quick ones tell when something happens.

    Attributes:
        window: Samples of the Hann window of one transform.
        stride: Samples from one transform to the next.
        edges: Edges of the bands, ascending, in [Hz]; none unless bands are spaced by logarithms.
    """

    window: int
    stride: int
    edges: tuple[float, ...]

    def transforms(self, length: int) -> int:
        """Count the transforms of so many samples."""
        return 1 + (length - self.window) // self.stride
