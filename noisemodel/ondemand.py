"""Arrays that stay in their file: rows are read when they are needed.

A run of an hour at 10 kHz is gigabytes an array. What goes through a run piece by piece
(`pieces`) takes the memory of a piece, whether its arrays are in memory or in a file.
"""

from collections.abc import Callable, Iterator
from math import prod
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin
from numpy.typing import NDArray

AT_ONCE = 2**23
"""Bytes of an array that are read at once."""


class OnDemand(NDArrayOperatorsMixin):
    """An array of which rows are read when they are needed.

    It can stand in for a NumPy array. Slices and indices of rows read these; whatever else is done
    with it reads it whole, once, and keeps it in memory.

    Args:
        shape: Its shape, rows first.
        dtype: Type of its numbers.
        read: Reads rows from a first one up to the one after the last.

    Attributes:
        checked: Whether its values were checked; they are not checked again.
    """

    def __init__(
        self, shape: tuple[int, ...], dtype: Any, read: Callable[[int, int], NDArray[Any]]
    ) -> None:
        self.shape, self.dtype, self.read = shape, np.dtype(dtype), read
        self.checked = False
        self._whole: NDArray[Any] | None = None

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)

    @property
    def size(self) -> int:
        """Number of values."""
        count: int = prod(self.shape)
        return count

    @property
    def nbytes(self) -> int:
        """Bytes that it would take in memory."""
        return self.size * int(self.dtype.itemsize)

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, key: Any) -> NDArray[Any]:
        """Read rows, or parts of rows; the result is in memory."""
        rows, *others = key if isinstance(key, tuple) else (key,)
        if isinstance(rows, slice):
            found = self._slice(*rows.indices(len(self)))
        elif isinstance(rows, np.ndarray) and rows.ndim == 1 and rows.dtype.kind in "biu":
            found = self._rows(np.flatnonzero(rows) if rows.dtype.kind == "b" else rows)
        else:
            return np.asarray(np.asarray(self)[key])
        return found[:, *others] if others else found

    def _slice(self, start: int, stop: int, step: int) -> NDArray[Any]:
        if step == 1:
            return self.read(start, max(start, stop))
        return self._rows(np.arange(start, stop, step))

    def _rows(self, rows: NDArray[Any]) -> NDArray[Any]:
        """Rows by their indices, the file being read once if these rise."""
        found = np.empty((len(rows), *self.shape[1:]), self.dtype)
        rows = np.where(rows < 0, rows + len(self), rows)
        size = rows_at_once(self)
        first = 0
        while first < len(rows):
            low = int(rows[first])
            outside = np.flatnonzero((rows[first:] < low) | (rows[first:] >= low + size))
            stop = first + int(outside[0]) if len(outside) else len(rows)
            chosen = rows[first:stop] - low
            found[first:stop] = self.read(low, low + int(chosen.max()) + 1)[chosen]
            first = stop
        return found

    def astype(self, dtype: Any, **_: Any) -> "OnDemand":
        """The array in another type, on demand too."""
        return OnDemand(self.shape, dtype, lambda first, stop: self.read(first, stop).astype(dtype))

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        if self._whole is None:
            whole = self._whole = self.read(0, len(self))
            self.read = lambda first, stop: whole[first:stop]
        return self._whole if dtype is None else self._whole.astype(dtype, copy=False)

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **settings: Any) -> Any:
        """Compute with the whole array."""
        plain = [np.asarray(each) if isinstance(each, OnDemand) else each for each in inputs]
        return getattr(ufunc, method)(*plain, **settings)

    def __getattr__(self, name: str) -> Any:
        """Anything else that an array has, of the whole array."""
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(np.asarray(self), name)


def rows_at_once(array: Any) -> int:
    """Rows of an array that are taken at once: at least one."""
    row: int = array.dtype.itemsize * prod(array.shape[1:])
    return max(1, AT_ONCE // max(1, row))


def pieces(array: Any, multiple: int = 1) -> Iterator[slice]:
    """Rows of an array, piece by piece; all but the last have a multiple of so many rows."""
    size = max(1, rows_at_once(array) // multiple) * multiple
    for first in range(0, len(array), size):
        yield slice(first, min(first + size, len(array)))
