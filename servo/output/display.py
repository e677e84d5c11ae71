"""Whether windows can be opened here."""

import os
import sys

DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")
"""Variables that name a display on Linux."""


def has_display() -> bool:
    """Whether there is a screen to open a window on; macOS and Windows are taken to have one."""
    return sys.platform != "linux" or any(map(os.environ.get, DISPLAYS))
