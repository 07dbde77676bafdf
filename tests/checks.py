"""What many tests check in the same way."""

import contextlib
import tracemalloc

import numpy as np
import pytest


def holds(found, **expected):
    """Check attributes, arrays bit for bit."""
    for name, value in expected.items():
        np.testing.assert_equal(getattr(found, name), value, err_msg=name)


@contextlib.contextmanager
def one_line(error, match=None, begin=""):
    """Expect an error of one line that begins so."""
    with pytest.raises(error, match=match) as caught:
        yield
    assert str(caught.value).startswith(str(begin))
    assert "\n" not in str(caught.value)


@contextlib.contextmanager
def memory_below(limit):
    """Check that what is done takes no more bytes than that at any time."""
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < limit
    finally:
        tracemalloc.stop()
