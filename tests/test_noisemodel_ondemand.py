"""Arrays on demand: which rows are read, and how often."""

import numpy as np
import pytest

from noisemodel import ondemand
from noisemodel.ondemand import OnDemand, pieces, rows_at_once

VALUES = np.arange(300.0).reshape(100, 3)


@pytest.fixture
def read():
    """The rows that were read, from the first to the one after the last."""
    return []


@pytest.fixture
def array(read, monkeypatch):
    """An array of 100 rows, of which 8 are read at once."""
    monkeypatch.setattr(ondemand, "AT_ONCE", 8 * 3 * 8 + 23)

    def rows(first, stop):
        read.append((first, stop))
        return VALUES[first:stop]

    return OnDemand((100, 3), np.float64, rows)


@pytest.mark.parametrize(
    ("key", "parts"),
    [
        (slice(5, 9), [(5, 9)]),
        (slice(None), [(0, 100)]),
        (slice(-3, None), [(97, 100)]),
        (slice(9, 5), [(9, 9)]),
        (slice(20, 40, 3), [(20, 27), (29, 36), (38, 39)]),
        (slice(10, 0, -5), [(10, 11), (5, 6)]),
        (np.array([3, 10, 4, 11, 2, 2, 99]), [(3, 11), (11, 12), (2, 3), (99, 100)]),
        (np.array([3, 10, 4]), [(3, 11)]),
        (np.array([4, 3]), [(4, 5), (3, 4)]),
        (np.array([-100, 0, -93, -92, -1]), [(0, 8), (8, 9), (99, 100)]),
        (np.array([5, 7], dtype=np.uint8), [(5, 8)]),
        (np.isin(np.arange(100), [0, 50, 57, 58]), [(0, 1), (50, 58), (58, 59)]),
        (np.zeros(0, dtype=int), []),
        ((slice(5, 9), 1), [(5, 9)]),
        ((np.array([5, 9]), slice(1, 3)), [(5, 10)]),
    ],
)
def test_only_rows_that_are_needed_are_read_some_at_once(array, read, key, parts):
    np.testing.assert_array_equal(array[key], VALUES[key])
    assert read == parts


@pytest.mark.parametrize("key", [7, (7, 2), [3, 4], (np.newaxis, 3), VALUES > 40])
def test_whatever_else_is_asked_reads_the_whole_once(array, read, key):
    for _ in range(2):
        np.testing.assert_array_equal(array[key], VALUES[key])
    assert read == [(0, 100)]


def test_what_was_read_whole_is_not_read_again(array, read):
    assert float(array.max()) == 299.0
    np.testing.assert_array_equal(array + array[4:5], VALUES + VALUES[4])
    np.testing.assert_array_equal(np.add.reduce(array, axis=1), VALUES.sum(axis=1))
    np.testing.assert_array_equal(array[5:9], VALUES[5:9])
    assert np.asarray(array) is np.asarray(array)
    assert np.asarray(array, dtype=np.float32).dtype == np.float32
    assert np.asarray(array, dtype=np.float64) is np.asarray(array)
    assert read == [(0, 100)]


def test_another_type_is_made_of_the_rows_that_are_read(array, read):
    other = array.astype(np.int16)
    assert (other.dtype, other.shape, other.ndim, len(other)) == (np.int16, (100, 3), 2, 100)
    assert (other.size, other.nbytes, array.nbytes) == (300, 600, 2400)
    part = other[4:6]
    assert part.dtype == np.int16
    assert part.tolist() == [[12, 13, 14], [15, 16, 17]]
    assert read == [(4, 6)]
    assert not other.checked
    assert np.asarray(other).dtype == np.int16
    np.testing.assert_array_equal(np.asarray(other), VALUES)


def test_an_array_on_demand_has_no_other_protocols_than_its_own(array, read):
    with pytest.raises(AttributeError, match="^__array_interface__$"):
        _ = array.__array_interface__
    assert read == []


@pytest.mark.parametrize(
    ("shape", "rows"),
    [
        ((100, 3), 8),
        ((100, 2, 3), 4),
        ((100,), 25),
        ((100, 25), 1),
        ((100, 26), 1),
        ((100, 0), 100),
    ],
)
def test_rows_at_once_take_so_many_bytes_and_are_one_at_least(monkeypatch, shape, rows):
    monkeypatch.setattr(ondemand, "AT_ONCE", 100)
    assert rows_at_once(np.zeros(shape, dtype=np.float32)) == rows


@pytest.mark.parametrize(
    ("multiple", "parts"),
    [
        (1, [(0, 9), (9, 18), (18, 20)]),
        (2, [(0, 8), (8, 16), (16, 20)]),
        (3, [(0, 9), (9, 18), (18, 20)]),
        (5, [(0, 5), (5, 10), (10, 15), (15, 20)]),
        (9, [(0, 9), (9, 18), (18, 20)]),
        (10, [(0, 10), (10, 20)]),
        (20, [(0, 20)]),
    ],
)
def test_pieces_have_a_multiple_of_rows_and_end_where_the_array_does(monkeypatch, multiple, parts):
    monkeypatch.setattr(ondemand, "AT_ONCE", 110)
    array = np.zeros((20, 3), dtype=np.float32)
    assert [(each.start, each.stop) for each in pieces(array, multiple)] == parts
    if multiple == 1:
        assert [(each.start, each.stop) for each in pieces(array)] == parts
        assert list(pieces(array[:0])) == []
        assert list(pieces(array[:9])) == [slice(0, 9)]


def test_a_piece_takes_megabytes():
    """Neither a row nor the whole, so that what goes through a run takes the memory of a piece."""
    hour = np.broadcast_to(np.float64(0.0), (3_600_000, 32))
    sizes = [each.stop - each.start for each in pieces(hour)]
    assert sum(sizes) == len(hour)
    assert 10**6 < max(sizes) * 32 * 8 < 10**7
