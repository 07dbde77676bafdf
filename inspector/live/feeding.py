"""A live session that is fed by rows of text."""

from collections.abc import Callable
from itertools import chain
from typing import BinaryIO

from inspector.live.errors import LiveError
from inspector.live.interrupt import Interrupt
from inspector.live.rows import blocks, reader_of, widen
from inspector.live.session import LiveSession
from inspector.live.summary import Summary

GATHER = 0.02
"""How long rows wait for more, in [s]: less than half of a session's block."""
WANTED = "expected a CSV header and rows, or a JSON object per line"


def follow(
    stream: BinaryIO, names: tuple[str, ...], session_of: Callable[[tuple[str, ...]], LiveSession]
) -> Summary:
    """Show rows as they come, until they end or somebody presses Ctrl-C.

    Args:
        stream: The rows, such as standard input.
        names: Names of the joints, as a person gave them.
        session_of: Begins a session, given the names of the joints.

    Returns:
        What became of the samples.

    Raises:
        LiveError: If there are no rows, or the first line cannot be understood.
    """
    widen(stream)
    with Interrupt() as interrupt:
        incoming = interrupt.until(blocks(stream, gather=GATHER))
        lines, number, came = next(incoming, (b"", 1, 0.0))
        head, _, rest = lines.partition(b"\n")
        if not head.strip():
            raise LiveError(f"the input is empty; {WANTED}")
        reader, is_header = reader_of(head, names)
        start = (rest, number + 1, came) if is_header else (lines, number, came)
        with session_of(reader.names) as session:
            for lines, number, came in chain([start], incoming):
                for rows in reader.read(lines, number, session.note):
                    session.push(**rows.signals, time=rows.time, came=came)
    if not session.summary.samples:
        raise LiveError(f"the input has no samples; {WANTED}")
    return session.summary
