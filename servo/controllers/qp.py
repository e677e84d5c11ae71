"""Controller that keeps the law of `ibvs` within limits of speed, joints and view (control barrier
functions, Ames et al. 2019), by one quadratic programme per picture.

With v* the twist of `ibvs`, L the interaction matrix of the features, q the joints' positions with
the limits lower and upper, J# the pseudo-inverse of the robot's Jacobian, and capitals for
constants:

    minimise |L (v - v*)|^2 + DAMPING |v - v*|^2, so that
    |v_i| <= fastest, |w_i| <= fastest_turn                                          (speed)
    RANGE_GAIN (lower - q) <= J# v <= RANGE_GAIN (upper - q), and the joints' rates  (joints)
    dh/dt >= -VIEW_GAIN h, for the distance h of each corner from each side          (view)

If v* breaks no limit, v is v*. In the last line h is a control barrier function: it decays at most
exponentially, and stays positive. Speed and joints are hard limits, which a camera at rest keeps.
The view is a soft limit, so that each programme has a solution: if the view cannot be kept, the sum
of squared violations is minimal. Finally the whole twist is shortened to `fastest` and
`fastest_turn`, and by the limits of acceleration, which the programme does not contain.

The programme looks no further than one frame, so the camera may stop with the target at a side of
the picture, away from the goal.

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
from servo.controllers._bounds import UNBOUNDED, Bounds, joint_bounds, speed_bounds, view_bounds
from servo.controllers._inverse import RANK_TOLERANCE
from servo.controllers._law_settings import LawSettings
from servo.controllers._limits import DesiredTwist, LimitedTwist, excess
from servo.parts import Task
from servo.types import DOF
from sim.types import Array

SOFT = 8
"""DAQP's flag of a soft constraint."""
DAMPING = 1e-3
"""Weight of changes of the twist, relative to changes of the features."""
EXACT = 1e-9
"""Largest excess over a bound that counts as rounding error."""
VIEW_GAIN = 5.0
"""Largest rate at which a corner may approach a side, over the distance left [1/s]; at most the
frame rate counts. Chosen by hand: the distance may shrink to 1 % in a second."""
LEAVING = 1.0
"""Excess speed of a corner from which the limit of the view counts as violated [px/s]."""


@dataclass(frozen=True, slots=True)
class Config(LawSettings):
    """Settings of the controller `qp`: those of the controller `ibvs`, and the distance that the
    target's corners should keep from the sides of the picture [px], a soft limit.
    """

    margin: Annotated[float, Ge(0), Le(10_000)] = 10.0
    """Distance that the target's corners should keep from the sides of the picture [px]: a soft
    limit, which is violated as little as possible where it cannot be kept."""

    def build(self, rng: np.random.Generator) -> ibvs.Ibvs:
        """Return the controller, which uses no random numbers."""
        return ibvs.Ibvs(self, Programme(self))


@final
class Programme:
    """Limits the camera twist of the controller `ibvs` by the camera's speed, the joints' ranges
    and rates, and the sides of the picture, which the target's corners should not leave. It solves
    one quadratic programme per picture.
    """

    def __init__(self, config: Config) -> None:
        self._margin = config.margin
        self._fastest = config.fastest
        self._fastest_turn = config.fastest_turn
        self._speed = speed_bounds(config.fastest, config.fastest_turn)

    def start(self, task: Task) -> None:
        """Begin a run with a task, of which only the camera is used.

        Raises:
            ValueError: The margin [px] is half the shorter side of the picture or more.
        """
        self._camera = task.camera
        most = min(task.camera.width, task.camera.height) / 2
        if self._margin >= most:
            raise ValueError(
                f"controller.margin = {self._margin:g}: nothing is left of a picture of "
                f"{task.camera.width} x {task.camera.height} px: set a margin below {most:g}"
            )

    def limited(self, desired: DesiredTwist) -> LimitedTwist:
        """Return the camera twist within the limits that changes the features most nearly as the
        desired one does, after that was scaled down to the largest speeds; zero if the solver finds
        no solution. Limits of joints, and of each component of the speed, are hard; those of the
        view are kept as far as possible. The result also has the names of the active limits, and of
        the limits of the view that are violated.

        Args:
            desired: The twist of the control law before any limit, with the state of robot and
                target.
        """
        fast = max(1.0, excess(desired.twist, self._fastest, self._fastest_turn))
        law = desired.twist / fast
        limits = ("speed",) * (fast > 1.0)
        hard, view = self._bounds(desired)
        bounds = hard + view
        over = bounds.excess(law)
        # A twist of nan passes: the loop then names the component that it came from.
        if not (np.abs(over) > EXACT).any():
            return LimitedTwist(law, limits)
        # Only the rows of the view may be violated.
        sense = np.zeros(len(over), np.intc)
        sense[len(hard.A) :] = SOFT
        change, active = _change(desired, bounds, law, sense)
        names = dict.fromkeys((*limits, *bounds.names_at(active)))
        left = view.excess(law + change)
        violated = view.names_at(left * (np.abs(left) > LEAVING))
        return LimitedTwist(law + change, tuple(names), violated)

    def _bounds(self, desired: DesiredTwist) -> tuple[Bounds, Bounds]:
        """Return the hard bounds of the twist (speed, joints), and the soft ones of the view, which
        are empty if the target is not seen or has no corners.
        """
        joints = joint_bounds(desired.posture, desired.way, desired.dt)
        hard = self._speed if joints is None else self._speed + joints
        seen = desired.seen
        if seen is None or seen.corners is None:
            return hard, UNBOUNDED
        gain = min(VIEW_GAIN, 1 / desired.dt)
        return hard, view_bounds(desired, seen, self._camera, self._margin, gain)


def _change(
    desired: DesiredTwist, bounds: Bounds, law: Array, sense: NDArray[np.intc]
) -> tuple[Array, Array]:
    """Return the least change (6,) of the law's twist that keeps the bounds, and the Lagrange
    multipliers (m,) of the bounds: positive at an active upper bound, negative at an active lower
    one, else 0.

    If no component may move, or DAQP finds no solution, the change is -law: the camera stops, which
    keeps all hard bounds. The law's excess over each bound then stands in place of the multipliers.

    Args:
        desired: Interaction matrix of the features, and the components of the twist that may move.
        bounds: Hard and soft bounds of the twist.
        law: Camera twist (6,) of the law [m/s, rad/s].
        sense: DAQP's flags (m,): 8 for a soft bound, 0 for a hard one.
    """
    # The unknown of the programme is the change from the law's twist, in the basis B.
    B = _basis(desired)
    if not B.shape[1]:
        return -law, bounds.excess(law)
    L = desired.L @ B
    A = np.ascontiguousarray(bounds.A @ B)
    n = B.shape[1]
    at = bounds.A @ law
    H = L.T @ L + DAMPING * np.eye(n)
    found, _, flag, info = daqp.solve(
        H, np.zeros(n), A, bounds.upper - at, bounds.lower - at, sense
    )
    if flag <= 0:
        return -law, bounds.excess(law)
    return B @ found, info["lam"]


def _basis(desired: DesiredTwist) -> Array:
    """Return unit vectors (6, n) that span the twists which may change: those of the degrees of
    freedom that may move, or, for a robot with fewer than six joints, what its joints can make.
    """
    jacobian = desired.posture.jacobian
    if not 0 < jacobian.shape[1] < len(DOF):  # 0: a robot that takes any twist
        return np.eye(len(DOF))[:, desired.moves]
    basis, strengths, _ = np.linalg.svd(jacobian, full_matrices=False)
    return basis[:, strengths > RANK_TOLERANCE * strengths[0]]
