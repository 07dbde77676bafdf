"""What can go wrong live."""

from inspector.errors import InspectorError


class LiveError(InspectorError):
    """Samples that cannot be taken at all."""


class SinkError(InspectorError):
    """A viewer or a file that nothing can be drawn into."""
