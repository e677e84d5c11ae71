"""Rates against each other: physics steps in a period, and those at which a picture is exposed."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np

from sim.camera import CameraConfig

WHOLE = 1e-9
"""Tolerance for a ratio of rates to count as whole."""


@dataclass(frozen=True, slots=True)
class Rates:
    """The rates of physics and drives, fitted to the camera's."""

    physics: float
    """Physics steps a second [Hz]."""
    steps: int
    """Physics steps a frame."""
    drive_steps: int
    """Physics steps from one update of the drives to the next."""

    @staticmethod
    def of(physics_rate: float, drive_rate: float, rate: float) -> Rates:
        """The rates nearest to those asked for [Hz] in which a frame has whole steps.

        Where the camera's rate does not divide the physics rate, physics gets faster, never slower,
        until a frame is a whole number of updates of the drives.
        """
        ratio = physics_rate / rate
        steps = round(ratio)
        if steps >= 1 and abs(ratio - steps) <= WHOLE * ratio:
            return Rates(physics_rate, steps, max(1, round(physics_rate / drive_rate)))
        updates = min(max(1, round(drive_rate / rate)), ceil(ratio))
        steps = updates * ceil(ratio / updates)
        return Rates(steps * rate, steps, steps // updates)

    def changed(self, physics_rate: float, drive_rate: float, rate: float) -> dict[str, float]:
        """The rates used [Hz] where they are not those asked for, by setting."""
        drive = max(self.physics / self.drive_steps, rate)  # once a frame at least
        pairs = {
            "world.physics_rate": (self.physics, physics_rate),
            "world.drive_rate": (drive, max(drive_rate, rate)),
        }
        return {
            name: used for name, (used, asked) in pairs.items() if abs(used / asked - 1) > WHOLE
        }


def exposure_steps(camera: CameraConfig, steps: int) -> frozenset[int]:
    """The physics steps of a frame interval at which a sub-frame is taken, besides the one at its
    end.
    """
    if camera.exposure == 0:
        return frozenset()
    before_end = np.linspace(0, camera.exposure * steps, camera.subframes)[1:]
    return frozenset(int(k) for k in np.clip(np.rint(steps - before_end), 0, steps - 1))
