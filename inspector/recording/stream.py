"""A recording in a file, whole or not at all, with its report."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import rerun as rr

from inspector.recording import unstable
from noisemodel.atomic import replacing

APPLICATION = "inspector"
PATIENCE = 3.0
"""How long a file may stay as it is while it is written, in [s]."""


@contextmanager
def writing(path: Path, identity: str, *, overwrite: bool = False) -> Iterator[rr.RecordingStream]:
    """Write a recording for as long as the block lasts.

    Args:
        path: The file to write, by convention ``*.rrd``.
        identity: Hexadecimal, at least 32 digits. Opened again, a recording replaces the one of
            the same identity.
        overwrite: Whether a file that exists may be replaced.

    Yields:
        What to log into.

    Raises:
        OutputError: If the file exists or cannot be written.
    """
    with replacing(path, overwrite=overwrite) as temporary:
        recording = rr.RecordingStream(APPLICATION, recording_id=identity[:32])
        recording.save(temporary)
        yield recording
        if _flushed(recording, temporary):
            recording.disconnect()
        else:
            unstable.abandon(recording)
        require_whole(temporary)


def _flushed(recording: rr.RecordingStream, path: Path) -> bool:
    """Write what waits, as long as the file grows: of a full disk rerun waits without end."""
    size = -1
    while path.stat().st_size != size:
        size = path.stat().st_size
        with suppress(RuntimeError):  # not done within `PATIENCE`, or it cannot be written
            recording.flush(timeout_sec=PATIENCE)
            return True
    return False


def require_whole(recording: Path) -> None:
    """Refuse a recording that rerun could not write to its end; it tells that to its log only.

    Raises:
        OSError: Why the file cannot be written.
    """
    if unstable.has_end(recording):
        return
    with recording.open("ab") as file:
        file.write(bytes(1 << 16))  # fails as rerun did
    raise OSError("the recording is incomplete")


def log_report(
    recording: rr.RecordingStream, name: str, markdown: str, properties: dict[str, Any]
) -> None:
    """Log what a recording is called, its report and its properties."""
    recording.log("/report", rr.TextDocument(markdown, media_type="text/markdown"), static=True)
    recording.send_recording_name(name)
    recording.send_property("inspector", rr.AnyValues(**properties))
