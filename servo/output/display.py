"""Whether this machine has a screen on which windows can be opened."""

import os
import sys

DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")
"""Variables that name a display on Linux."""


def has_display() -> bool:
    """Return whether there is a screen; macOS and Windows always count as having one."""
    return sys.platform != "linux" or any(map(os.environ.get, DISPLAYS))
