"""Files of NoisyTest 0.0.1: a ``.log`` of the noise of a run, a ``.toml`` of its blocks.

Its reader skips lines that begin with ``#`` and one line more, so that the first sample is
lost; it requires one blank between two numbers, and floats as times of blocks. It trains on a
folder ``training`` and validates on a folder ``validation``, both at 10 kHz.
"""

import json
import re
import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from noiseclassifier.scenarios.errors import SampleError
from noiseclassifier.scenarios.sample import digest
from noisemodel import Block, Run, simplified
from noisemodel.archive import read_text
from noisemodel.atomic import replacing

LONG_KEY = re.compile(r"""(?<![\w"'-])(?:[\w"'-]++[ \t]*+\.[ \t]*+){50}""")
"""A key of TOML that no writer writes; `tomllib` takes memory by the square of its parts."""

RATE = 10_000.0
"""The only sample rate of NoisyTest, in [Hz]."""
VALIDATION = 4
"""One seed in so many is for validation."""
CLASSES = ("ok", "impact", "highaccelerations", "oscillations")
"""NoisyTest's classes; it cannot train if one of them has no block."""
CONFIG = {
    "import_preprocessor": {
        "arguments": {
            "keywords_to_target_data": {label: number for number, label in enumerate(CLASSES)}
        }
    },
    "model": {"arguments": {"regularization": 1.1, "kernel_gamma": 5.7e-4}},
    "feature_preprocessor": {"arguments": {"fft_stride_length": 834}},
}
"""A configuration: these classes, and the optimum of the paper for the RBF kernel."""


def part(seed: int) -> str:
    """The folder of a seed: "training" or "validation"."""
    return "validation" if seed % VALIDATION == VALIDATION - 1 else "training"


def write_config(folder: Path) -> None:
    """Write ``noisytest-config.json``, which NoisyTest takes with ``--config``."""
    with replacing(folder / "noisytest-config.json", overwrite=True) as temporary:
        temporary.write_text(json.dumps(CONFIG, indent=2) + "\n", encoding="ascii")


def missing_classes(folder: Path) -> tuple[str, ...]:
    """Classes without a block in the folder ``training``."""
    logs = sorted((folder / "training").glob("*.log"))
    there = {block.label for log in logs for block in read(log)[0]}
    return tuple(label for label in CLASSES if label not in there)


def write(run: Run, log: Path) -> None:
    """Write the simplified noise of a run and its blocks; existing files are replaced."""
    if run.rate != RATE:
        raise SampleError(log, f"NoisyTest takes {RATE:g} Hz only, the run has {run.rate:g} Hz")
    rows = np.column_stack((run.time, simplified(run.motion, run.velocity_desired)))
    with replacing(log.with_suffix(".toml"), overwrite=True) as temporary:
        temporary.write_text(annotations(run.blocks) + _simulation(run), encoding="utf-8")
    with replacing(log, overwrite=True) as temporary:
        np.savetxt(temporary, rows, fmt=("%.4f", "%.9g"), header="time [s], noise estimate [rad/s]")


def read(log: Path) -> tuple[tuple[Block, ...], float]:
    """Blocks and duration of a run, from its ``.toml``.

    Returns:
        The blocks, and the duration of the run, in [s].
    """
    path = log.with_suffix(".toml")
    try:
        text = read_text(path)
        if LONG_KEY.search(text):
            raise ValueError("a key of many parts")
        content = tomllib.loads(text)
        ranges, labels = content["data"]["chunk_ranges"], content["data"]["chunk_labels"]
        recipe = json.loads(content["simulation"]["recipe"])
        blocks = tuple(
            Block(float(start), float(stop), str(label))
            for (start, stop), label in zip(ranges, labels, strict=True)
        )
        return blocks, float(recipe["duration"])
    except FileNotFoundError as error:
        raise SampleError(log, f"lacks its {path.name}") from error
    except (OSError, ValueError, LookupError, TypeError, ArithmeticError, RecursionError) as error:
        raise SampleError(path, f"damaged ({' '.join(str(error).split())})") from error


def annotations(blocks: Sequence[Block]) -> str:
    """Labelled stretches as NoisyTest has them beside each of its logs.

    Both numbers of a range are written with a decimal point: NoisyTest's TOML reader takes no mixed
    ones.
    """
    ranges = "".join(f"    [{float(each.start)!r}, {float(each.stop)!r}],\n" for each in blocks)
    labels = "".join(f"    {json.dumps(each.label, ensure_ascii=False)},\n" for each in blocks)
    return f"[data]\nchunk_ranges = [\n{ranges}]\nchunk_labels = [\n{labels}]\n"


def _simulation(run: Run) -> str:
    """The recipe to reproduce the run, as a JSON text in TOML."""
    recipe = json.dumps({**run.meta, "robot": run.robot, "sha256": digest(run)}, sort_keys=True)
    return f"\n[simulation]\nrecipe = {json.dumps(recipe)}\n"  # JSON's escapes are TOML's too
