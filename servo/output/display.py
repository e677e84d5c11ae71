"""Displays: windows can be opened here or not."""

import os
import sys

DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")
"""Variables that name a display on Linux."""


def has_display() -> bool:
    """Return whether there is a screen for a window; macOS and Windows are taken to have one."""
    return sys.platform != "linux" or any(map(os.environ.get, DISPLAYS))
