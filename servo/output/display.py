"""Detection of a screen on which windows can be opened."""

import os
import sys

DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")
"""Variables that name a display on Linux."""


def has_display() -> bool:
    """Return whether windows can be opened: on Linux, whether DISPLAY or WAYLAND_DISPLAY is set; on
    macOS and Windows always.
    """
    return sys.platform != "linux" or any(map(os.environ.get, DISPLAYS))
