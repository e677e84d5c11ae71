"""Rates against each other: physics steps in a period, and those at which a picture is exposed."""

from __future__ import annotations

import numpy as np

from sim.render import CameraConfig

WHOLE = 1e-9
"""Tolerance for a ratio of rates to count as whole."""


def steps_between(physics_rate: float, rate: float, name: str) -> int:
    """Physics steps in one period of a rate.

    Raises:
        ValueError: They are not a whole number; the message gives both rates.
    """
    steps = physics_rate / rate
    if steps < 1 or abs(steps - round(steps)) > WHOLE * steps:
        raise ValueError(
            f"{name} = {rate:g} Hz does not divide world.physics_rate = {physics_rate:g} Hz "
            f"into whole steps ({steps:.6g} steps each)"
        )
    return round(steps)


def exposure_steps(camera: CameraConfig, steps: int) -> frozenset[int]:
    """The physics steps of a frame interval at which a sub-frame is taken, besides the one at its
    end.
    """
    if camera.exposure == 0:
        return frozenset()
    before_end = np.linspace(0, camera.exposure * steps, camera.subframes)[1:]
    return frozenset(int(k) for k in np.clip(np.rint(steps - before_end), 0, steps - 1))
