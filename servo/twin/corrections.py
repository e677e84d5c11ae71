"""The mistakes that a robot's log or the film of its camera may have, each as the correction that
takes it back.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from enum import Enum
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from servo.twin.robot_motion import RobotMotion, of_poses, of_twists
from sim.types import Array

AXES = "xyz"
DEGREE = np.pi / 180


class Kind(Enum):
    """Kind of the values in a log from which the motion of the robot's hand follows."""

    POSES = "poses"
    """x, y, z [m] and a quaternion x, y, z, w."""
    TWISTS = "twists"
    """vx, vy, vz [m/s] and wx, wy, wz [rad/s] in the hand's frame."""
    JOINTS = "joints"
    """Positions of the joints [m, rad]."""


class Frame(Enum):
    """The frame in which a part of a twist is given."""

    HAND = "hand"
    BASE = "base"


@dataclass(frozen=True, slots=True)
class Smooth:
    """The motion in a robot's log, smoothed on an even grid of times: poses of the hand, twists of
    the hand or joint positions; with joint positions (n, k) [m, rad], a function that returns the
    poses (n, 7) of the hand: x, y, z [m] and a quaternion x, y, z, w.
    """

    kind: Kind
    times: Array
    """The grid (n,) [s]."""
    values: Array
    """The values (n, k)."""
    names: tuple[str, ...]
    """Names of the values."""
    poses_of: Callable[[Array], Array] | None = None
    """Forward kinematics, for joints."""
    is_inverse: bool = False
    """True if the camera stands still and films what the hand carries: seen from the hand, the base
    with the camera moves."""


@dataclass(frozen=True, slots=True)
class Correction:
    """Correction of a mistake in a robot's log or in the film of its camera: a change of the log's
    values, other frames of its twists, a rotation of their linear part or of the positions, a
    mirroring of the film, or a factor on its times.
    """

    mistake: str
    """The mistake, as a clause such as "w is in degrees"."""
    remedy: str
    """What to change, in the imperative."""
    change: Callable[[Array], Array] | None = None
    frames: tuple[Frame, Frame] | None = None
    """Frames of v and of w, in a log of twists."""
    turn: Array | None = None
    """Orientation (3, 3) of the frame of w in that of v; in a log of poses, of the frame of the
    orientations in that of the positions. It is the identity until it is found."""
    flips: tuple[float, float] = (1.0, 1.0)
    """Signs of x and y in the film."""
    stretch: float = 1.0
    """Factor on the film's times."""
    is_usual: bool = False
    """True for a mistake that is often made: of equal explanations it is the more likely one."""


def millimetres(smooth: Smooth) -> Correction:
    """Return the correction of a log whose lengths are in millimetres: it divides them by 1000."""
    columns = [0, 1, 2]
    if smooth.kind is Kind.JOINTS:
        columns = [k for k, name in enumerate(smooth.names) if name.endswith("_m")]
    return Correction(
        "lengths are in millimetres",
        "log lengths in m: the present numbers over 1000",
        _scaled(columns, 1e-3),
    )


def disguises(smooth: Smooth) -> list[Correction]:
    """Return the corrections of mistakes that hide the motion of a log, each alone: another rate of
    the film, and joint angles in degrees, with which the hand seems to spin.
    """
    turning = [k for k, name in enumerate(smooth.names) if name.endswith("_rad")]
    return [*rates(), *([_degrees(turning)] if smooth.kind is Kind.JOINTS and turning else [])]


def _degrees(turning: list[int]) -> Correction:
    return Correction(
        "the joints' angles are in degrees",
        "log angles in rad: the present numbers over 57.3",
        _scaled(turning, DEGREE),
    )


def motion(smooth: Smooth, *corrections: Correction) -> RobotMotion:
    """Return the motion of the robot's hand that follows from a log, after corrections of the log's
    values and of the frame of its twists. For a camera that stands still (`is_inverse`) it is the
    motion of the base in the hand's frame. Flips and stretches of the film have no effect here.
    """
    values = smooth.values
    frames = Frame.HAND, Frame.HAND
    turn = np.eye(3)
    for each in corrections:
        values = values if each.change is None else each.change(values)
        frames = each.frames or frames
        turn = turn if each.turn is None else each.turn
    if smooth.poses_of is not None:
        values = smooth.poses_of(values)
    values = np.hstack([values[:, :3] @ turn, values[:, 3:]])
    if smooth.kind is Kind.TWISTS:
        return of_twists(smooth.times, _in_hand(smooth.times, values, *frames))
    moved = of_poses(smooth.times, values)
    return moved.inverse if smooth.is_inverse else moved


def _in_hand(times: Array, twists: Array, of_v: Frame, of_w: Frame) -> Array:
    """Return twists (n, 6) in the hand's frame, which begins along the base's, from v and w in
    frames of their own.
    """
    if Frame.BASE not in (of_v, of_w):
        return twists
    # w in the base's frame turns from the left: the inverse turns by -w from the right.
    sign = -1 if of_w is Frame.BASE else 1
    turned = of_twists(times, np.hstack([np.zeros_like(twists[:, :3]), sign * twists[:, 3:]]))
    there = Rotation.from_quat(turned.turns)
    into = there if of_w is Frame.BASE else there.inv()
    parts = zip((of_v, of_w), (twists[:, :3], twists[:, 3:]), strict=True)
    return np.hstack([into.apply(x) if frame is Frame.BASE else x for frame, x in parts])


def corrections(smooth: Smooth) -> list[Correction]:
    """Return the corrections that a log and its film may need, each alone: those for the kind of
    the log's values, and that of a mirrored film. `rates`, `millimetres` and `mixed` have further
    ones.
    """
    of_log = {Kind.POSES: _of_poses, Kind.TWISTS: _of_twists, Kind.JOINTS: _of_joints}[smooth.kind]
    return [*of_log(smooth.names), MIRRORED]


MIRRORED = Correction(
    "the film is mirrored",
    "record the film without mirroring (a setting of the camera's driver), or flip it left to "
    "right",
    flips=(-1.0, 1.0),
    is_usual=True,
)


def rates() -> Iterator[Correction]:
    """Yield the corrections of films whose true rate is another usual one than the given rate (such
    as 25 Hz and not 30): each stretches the film's times.
    """
    for true, given in ((25, 30), (24, 30), (30, 25), (15, 30), (30, 15), (60, 30), (30, 60)):
        yield Correction(
            f"the film's times run {true / given:.4g} times as fast as the log's",
            f"give the film's true rate: {true / given:.4g} times the present one (--rate for a "
            "folder)",
            stretch=given / true,
        )


def _scaled(columns: NDArray[np.int64] | list[int], factor: float) -> Callable[[Array], Array]:
    """Return a function that multiplies columns of values (n, k) by a factor."""

    def change(values: Array) -> Array:
        factors = np.ones(values.shape[1])
        factors[columns] = factor
        return values * factors

    return change


def _ordered(order: NDArray[np.int64] | list[int]) -> Callable[[Array], Array]:
    """Return a function that puts the columns of values (n, k) into another order."""

    def change(values: Array) -> Array:
        return values[:, order]

    return change


def _orders(what: str, first: int, width: int) -> Iterator[Correction]:
    """Yield the five other orders of three columns of values (n, width), from `first` on."""
    for order in list(permutations(range(3)))[1:]:
        columns = np.arange(width)
        columns[first : first + 3] = first + np.array(order)
        has = ", ".join(AXES[k] for k in np.argsort(order))
        yield Correction(
            f"the axes of {what} are exchanged: its columns x, y, z are {has}",
            f"log {what} with its axes x, y, z in this order: the present columns "
            f"{', '.join(AXES[k] for k in order)}",
            _ordered(columns),
        )


def _signs(what: str, first: int) -> Iterator[Correction]:
    """Yield the changes of sign of one of three columns of values, from `first` on, and of all."""
    for k, axis in enumerate(AXES):
        yield Correction(
            f"the sign of {axis} of {what} is wrong",
            f"log {axis} of {what} with the other sign",
            _scaled([first + k], -1.0),
            is_usual="quaternion" not in what,
        )
    yield Correction(
        f"{what} has the wrong sign in all axes",
        f"log {what} with the other sign: of the hand in the base, not of the base in the hand",
        _scaled([first, first + 1, first + 2], -1.0),
    )


def _of_poses(names: tuple[str, ...]) -> Iterator[Correction]:
    yield from _orders("the position", 0, 7)
    yield from _signs("the position", 0)
    yield from _orders("the quaternion's vector", 3, 7)
    yield from _signs("the quaternion's vector", 3)
    for order, name in (([4, 5, 6, 3], "w, x, y, z"), ([6, 3, 4, 5], "y, z, w, x")):
        columns = np.array([0, 1, 2, *order])
        parts = zip(names[3:] or ("qx", "qy", "qz", "qw"), name.split(", "), strict=True)
        yield Correction(
            f"the quaternion's numbers are in the order {name}",
            "log each part of the quaternion in the column of its name: now "
            + ", ".join(f"{column} holds {part}" for column, part in parts)
            + " (w is the cosine)",
            _ordered(columns),
            is_usual=name == "w, x, y, z",
        )
    yield Correction(
        "the poses are inverse: of the base in the hand's frame",
        "log the pose of the hand in the base's frame: the inverse of the present one; or give "
        "preflight --eye-to-hand, if the camera stands still and the hand carries what it films",
        _inverse,
        is_usual=True,
    )
    yield Correction(
        "the position is that of the base in the hand's frame, the orientation is not inverse",
        "log the position of the hand in the base's frame",
        _inverse_position,
    )
    for one, other in ((0, 1), (0, 2), (1, 2)):
        order = np.arange(3)
        order[[one, other]] = other, one
        yield Correction(
            f"the axes {AXES[one]} and {AXES[other]} are exchanged in position and orientation",
            f"exchange {AXES[one]} and {AXES[other]} of the position and of the quaternion",
            _ordered(np.array([*order, *(3 + order), 6])),
        )


def _inverse_position(values: Array) -> Array:
    place = -Rotation.from_quat(values[:, 3:]).apply(values[:, :3])
    return np.hstack([place, values[:, 3:]])


def _inverse(values: Array) -> Array:
    back = Rotation.from_quat(values[:, 3:]).inv()
    turns = values[:, 3:] * (-1, -1, -1, 1)
    return np.hstack([-back.apply(values[:, :3]), turns])


def _of_twists(_: tuple[str, ...]) -> Iterator[Correction]:
    for what, first in (("v", 0), ("w", 3)):
        yield from _orders(what, first, 6)
        yield from _signs(what, first)
    for one, other in ((0, 1), (0, 2), (1, 2)):
        order = np.arange(3)
        order[[one, other]] = other, one
        yield Correction(
            f"the axes {AXES[one]} and {AXES[other]} are exchanged in v and w",
            f"exchange {AXES[one]} and {AXES[other]} of v and of w",
            _ordered(np.array([*order, *(3 + order)])),
        )
    yield Correction(
        "w is in degrees",
        "log w in rad/s: the present numbers over 57.3",
        _scaled([3, 4, 5], DEGREE),
        is_usual=True,
    )
    yield Correction(
        "v and w are exchanged: the angular part comes first",
        "log v (vx, vy, vz) and w (wx, wy, wz) in the columns of their names",
        _ordered(np.array([3, 4, 5, 0, 1, 2])),
        is_usual=True,
    )
    yield Correction(
        "v and w are in the base's frame",
        "turn v and w into the hand's frame, by the hand's orientation",
        frames=(Frame.BASE, Frame.BASE),
        is_usual=True,
    )
    yield Correction(
        "the twist is that of the base in the hand's frame",
        "log the twist of the hand: the present one with the other sign",
        _scaled(np.arange(6), -1.0),
    )


def mixed(smooth: Smooth) -> Iterator[Correction]:
    """Yield the corrections of logs whose linear and angular parts are in two frames, which are
    turned against each other by an angle that has to be found.
    """
    if smooth.kind is Kind.POSES:
        yield Correction(
            "position and orientation are in two frames that are turned against each other",
            "log both in the base's frame",
            turn=np.eye(3),
        )
    if smooth.kind is not Kind.TWISTS:
        return
    for of_v, of_w in product(Frame, Frame):
        found = f"v is in the {of_v.value}'s frame, and w in the {of_w.value}'s"
        if of_v is of_w:
            which = "move with the hand" if of_v is Frame.HAND else "are fixed"
            found = f"v and w are in two frames that {which}, and are turned against each other"
        yield Correction(
            found,
            "log v and w in the hand's frame: turn what is in another one, by the hand's "
            "orientation in it",
            frames=(of_v, of_w),
            turn=np.eye(3),
        )


def turned(
    given: tuple[Correction, ...], turn: Array, smooth: Smooth, moved: RobotMotion
) -> tuple[Correction, ...]:
    """Return corrections in which each turn that is to be found is multiplied by a further one.

    Args:
        given: The corrections.
        turn: Rotation (3, 3) of the frame of the hand's angular part in that of its linear part, in
            the hand's frame.
        smooth: The smoothed log.
        moved: The hand's motion after the given corrections.
    """
    frames = [each.frames[0] for each in given if each.frames is not None]
    is_of_poses = smooth.kind is Kind.POSES and not smooth.is_inverse
    if is_of_poses or Frame.BASE in frames:
        # The log's linear part is in the base's frame, in which the hand is turned.
        middle = Rotation.from_quat(moved.turns).mean().as_matrix()
        turn = middle @ turn @ middle.T
    return tuple(
        each if each.turn is None else replace(each, turn=each.turn @ turn) for each in given
    )


def _of_joints(names: tuple[str, ...]) -> Iterator[Correction]:
    turning = [k for k, name in enumerate(names) if name.endswith("_rad")]
    for k, name in enumerate(names):
        yield Correction(
            f"the sign of {name} is wrong", f"log {name} with the other sign", _scaled([k], -1.0)
        )
    for k, name in enumerate(names):
        for other in range(k + 1, len(names)):
            order = np.arange(len(names))
            order[[k, other]] = other, k
            if name[-3:] == names[other][-3:]:
                yield Correction(
                    f"{name} and {names[other]} are exchanged",
                    f"exchange the columns {name} and {names[other]}",
                    _ordered(order),
                )
    if turning:
        yield _degrees(turning)
