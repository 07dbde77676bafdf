"""Take a picture of a recording without a display."""

from inspector.recording.viewer import has_driver, headless_viewer, picture, until

__all__ = ["DRIVERS", "MISSING", "final_state", "headless_viewer", "picture"]

DRIVERS = has_driver()
MISSING = "needs Debian's libvulkan1 and mesa-vulkan-drivers (rerun draws on software Vulkan)"


def final_state(client):
    """The viewer's state once its views report nothing, or after 20 s what they report then."""
    until(lambda: not any(view.reports for view in client.get_state().views), 20.0, 0.5)
    return client.get_state()
