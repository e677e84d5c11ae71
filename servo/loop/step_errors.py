"""Numbers about one step: angles, sizes, and how far a joint is."""

from __future__ import annotations

import numpy as np

from servo.loop.step import Step
from sim.geometry import half_turn


def servo_angle(step: Step) -> float:
    """Return the true angle against the goal, over half a turn [rad]."""
    return half_turn(step.truth.theta - step.goal_theta)


def tracking_angle(step: Step) -> float:
    """Return the estimated angle against the true one [rad], over the full turn: a tracker that
    takes front for back is wrong by pi.
    """
    return float(np.angle(np.exp(1j * (step.estimate.state.theta - step.truth_estimated.theta))))


def tracking_scale(step: Step) -> float:
    """Return the estimated size over the true one, minus 1."""
    return step.estimate.state.scale / step.true_state_estimated.scale - 1


def range_used(step: Step) -> float:
    """Return how far the joint nearest to a limit is from the middle of its range, over half of
    that.
    """
    p = step.posture
    limited = np.isfinite(p.lower) & np.isfinite(p.upper)
    half = (p.upper[limited] - p.lower[limited]) / 2
    return float(np.max(1 - step.margins[limited] / half, initial=0.0))


def speed(step: Step) -> float:
    """Return the speed of the camera [m/s]."""
    return float(np.linalg.norm(step.posture.twist[:3]))
