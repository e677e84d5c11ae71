"""The law of `ibvs` inside limits of speed, joints and view (control barrier functions, Ames et al.
2019), by one quadratic programme a frame.

With v* the twist that `ibvs` asks for, and L the interaction matrix of the features:

    minimise |L (v - v*)|^2 + DAMPING |v - v*|^2, so that
    |v_i| <= fastest, |w_i| <= fastest_turn                                          (speed)
    RANGE_GAIN (lower - q) <= J# v <= RANGE_GAIN (upper - q), and the joints' rates  (joints)
    dh/dt >= -VIEW_GAIN h, for the way h of each corner to each side of the picture  (view)

Where nothing limits it, v is v*. With the last line h is a control barrier function: it decays
exponentially at most, and stays positive. Speed and joints are hard limits, which a camera that
stands keeps; the view is soft, so that each programme has a solution: where the view cannot be
kept, the squares of the violations are least. At last the whole twist is shortened to `fastest` and
`fastest_turn`, and by the limits of acceleration, which the programme does not know.

It decides about the next moment only, so it may stop at the side of the view, away from the goal.

Ames, Coogan, Egerstedt, Notomista, Sreenath, Tabuada 2019 (Control barrier functions: theory and
applications, European Control Conference). Solved by DAQP: Arnstrom, Bemporad, Axehill 2022 (A dual
active-set solver for embedded quadratic programming using recursive LDL^T updates, IEEE
Transactions on Automatic Control 67).
"""

# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# DAQP has no stubs.
from dataclasses import dataclass
from typing import Annotated, final

import daqp
import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from servo.controllers import ibvs
from servo.controllers._bounds import Bounds, joint_bounds, speed_bounds, view_bounds
from servo.controllers._law_settings import LawSettings
from servo.controllers._limits import DesiredTwist, LimitedTwist, excess
from servo.parts import Task
from sim.types import Array

SOFT = 8
"""DAQP's flag of a constraint that may be violated."""
DAMPING = 1e-3
"""Weight of a change of the twist, over that of a change of the features."""
EXACT = 1e-9
"""Largest excess over a bound that rounding explains."""
VIEW_GAIN = 5.0
"""How fast a corner may use up its way to a side [1/s]; at most the frame rate counts. Chosen by
hand: a way is used up to 1 % in a second."""
LEAVING = 1.0
"""A corner that is faster than the view allows by more than this violates it [px/s]."""


@dataclass(frozen=True, slots=True)
class Config(LawSettings):
    """The law of `ibvs`, and its limits."""

    margin: Annotated[float, Ge(0), Le(10_000)] = 10.0
    """Way between the target's corners and the sides of the picture that is kept [px]."""

    def build(self, rng: np.random.Generator) -> ibvs.Ibvs:
        """Return the controller, which uses no random numbers."""
        return ibvs.Ibvs(self, Programme(self))


@final
class Programme:
    """The quadratic programme of a frame."""

    def __init__(self, config: Config) -> None:
        self._margin = config.margin
        self._fastest = config.fastest
        self._fastest_turn = config.fastest_turn
        self._speed = speed_bounds(config.fastest, config.fastest_turn)

    def start(self, task: Task) -> None:
        """Begin a task.

        Raises:
            ValueError: The margin leaves nothing of the picture.
        """
        self._camera = task.camera
        margin = self._margin
        width = task.camera.width
        height = task.camera.height
        if margin >= min(width, height) / 2:
            raise ValueError(
                f"controller.margin = {margin:g}: nothing is left of a picture of {width} x "
                f"{height} px; it should be less than {min(width, height) / 2:g}"
            )

    def limited(self, desired: DesiredTwist) -> LimitedTwist:
        """Return the twist that changes the features most nearly as desired, inside the limits."""
        fast = max(1.0, excess(desired.twist, self._fastest, self._fastest_turn))
        law = desired.twist / fast
        limits = ("speed",) * (fast > 1.0)
        hard, view = self._bounds(desired)
        bounds = hard if view is None else hard + view
        over = bounds.excess(law)
        # What is not a number passes: the loop then names the part that it came from.
        if not (desired.moves.any() and (np.abs(over) > EXACT).any()):
            return LimitedTwist(law, limits)
        sense = np.zeros(len(over), np.intc)
        sense[len(hard.A) :] = SOFT
        change, active = _change(desired, bounds, law, sense)
        names = dict.fromkeys((*limits, *bounds.names_at(active)))
        if view is None:
            return LimitedTwist(law + change, tuple(names))
        left = view.excess(law + change)
        violated = view.names_at(left * (np.abs(left) > LEAVING))
        return LimitedTwist(law + change, tuple(names), violated)

    def _bounds(self, desired: DesiredTwist) -> tuple[Bounds, Bounds | None]:
        """Return the hard bounds, and those of the view where the target's corners are seen."""
        seen = desired.seen
        view = None
        joints = joint_bounds(desired.posture, desired.way, desired.dt)
        if seen is not None and seen.corners is not None:
            view = view_bounds(
                desired, seen, self._camera, self._margin, min(VIEW_GAIN, 1 / desired.dt)
            )
        return self._speed if joints is None else self._speed + joints, view


def _change(
    desired: DesiredTwist, bounds: Bounds, law: Array, sense: NDArray[np.intc]
) -> tuple[Array, Array]:
    """Return the least change (6,) of a twist with which it keeps its bounds, and their multipliers
    (m,).

    Where DAQP finds none, the camera stands; it then keeps all hard bounds.
    """
    L = desired.L[:, desired.moves]
    A = np.ascontiguousarray(bounds.A[:, desired.moves])
    n = L.shape[1]
    at = bounds.A @ law
    H = L.T @ L + DAMPING * np.eye(n)
    found, _, flag, info = daqp.solve(
        H, np.zeros(n), A, bounds.upper - at, bounds.lower - at, sense
    )
    if flag <= 0:
        return -law, bounds.excess(law)
    change = np.zeros(6)
    change[desired.moves] = found
    return change, info["lam"]
