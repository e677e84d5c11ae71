"""Summary of a run: its outcome, and its measures (numbers that say how well it went), computed
from all of its steps.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from servo.loop.columns import Columns
from servo.loop.measure import COUNTED, MEASURES
from servo.loop.settings import MeasureConfig
from servo.loop.step import Step
from sim.geometry import angle_of, half_turn
from sim.types import Array
from tracking.types import Status

SETTLED_PX = 2.0
SETTLED_RAD = np.radians(1.0)
SETTLED_SCALE = 0.02
"""Errors below which the camera counts as arrived."""
CONVERGED_PX = 10.0
"""Largest servo error in the last part of a run that still counts as holding the target."""
CONVERGED_RAD = np.radians(20.0)
CONVERGED_SCALE = 0.25
"""The same for angle and tilt, and for size, where they are servoed. Two shipped scenarios need so
much: `six_motion` lags by up to 14 deg, and the region of `bad_init` is a fifth too large."""

OFF_UNITS = {"centre": "px", "angle": "deg", "size": "%", "orientation": "deg"}
"""Units of what may be too far from the goal."""


AT_AN_END = 0.1
"""Share of the last second in which a joint is at an end of its range if that keeps the camera from
the goal: such a joint bounces there, and one that touches its end once does not."""


class Outcome(Enum):
    """How a run ended, such as CONVERGED or TARGET_LOST; the value of each member is the sentence
    about it.
    """

    CONVERGED = (
        "The target is at its goal in the picture, with angle, size and tilt where these are "
        "servoed."
    )
    TIMED_OUT = "The run ended before the camera was at the goal."
    TARGET_LOST = "The tracker lost the target."
    LIMIT_HIT = "A limit of the robot keeps the camera from the goal."
    DIVERGED = "The target has left the picture, and no tracker has called it lost."

    def sentence(self, limits: Sequence[str] = (), off: Sequence[str] = ()) -> str:
        """Return the sentence of this outcome, with its causes, if there are any.

        Args:
            limits: The limits of joints that kept the camera from the goal: "elbow (range)".
            off: What was too far from the goal in the last second: "angle 27 deg".
        """
        sentence = self.value[:-1]
        if limits:
            at_limits = "; joints at their limits" if off else ""
            sentence += f"{at_limits}: {', '.join(limits)}"
        if off:
            sentence += f"; largest errors of its last second: {', '.join(off)}"
        return f"{sentence}."


@dataclass(frozen=True, slots=True)
class Summary:
    """How one run ended and how well it went: its outcome, its measures by name (such as
    "servo_rms_px", in the unit that the name ends with), the joint limits that kept the camera from
    its goal, and the quantities, such as "angle 27 deg", that were too far from the goal at the
    end.
    """

    outcome: Outcome
    measures: dict[str, float]
    """Values by name, in the order of `MEASURES`; infinite or nan where there is none."""
    limits: tuple[str, ...] = ()
    """The limits of joints, such as "elbow (range)", that were hit. With the outcome LIMIT_HIT: all
    in the last second. With CONVERGED: none. With another outcome: only ends of ranges, in the last
    second in which the target was not lost."""
    off: tuple[str, ...] = ()
    """The servoed quantities that were too far from the goal in the last second, each with its
    largest distance from the goal, such as "angle 27 deg"; none unless the outcome is
    TIMED_OUT."""


def summarise(steps: Columns | Iterable[Step], config: MeasureConfig, period: float) -> Summary:
    """Return how a run ended, and its measures. A measure is inf or nan where it has no value:
    those that count from `config.after` on are nan if the run ended before.

    Args:
        steps: The steps of the run, at least one, or their columns.
        config: The time from which errors count [s], and the distance of the target from its goal
            above which the camera is off the target [px].
        period: Frame interval [s].
    """
    run = Columns.of(steps)
    final = list(run.final)
    late = run["time"] >= config.after
    # A run that ended before that time has no such frames: its measures become nan below.
    counted = late if late.any() else np.ones_like(late)
    servo = run["servo"][counted]
    turned = np.degrees(_servo_angles(run["turned"], final[-1]))
    grown = 100 * (run["size"] / run["goal_size"] - 1)
    velocities = _velocities(run["carried"], period)
    late_turned, late_grown = turned[counted], grown[counted]
    # A repeated estimate counts once.
    estimated = counted & run["decided"] & _of_pictures(run)
    estimated = estimated if estimated.any() else counted
    tracked = run["tracking"][estimated]
    values = {
        "servo_rms_px": _rms(servo),
        "servo_peak_px": servo.max(),
        "servo_angle_rms_deg": _rms(late_turned),
        "servo_angle_peak_deg": np.abs(late_turned).max(),
        "servo_scale_rms_pct": _rms(late_grown),
        "servo_scale_peak_pct": np.abs(late_grown).max(),
        "not_held_pct": 100 * float(np.mean(servo > CONVERGED_PX)),
        # Settling is about the whole run, whatever `measure.after` leaves out.
        "settle_s": _settling_time(run["time"], run["servo"], turned, grown),
        "longest_off_s": _longest(servo > config.above) * period,
        "tracking_rms_px": _rms(tracked),
        "tracking_peak_px": tracked.max(),
        "tracking_angle_rms_deg": _rms(np.degrees(run["tracking_angle"][estimated])),
        "tracking_scale_rms_pct": _rms(100 * (run["tracking_scale"][estimated] - 1)),
        "tilt_peak_deg": np.degrees(run["tilt"][counted].max()),
        "joint_range_peak_pct": 100 * run["range_used"][counted].max(),
        "end_speed_mm_s": 1e3 * _rms_length(velocities[-len(final) :]),
        "acceleration_peak_m_s2": _largest_change(velocities[counted]) / period,
        **_effort(run["command"][counted & run["decided"]]),
        "joint_way_pct": _joint_way(run),
        "saturated_pct": 100 * np.mean(run["saturated"]),
        "unseen_pct": 100 * np.mean(~run["seen"]),
        "lost_pct": 100 * np.mean(run["lost"]),
        "age_ms": 1e3 * np.mean(_where(run["other_picture"], run["age"])),
        "skipped_pct": 100 * final[-1].skipped / len(run),
        **_path_measures(run["camera"], final[-1]),
        "camera_turn_deg": np.degrees(sum(map(angle_of, _turns(run["orientation"])))),
        "excursion_px": _excursion(run),
        "out_of_view_pct": 100 * float(np.mean(run["out_of_view"])),
        "step_ms": 1e3 * float(np.median(timed(run).sum(axis=1))),
    }
    if not late.any():
        values |= dict.fromkeys(COUNTED, np.nan)
    outcome = _outcome(final)
    limits = () if outcome is Outcome.CONVERGED else _limits_met(run, outcome)
    off = _worst_off(final) if outcome is Outcome.TIMED_OUT else ()
    return Summary(outcome, {name: float(values[name]) for name in MEASURES}, limits, off)


def timed(run: Columns) -> Array:
    """Return the wall-clock times (n, 4) [s] of rendering, tracker, control law and physics in the
    n steps whose `Step.tracked` is True (the tracker was called); in all steps if there are none.

    A slow tracker is called in few steps, so a median over all steps would not show its time.
    """
    return _where(run["tracked"], run["seconds"])


def _where(flags: NDArray[np.bool_], values: Array) -> Array:
    """Return the rows of an array (n, ...) whose flag (n,) is True; all rows if no flag is True."""
    return values[flags] if flags.any() else values


def _turns(orientations: Array) -> Array:
    """Return the rotations (n - 1, 3, 3) from each of n orientations (n, 3, 3) to the next one."""
    return orientations[:-1].transpose(0, 2, 1) @ orientations[1:]


def _excursion(run: Columns) -> float:
    """Return the largest distance of a corner of the target from the middle of the picture [px]."""
    camera = run.first.scene.camera
    middle = np.array([camera.width, camera.height]) / 2
    return float(np.linalg.norm(run["corners"] - middle, axis=-1).max())


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _velocities(carried: Array, period: float) -> Array:
    """Return the mean velocities (n, 3) in the world frame [m/s] of what the robot carries (camera
    or target), over the frame interval before each of n frames; zero for the first frame.

    In the frame of a turning camera even a constant velocity would change.

    Args:
        carried: Positions (n, 3) of the camera or target in the world frame [m].
        period: Frame interval [s].
    """
    return np.diff(carried, axis=0, prepend=carried[:1]) / period


def _largest_change(vectors: Array) -> float:
    """Return the largest length of the difference between two successive vectors of (n, 3), in
    their unit; 0 for fewer than two vectors.
    """
    return float(np.linalg.norm(np.diff(vectors, axis=0), axis=1).max(initial=0.0))


def _effort(commands: Array) -> dict[str, float]:
    """Return two measures of control effort by name: the root mean square of the changes from one
    commanded twist (n, 6) [m/s, rad/s] to the next, of the linear part [mm/s] and of the angular
    part [deg/s].
    """
    linear, angular = np.hsplit(np.diff(commands, axis=0), 2)
    return {
        "effort_rms_mm_s": 1e3 * _rms_length(linear),
        "effort_rms_deg_s": float(np.degrees(_rms_length(angular))),
    }


def _rms_length(vectors: Array) -> float:
    """Return the root mean square of the lengths of vectors (n, 3), in their unit; 0 for n = 0."""
    return float(np.sqrt(np.square(vectors).sum() / max(len(vectors), 1)))


def _joint_way(run: Columns) -> float:
    """Return the distance that a joint has travelled in the run over the length of its range, as a
    mean over the joints that have limits [%]; 0 if none has.
    """
    posture = run.first.posture
    span = posture.upper - posture.lower
    limited = np.isfinite(span) & (span > 0)
    if not limited.any():
        return 0.0
    joints = run["joints"][:, limited]
    return float(100 * np.mean(np.abs(np.diff(joints, axis=0)).sum(axis=0) / span[limited]))


def _longest(flags: NDArray[np.bool_]) -> int:
    """Return the largest number of successive flags that are True."""
    best = run = 0
    for flag in flags:
        run = run + 1 if flag else 0
        best = max(best, run)
    return best


def _settling_time(times: Array, servo: Array, turned: Array, grown: Array) -> float:
    """Return the time of the run from which on all errors stay within 2 px, 1 degree and 2 % of
    size until its end [s]; inf if some error is not within them at the end.

    Args:
        times: Times (n,) [s].
        servo: Distances (n,) of the target's centre from its goal [px].
        turned: Errors (n,) of the target's angle [deg].
        grown: Errors (n,) of the target's size in the picture [%].
    """
    # The run has settled after the last frame in which any of the three errors was too large.
    off = (
        (servo > SETTLED_PX)
        | (np.abs(turned) > np.degrees(SETTLED_RAD))
        | (np.abs(grown) > 100 * SETTLED_SCALE)
    )
    if off[-1]:
        return float("inf")
    last = int(np.max(np.nonzero(off)[0], initial=-1))
    return float(times[last + 1])


def _outcome(final: Sequence[Step]) -> Outcome:
    """Return how a run ended, decided by the steps of its last second."""
    last = final[-1]
    height, width = last.frame.image.shape[:2]
    inside = np.all((last.truth.centre >= 0) & (last.truth.centre <= (width, height)))
    pixels = last.goal_sight.picture is not None  # nobody asks the tracker then
    if last.estimate.status is Status.LOST and not pixels:
        return Outcome.TARGET_LOST
    # The camera has passed the target, which is behind it now.
    if last.truth.depth <= 0:
        return Outcome.DIVERGED
    if not any(_off(s) for s in final):
        return Outcome.CONVERGED
    # A speed limit may act for a moment in any run; a joint at the end of its range stays there.
    if all(s.limited for s in final) or _stays_at_an_end(final):
        return Outcome.LIMIT_HIT
    return Outcome.TIMED_OUT if inside else Outcome.DIVERGED


def _limits_met(run: Columns, outcome: Outcome) -> tuple[str, ...]:
    """Return the names of the limits that joints hit at the end of a run. With the outcome
    `LIMIT_HIT` these are all limits of its last second; otherwise only the ends of joint ranges, in
    the last second in which the target was followed.
    """
    if outcome is Outcome.LIMIT_HIT:
        return _limits(run.final)
    return tuple(filter(_ends_a_range, _limits(run.followed)))


def _limits(steps: Iterable[Step]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name for s in steps for name in s.joint_limits))


def _stays_at_an_end(final: Sequence[Step]) -> bool:
    """Return True if a joint was at an end of its range in a share `AT_AN_END` of the steps."""
    ends = Counter(filter(_ends_a_range, (name for s in final for name in s.joint_limits)))
    return max(ends.values(), default=0) > AT_AN_END * len(final)


def _ends_a_range(limit: str) -> bool:
    return limit.endswith("(range)")


def _of_pictures(run: Columns) -> NDArray[np.bool_]:
    """Return True (n,) for each step whose estimate is of a picture, not repeated for a frame that
    was dropped.
    """
    count = len(run["fresh"])
    of = np.arange(count) + run["picture"].astype(int)
    return np.where(of < 0, True, run["fresh"][np.maximum(of, 0)])


def _off(step: Step) -> dict[str, float]:
    """Return the servoed quantities ("centre" [px], "angle" [deg], "size" [%], "orientation" [deg])
    that are too far from the goal for convergence, each with its distance from the goal.
    """
    angle, size = step.servoed
    # Pixels determine the distance, too, whatever a tracker follows.
    size |= step.goal_sight.picture is not None and step.servoes_pose
    grown = abs(step.truth.size / step.goal.size - 1)
    found = dict[str, float]()
    if step.servo_error > CONVERGED_PX:
        found["centre"] = step.servo_error
    if angle:
        apart = np.array([step.truth.theta - step.goal.theta])
        turned = abs(_servo_angles(apart, step)[0])
        if turned > CONVERGED_RAD:
            found["angle"] = np.degrees(turned)
    if size and grown > CONVERGED_SCALE:
        found["size"] = 100 * grown
    if step.rotation_error > CONVERGED_RAD and step.servoes_pose:
        found["orientation"] = np.degrees(step.rotation_error)
    return found


def _worst_off(steps: Sequence[Step]) -> tuple[str, ...]:
    """Return texts such as "angle 12 deg": each servoed quantity that is too far from the goal in
    at least one of the steps, with its largest distance from the goal.
    """
    most = dict[str, float]()
    for step in steps:
        for name, value in _off(step).items():
            most[name] = max(value, most.get(name, 0.0))
    return tuple(f"{name} {value:.0f} {OFF_UNITS[name]}" for name, value in most.items())


def _servo_angles(apart: Array, last: Step) -> Array:
    """Return angle errors (n,) [rad], wrapped to -pi..pi if the features distinguish the target's
    nose from its rear, otherwise to -pi/2..pi/2.

    Args:
        apart: True minus desired angles of the target (n,), not wrapped [rad].
        last: The last step of the run.
    """
    nearer = np.array([half_turn(angle) for angle in apart])
    if not last.tells_front_from_back:
        return nearer
    # Beyond a quarter turn the target points away from its goal, so the full turn counts.
    whole = np.angle(np.exp(1j * apart))
    return np.where(np.abs(whole) > np.pi / 2, whole, nearer)


def _path_measures(places: Array, last: Step) -> dict[str, float]:
    """Return six measures by name of the camera's path relative to the target: its length, detour,
    retreat and advance [m], and the distances of its end from the goal [mm, deg].

    Args:
        places: Positions of the camera (n, 3) in the frame of the target's reference rectangle,
            whose origin is the rectangle's centre [m]; one for each step.
        last: The last step, which has the goal.
    """
    goal = last.T_object_goal
    there = goal.translation
    path = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
    away = np.linalg.norm(places, axis=1)
    ends = [np.linalg.norm(places[0]), np.linalg.norm(there)]
    turn = goal.rotation.T @ last.T_object_camera.rotation
    return {
        "camera_path_m": path,
        "detour_m": path - float(np.linalg.norm(places[0] - places[-1])),
        "retreat_m": max(0.0, float(away.max() - max(ends))),
        "advance_m": max(0.0, float(min(ends) - away.min())),
        "end_position_mm": 1e3 * float(np.linalg.norm(places[-1] - there)),
        "end_rotation_deg": float(np.degrees(angle_of(turn))),
    }
