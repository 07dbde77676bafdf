"""Noise, labels and the robot while it moves: samples in, a viewer that follows.

    push -> block -> clock -> noise -> ear (labels)
                                    -> drawing (lines, spectrogram, lanes, robot) -> a sink

A `LiveSession` takes samples one by one or in chunks and works on them in blocks of 50 ms, so that
what is drawn comes in columns. Nothing is dropped silently: what cannot be shown is counted, and
said once per kind.
"""

from inspector.live.errors import LiveError, SinkError
from inspector.live.session import LiveSession
from inspector.live.summary import Summary

__all__ = ["LiveError", "LiveSession", "SinkError", "Summary"]
