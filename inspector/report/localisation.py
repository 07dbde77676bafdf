"""Localisation of a failure in words, as reports print it."""

from inspector.localisation.stage import Localisation

LEAST = 0.05
"""Joints with a smaller share are left out."""
PRECISE = 10.0
"""A lag is given to a tenth of a millisecond up to this, in [ms]."""


def words(found: Localisation, *, quote: str = "") -> tuple[str, str, str]:
    """A localisation in words.

    Args:
        quote: Mark around the names of stages, say a backtick in Markdown.

    Returns:
        Stage and its lead over the next, joints and their shares, and frequency band; each is
        empty if it is not known.
    """
    stage = f"{quote}{found.stage}{quote}" if found.stage else ""
    if found.lag > 0.0:
        lag_ms = 1e3 * found.lag
        lead = f"{lag_ms:.1f} ms" if lag_ms < PRECISE else f"{lag_ms:.0f} ms"
        stage = f"{stage}, {lead} before {quote}{found.following}{quote}"
    joints = ", ".join(f"{joint} {share:.0%}" for joint, share in found.joints if share >= LEAST)
    low, high = (f"{frequency:.0f}" for frequency in found.band or (0.0, 0.0))
    band = f"{low} Hz" if low == high else f"{low}-{high} Hz"
    return stage, joints, band if found.band else ""
