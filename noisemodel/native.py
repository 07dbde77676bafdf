"""What native libraries write to stderr behind Python's back: kept, so that errors can cite it."""

import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def kept_stderr() -> Iterator[Callable[[], str]]:
    """Keep what the process writes to file descriptor 2 while the block runs.

    Yields:
        A function that returns what was written so far.
    """
    with tempfile.TemporaryFile() as kept:
        terminal = os.dup(2)
        os.dup2(kept.fileno(), 2)
        try:
            yield lambda: os.pread(kept.fileno(), 2**16, 0).decode(errors="replace")
        finally:
            os.dup2(terminal, 2)
            os.close(terminal)
