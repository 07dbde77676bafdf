"""Noise, labels and the robot while it moves: samples in, a viewer that follows.

    push -> buffer -> clock -> noise -> labeller
                                     -> drawing (lines, spectrogram, lanes, robot) -> a sink

A `LiveSession` takes samples one by one or in chunks and works on them in batches of 50 ms, so that
what is drawn comes in columns. Nothing is dropped silently: what cannot be shown is counted, and
warned of once per kind.
"""

from inspector.live.drawing import SinkError
from inspector.live.session import LiveError, LiveSession, Summary

__all__ = ["LiveError", "LiveSession", "SinkError", "Summary"]
