"""What can go wrong when two runs are compared."""

from inspector.errors import InspectorError


class PairError(InspectorError):
    """Two runs that cannot be laid beside each other."""
