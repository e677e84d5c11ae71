"""Secondary tasks, for the degrees of freedom that change no feature."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sim.types import Array, Posture

Secondary = Literal["level", "avoid_limits", "centre"]
FAR = 0.75
"""A joint farther than this from its middle, over half its range, is near its limit (the threshold
of Chaumette and Marchand 2001)."""


def level(posture: Posture) -> Array:
    """Return the turn (6,), per unit of gain, of the optical axis to straight down: z x down."""
    x, y, _ = posture.down.tolist()
    return np.array([0.0, 0.0, 0.0, -y, x, 0.0])


def centre(posture: Posture) -> Array:
    """Return the twist (6,), per unit of gain, that takes all limited joints to the middles of
    their ranges.
    """
    limited, away, half = _ranges(posture)
    return -posture.jacobian[:, limited] @ (away * half)


def avoid_limits(posture: Posture) -> Array:
    """Return the twist (6,), per unit of gain, that takes joints away from limits that they are
    near to.

    The negative gradient of h = sum max(0, |away| - FAR)^2 / 2, over the joints' ranges (Chaumette
    and Marchand 2001).
    """
    limited, away, half = _ranges(posture)
    excess = np.sign(away) * np.maximum(np.abs(away) - FAR, 0.0)
    return -posture.jacobian[:, limited] @ (excess * half)


def _ranges(posture: Posture) -> tuple[NDArray[np.intp], Array, Array]:
    """Return the joints that are limited, their distances from the middles (-1..1), and half their
    ranges.
    """
    limited = np.flatnonzero(np.isfinite(posture.lower) & np.isfinite(posture.upper))
    low = posture.lower[limited]
    high = posture.upper[limited]
    half = (high - low) / 2
    return limited, (posture.joints[limited] - (low + high) / 2) / half, half


TASKS = {"level": level, "avoid_limits": avoid_limits, "centre": centre}


def twist_of(tasks: tuple[Secondary, ...], posture: Posture) -> Array:
    """Return the sum (6,) of the tasks' twists, per unit of gain."""
    return sum((TASKS[name](posture) for name in tasks), start=np.zeros(6))
