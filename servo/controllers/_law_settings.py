"""Settings that the control laws `ibvs` and `qp` share, and the adaptive gain that they use."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from servo.controllers._inverse import Secondary
from servo.parts import FeatureSet
from servo.types import DOF
from sim.ranges import Time
from sim.types import Array

Dof = Literal["vx", "vy", "vz", "wx", "wy", "wz"]
UNTILTED = ("vx", "vy", "vz", "wz")
"""Degrees of freedom that do not tilt the optical axis."""
Weight = Annotated[float, Ge(0), Le(1e6)]
Gain = Annotated[float, Ge(1e-6), Le(1000)]
Limit = Annotated[float, Ge(1e-6), Le(100)]
LimitOfChange = Annotated[float, Ge(1e-3), Le(1e6)]


@dataclass(frozen=True, slots=True)
class LawSettings:
    """Settings of a control law v = -gain L# e: gains, degrees of freedom, secondary tasks, limits
    of speed and acceleration, and what the camera does while the target is not seen.
    """

    gain: Gain = 2.0
    """Gain lambda at the goal [1/s]; with one frame of delay and period T the loop is unstable from
    lambda T = 1 on.
    """
    gain_far: Gain | None = None
    """Gain lambda far from the goal [1/s], for an adaptive gain; by default equal to `gain`."""
    gain_slope: Annotated[float, Ge(0), Le(1e6)] = 30.0
    """Slope -d lambda / d |L# e| of the adaptive gain at the goal, where |.| is the largest
    component, as in ViSP's vpAdaptiveGain."""
    smooth_start: Annotated[float, Ge(0), Le(1000)] = 0.0
    """Rate mu of a smooth start [1/s]: the first velocity fades in as 1 - exp(-mu t), with the time
    t from the first picture, and anew from one that measures further features; 0: the camera starts
    at once.
    """
    dof: tuple[Dof, ...] | None = None
    """Components of the camera twist that may move; by default all six if there are six features or
    more and the tilt of the target's plane is measured, else vx, vy, vz, wz."""
    weights: tuple[Weight, Weight, Weight, Weight, Weight, Weight] = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
    """Weights of the components of the twist, if several could reduce the error; 0.1 for wx and wy
    keeps a camera with six degrees of freedom almost level."""
    secondary: tuple[Secondary, ...] = ()
    """Secondary tasks for the motions that change no feature: "level" (optical axis straight down),
    "avoid_limits" (of the joints), "centre" (joints to mid-range)."""
    secondary_gain: Gain = 1.0
    """Gain of the secondary tasks [1/s]."""
    feed_forward: tuple[str, ...] | None = None
    """Features whose target motion is compensated; features that do not move would only add noise.
    By default those of the feature set: xn and yn of "moments"."""
    matrix: Literal["current", "desired", "mean"] = "current"
    """Point at which the interaction matrix is computed: at s, at s*, or the mean of both."""
    interval: Literal["mean", "end"] = "mean"
    """Interaction matrix for the effect of the camera's motion in a frame interval: the mean of
    both ends, or that of the end, as in ViSP, which is half a frame late."""
    coast: Time = 1.0
    """Time for which the camera follows the estimated motion while the target is not seen [s]; then
    it holds."""
    search_after: Time | None = None
    """Time for which the camera holds before it searches the target on a spiral [s]; by default it
    never searches."""
    search_speed: Limit = 0.1
    """Speed of the camera while it searches [m/s]."""
    fastest: Limit = 0.6
    """Largest speed of the camera [m/s]."""
    fastest_turn: Limit = 2.0
    """Largest angular speed of the camera [rad/s]."""
    acceleration: LimitOfChange | None = None
    """Largest acceleration of the camera [m/s^2]; by default the drives' own."""
    acceleration_turn: LimitOfChange | None = None
    """Largest angular acceleration of the camera [rad/s^2]; by default the drives' own."""

    def __post_init__(self) -> None:
        for name in ("dof", "secondary", "feed_forward"):
            given = getattr(self, name) or ()
            twice = next((item for i, item in enumerate(given) if item in given[:i]), None)
            if twice is not None:
                raise ValueError(f"the list {name} has '{twice}' twice: leave one out")
        if not self.may_move(six=True):
            raise ValueError(
                "dof and weights let no component of the twist move: name components in dof or "
                "leave it out, and give one of them a weight above 0; for a camera that stands "
                'still set controller.kind = "hold"'
            )

    def may_move(self, *, six: bool) -> bool:
        """Return whether at least one component of the camera twist may move and has a positive
        weight.

        Args:
            six: Whether the features control all six degrees of freedom, or four (vx, vy, vz, wz).
        """
        return bool((self.moves(six=six) & (np.array(self.weights) > 0)).any())

    def moves(self, *, six: bool) -> NDArray[np.bool_]:
        """Return True (6,) for each component of the camera twist (vx, vy, vz, wx, wy, wz) that
        `dof` names; without `dof`, for all six or for vx, vy, vz, wz. Weights are not considered.

        Args:
            six: Whether all six may move if `dof` is not set; otherwise vx, vy, vz, wz.
        """
        chosen = self.dof if self.dof is not None else DOF if six else UNTILTED
        return np.array([name in chosen for name in DOF])

    def moves_for(
        self, features: FeatureSet, known: NDArray[np.bool_], *, tilt_seen: bool
    ) -> NDArray[np.bool_]:
        """Return True (6,) for each component of the camera twist that may move with the features
        of a picture. If a feature alone controls a component (as `an` controls vz), this component
        stands still while the feature is not measured.

        Args:
            features: The feature set.
            known: True (k,) for each feature that is measured in the picture.
            tilt_seen: Whether the tilt of the target's plane is measured; without that only vx, vy,
                vz, wz may move, if `dof` is not set.
        """
        moves = self.moves(six=tilt_seen and len(known) >= len(DOF))
        for name, dof in features.sole_dof.items():
            moves[DOF.index(dof)] &= known[features.names.index(name)]
        return moves


def adaptive_gain(config: LawSettings, ahead: Array) -> float:
    """Return the gain lambda(x) = (l0 - linf) exp(-l0' x / |l0 - linf|) + linf [1/s], as ViSP's
    vpAdaptiveGain does: l0 at the goal, towards linf far from it.

    Args:
        config: Settings with l0 (`gain`), linf (`gain_far`) and l0' (`gain_slope`); without
            `gain_far` the gain is l0.
        ahead: The twist L# e (6,), in m and rad; x is the largest absolute value in it.
    """
    if config.gain_far is None or config.gain_far == config.gain:
        return config.gain
    x = float(np.abs(ahead).max())
    span = config.gain - config.gain_far
    return span * float(np.exp(-config.gain_slope * x / abs(span))) + config.gain_far
