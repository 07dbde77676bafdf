"""Take a picture of a recording without a display: python tests/picture.py run.rrd 2.0 out.png."""

import sys
from pathlib import Path

from inspector.recording.viewer import (
    final_state,
    has_driver,
    headless_viewer,
    picture,
    shoot,
)

__all__ = ["DRIVERS", "MISSING", "final_state", "headless_viewer", "picture"]

DRIVERS = has_driver()
MISSING = "needs Debian's libvulkan1 and mesa-vulkan-drivers (rerun draws on software Vulkan)"


if __name__ == "__main__":
    recording, seconds, output = sys.argv[1:4]
    shoot(Path(recording), Path(output), float(seconds), overwrite=True)
