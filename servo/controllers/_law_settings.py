"""The settings of the control law, and the gain that adapts."""

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
"""Degrees of freedom that leave the camera's axis as it is."""
Weight = Annotated[float, Ge(0), Le(1e6)]
Gain = Annotated[float, Ge(1e-6), Le(1000)]
Limit = Annotated[float, Ge(1e-6), Le(100)]
LimitOfChange = Annotated[float, Ge(1e-3), Le(1e6)]


@dataclass(frozen=True, slots=True)
class LawSettings:
    """The control law."""

    gain: Gain = 2.0
    """lambda [1/s], at the goal; with one frame of delay and period T the loop is unstable from
    lambda T = 1 on.
    """
    gain_far: Gain | None = None
    """lambda far from the goal [1/s], for a gain that adapts; by default it is the same."""
    gain_slope: Annotated[float, Ge(0), Le(1e6)] = 30.0
    """How fast lambda falls from the goal outwards: -d lambda / d |L# e| there, |.| the largest
    component as in ViSP's vpAdaptiveGain."""
    smooth_start: Annotated[float, Ge(0), Le(1000)] = 0.0
    """mu [1/s]: the first velocity is taken away at first, and fades in as 1 - exp(-mu t), from the
    first picture on in which all features are known; 0: the camera starts at once.
    """
    dof: tuple[Dof, ...] | None = None
    """Parts of the camera twist that may move; by default all six where there are six features or
    more and the tilt of the target's plane is seen, else vx, vy, vz, wz."""
    weights: tuple[Weight, Weight, Weight, Weight, Weight, Weight] = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
    """How readily each part of the twist moves, where several could; 0.1 on wx and wy keeps a
    camera with all six almost level."""
    secondary: tuple[Secondary, ...] = ()
    """What the motions that change no feature are used for: "level" (optical axis straight down),
    "avoid_limits" (of the joints), "centre" (joints to the middles of their ranges)."""
    secondary_gain: Gain = 1.0
    """Gain of the secondary tasks [1/s]."""
    feed_forward: tuple[str, ...] | None = None
    """Features whose target motion is compensated; those that do not move only add noise. By
    default those that the feature set names: xn and yn of "moments"."""
    matrix: Literal["current", "desired", "mean"] = "current"
    """Where the interaction matrix is taken: at s, at s*, or the mean of both."""
    interval: Literal["mean", "end"] = "mean"
    """Where the matrix is taken for what the camera causes in a frame interval: the mean of both
    ends, or the end, as in ViSP, which is half a frame off."""
    coast: Time = 1.0
    """How long the estimated motion is still followed while the target is not seen [s]; then hold.
    """
    search_after: Time | None = None
    """How long the camera holds before it searches the target on a spiral [s]; by default it never
    does.
    """
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
                raise ValueError(f"{name} has '{twice}' twice")
        if not any(
            weight
            for name, weight in zip(DOF, self.weights, strict=True)
            if name in (UNTILTED if self.dof is None else self.dof)
        ):
            raise ValueError(
                "dof and weights let no part of the twist move; for a camera that stands still "
                'set controller.kind = "hold"'
            )

    def moves(self, *, six: bool) -> NDArray[np.bool_]:
        """Return the degrees of freedom (6,) that may move, where six can be controlled or only
        four.
        """
        chosen = self.dof if self.dof is not None else DOF if six else UNTILTED
        return np.array([name in chosen for name in DOF])

    def moves_for(
        self, features: FeatureSet, known: NDArray[np.bool_], *, tilt_seen: bool
    ) -> NDArray[np.bool_]:
        """Return the degrees of freedom (6,) that may move: while the depth or the angle is not
        known, the part of the twist that it alone controls is zero.

        Args:
            features: What is servoed.
            known: Which of the features (k,) are known.
            tilt_seen: Whether the tilt of the target's plane is.
        """
        moves = self.moves(six=tilt_seen and len(known) >= len(DOF))
        for name, dof in features.sole_dof.items():
            moves[DOF.index(dof)] &= known[features.names.index(name)]
        return moves


def adaptive_gain(config: LawSettings, ahead: Array) -> float:
    """Return lambda(x) = (l0 - linf) exp(-l0' x / (l0 - linf)) + linf, as in ViSP.

    Args:
        config: l0 is its gain, linf its gain_far, l0' its gain_slope.
        ahead: L# e (6,); x is its largest part.
    """
    if config.gain_far is None or config.gain_far == config.gain:
        return config.gain
    x = float(np.abs(ahead).max())
    span = config.gain - config.gain_far
    return span * float(np.exp(-config.gain_slope * x / abs(span))) + config.gain_far
