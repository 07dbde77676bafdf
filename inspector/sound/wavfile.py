"""A WAV file that says in its own metadata what it holds."""

import struct
from collections.abc import Mapping

import numpy as np

from noisemodel.types import Array

FULL = 32767
"""Full scale of 16 bits."""


def wav(signal: Array, rate: int, notes: Mapping[str, str]) -> bytes:
    """Write one channel of 16 bits as RIFF WAVE (IBM and Microsoft, 1991).

    Args:
        signal: Shape (samples,); 1 is full scale, and what is beyond is clipped.
        rate: Samples per second, in [Hz].
        notes: Texts by the names that RIFF has for them: INAM a title, ISFT the software, ICMT
            a comment.

    Returns:
        The file.
    """
    samples = np.round(np.clip(signal, -1.0, 1.0) * FULL).astype("<i2").tobytes()
    form = struct.pack("<HHIIHH", 1, 1, rate, 2 * rate, 2, 16)  # PCM, one channel, 2 bytes each
    info = b"INFO" + b"".join(
        _chunk(name.encode("ascii"), text.encode("utf-8") + b"\0") for name, text in notes.items()
    )
    body = b"WAVE" + _chunk(b"fmt ", form) + _chunk(b"LIST", info) + _chunk(b"data", samples)
    return _chunk(b"RIFF", body)


def _chunk(name: bytes, content: bytes) -> bytes:
    return name + struct.pack("<I", len(content)) + content + b"\0" * (len(content) % 2)
