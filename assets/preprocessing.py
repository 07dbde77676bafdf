"""Draw the paper's steps of preprocessing, of one frame of the demo run, for docs/paper.md."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import noisemodel as nm
from noiseclassifier.features import compress, dct, spectrogram

HERE = Path(__file__).parent
# First sample and length of the frame, at 10 kHz; the impact is at 1.78 s.
START, LENGTH = 16_000, 4000
WINDOW, STRIDE = 1024, 834  # of the paper's Fourier transform, with its RBF kernel


def main() -> None:
    """Write the picture."""
    run = nm.Run.load(HERE / "runs" / "demo.npz")
    frame = nm.simplified(run.motion, run.velocity_desired)[START : START + LENGTH]
    amplitude = spectrogram(frame[None], window=WINDOW, stride=STRIDE)
    bands = np.log(compress(amplitude) + 1e-6)
    coefficients = dct(bands)[0]
    figure, axes = plt.subplots(1, 4, figsize=(13, 2.9), layout="constrained")
    axes[0].plot(np.arange(LENGTH) / run.rate, frame, linewidth=0.8)
    axes[0].set(title="frame: 4000 samples", xlabel="time [s]", ylabel="noise p̂ [rad/s]")
    windows = np.log(amplitude[0].T + 1e-6)
    largest = np.abs(coefficients[:, 1:]).max()
    steps = [
        ("spectrogram: 4 x 513", "window", "frequency [kHz]", windows, 5.0, {"cmap": "inferno"}),
        ("171 bands, logarithm", "window", "band", bands[0].T, 171.0, {"cmap": "inferno"}),
        (
            "DCT over time: 171 x 4",
            "coefficient",
            "band",
            coefficients,
            171.0,
            {"cmap": "coolwarm", "vmin": -largest, "vmax": largest},
        ),
    ]
    for axis, (title, across, up, values, top, colors) in zip(axes[1:], steps, strict=True):
        extent = (0.0, 4.0, 0.0, top)
        axis.imshow(
            values, origin="lower", aspect="auto", extent=extent, interpolation="none", **colors
        )
        axis.set(title=title, xlabel=across, ylabel=up)
    figure.savefig(HERE / "pictures" / "preprocessing.png", dpi=80)


if __name__ == "__main__":
    main()
