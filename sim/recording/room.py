"""Ranges of pan and tilt in which the picture of a turning camera stays inside a recording."""

from collections.abc import Callable
from math import degrees

import numpy as np

from sim.camera.camera import border
from sim.geometry import exp_so3
from sim.recording.renderer import seen_from
from sim.types import Array, Camera

STEPS = 40
"""Steps of each bisection, which leave a billionth of a degree."""
EVERY = 8
"""Every eighth pixel of the view's border is looked at, and its corners."""
WIDEST = np.radians(85.0)
"""Largest turn that is tried [rad]."""
Range = tuple[float, float]


def turned(pan: float, tilt: float) -> Array:
    """Return the rotation R_recording_turned (3, 3) from the frame of a turned camera to that of
    the recording camera, after a pan to the right about the picture's vertical [rad], and then a
    tilt upwards about the turned camera's own x axis [rad].
    """
    return exp_so3(np.array([0.0, pan, 0.0])) @ exp_so3(np.array([tilt, 0.0, 0.0]))


def room_in(recording: Camera, view: Camera) -> tuple[Range, Range] | None:
    """Return the ranges of pan to the right and of tilt upwards, (lowest, highest) [deg] each, in
    which the picture of a turning camera stays inside a recording for every pan and tilt together.
    Return None if even the picture of the camera that is not turned does not fit.

    Args:
        recording: Intrinsics of the recording camera.
        view: Intrinsics of the camera that turns about the recording camera's centre.
    """
    corners = [[u, v] for u in (0.0, view.width) for v in (0.0, view.height)]
    rays = view.normalise(np.concatenate([border(view)[::EVERY], corners]))
    size = np.array([recording.width, recording.height])

    def is_inside(pan: float, tilt: float) -> bool:
        seen = seen_from(recording, turned(pan, tilt), rays)
        return bool(((seen >= 0) & (seen <= size)).all())

    if not is_inside(0.0, 0.0):
        return None
    pans = [_farthest(lambda a, s=sign: is_inside(s * a, 0.0)) * sign for sign in (-1, 1)]
    tilts = [_farthest(lambda a, s=sign: is_inside(0.0, s * a)) * sign for sign in (-1, 1)]
    # Panned to the side, the view leaves the recording at a smaller tilt: all limits are reduced.
    share = _farthest(
        lambda a: all(is_inside(a * pan, a * tilt) for pan in pans for tilt in tilts), 1.0
    )
    low_pan, high_pan = (degrees(share * pan) for pan in pans)
    low_tilt, high_tilt = (degrees(share * tilt) for tilt in tilts)
    return (low_pan, high_pan), (low_tilt, high_tilt)


def _farthest(is_inside: Callable[[float], bool], most: float = WIDEST) -> float:
    """Return the largest number from 0 to `most` for which `is_inside` is true, by bisection; it
    has to be true for 0, and for all numbers below the result.
    """
    low, high = 0.0, most
    for _ in range(STEPS):
        middle = (low + high) / 2
        if is_inside(middle):
            low = middle
        else:
            high = middle
    return low
