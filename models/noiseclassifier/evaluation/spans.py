"""Spans of time: arrays of shape (spans, 2), start and stop of each, in [s]."""

from collections.abc import Iterable
from typing import Protocol

import numpy as np

from noiseclassifier.types import Array


class Lasting(Protocol):
    """What has a start and a stop: a block, an event, a finding."""

    @property
    def start(self) -> float:
        """Start, in [s]."""

    @property
    def stop(self) -> float:
        """Stop, in [s]."""


def spans_of(items: Iterable[Lasting]) -> Array:
    """Spans of blocks, events or findings, as they come."""
    pairs = [(item.start, item.stop) for item in items]
    return np.array(pairs, dtype=np.float64).reshape(-1, 2)


def union(spans: Array) -> Array:
    """Spans in order, merged where they overlap or touch, so that no time counts twice."""
    if not len(spans):
        return spans
    spans = spans[np.argsort(spans[:, 0], kind="stable")]
    reach = np.maximum.accumulate(spans[:, 1])
    first = np.append(True, spans[1:, 0] > reach[:-1])
    last = np.append(first[1:], True)
    return np.stack((spans[first, 0], reach[last]), axis=1)


def overlap(spans: Array, others: Array) -> Array:
    """Time that each span shares with each of others, shape (spans, others), in [s]."""
    start = np.maximum(spans[:, None, 0], others[None, :, 0])
    stop = np.minimum(spans[:, None, 1], others[None, :, 1])
    return np.asarray(np.maximum(stop - start, 0.0), dtype=np.float64)


def common(spans: Array, others: Array) -> Array:
    """Time that is in both, as spans in order."""
    one, other = union(spans), union(others)
    start = np.maximum(one[:, None, 0], other[None, :, 0])
    stop = np.minimum(one[:, None, 1], other[None, :, 1])
    shared = stop > start
    return union(np.stack((start[shared], stop[shared]), axis=1))


def duration(spans: Array) -> float:
    """Time in any of the spans, in [s]."""
    merged = union(spans)
    return float((merged[:, 1] - merged[:, 0]).sum())
