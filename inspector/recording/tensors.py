"""Tensors in Arrow's form, as rerun's columns hold them.

Rerun makes them one by one, by casts for which Arrow loads its functions for computing: a tenth of
a second, for what is a few offsets.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from noisemodel.types import Real


def tensors(values: Real, names: Sequence[str] | None = None) -> Any:
    """Make an Arrow array of tensors.

    Args:
        values: Shape (tensors, ...), of 32 or 64 bits.
        names: Of the axes of each tensor.

    Returns:
        The array, which rerun takes as it is.
    """
    import pyarrow as pa
    import rerun as rr

    count, shape = len(values), values.shape[1:]
    kinds = {field.name: field for field in rr.components.TensorData.arrow_type()}
    union = kinds["buffer"].type
    flat = pa.array(np.ascontiguousarray(values).ravel())
    used = [field.name for field in union].index(f"F{8 * values.itemsize}")
    children = [pa.nulls(0, field.type) for field in union]
    children[used] = _lists(union[used].type, flat, count)
    codes, places = np.full(count, used, dtype=np.int8), np.arange(count, dtype=np.int32)
    buffer = pa.Array.from_buffers(
        union, count, [None, pa.py_buffer(codes), pa.py_buffer(places)], children=children
    )
    sizes = pa.array(np.tile(np.array(shape, dtype=np.uint64), count))
    called = pa.array([names and list(names)] * count, type=kinds["names"].type)
    columns = [_lists(kinds["shape"].type, sizes, count), called, buffer]
    return pa.StructArray.from_arrays(columns, fields=list(kinds.values()))


def _lists(kind: Any, flat: Any, count: int) -> Any:
    """Cut a flat array into lists of one length."""
    import pyarrow as pa

    offsets = np.arange(count + 1, dtype=np.int32) * np.int32(len(flat) // count)
    return pa.Array.from_buffers(kind, count, [None, pa.py_buffer(offsets)], children=[flat])
