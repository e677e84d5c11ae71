"""Values that the simulated world gives to trackers and control (camera, pose, posture, frame,
truth), and the effects of disturbances. This file does not use MuJoCo.

Poses compare by their numbers; postures, frames and truths, which hold many arrays, by identity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.camera.distortion import Distortion

Array = NDArray[np.float64]
Image = NDArray[np.uint8]
DepthPicture = NDArray[np.float32]
LARGEST_PICTURE = 16_384
"""Longest side of a picture from a file [px]; more would take all memory."""


@dataclass(frozen=True, slots=True)
class Camera:
    """The intrinsics of a camera [px]: a pinhole, and the distortion of its lens.

    Pixel coordinates are continuous and start at the image's top left corner: pixel j spans j..j+1,
    so its centre is j + 0.5 and the centre of the image is (width / 2, height / 2).

    >>> camera = Camera(fx=300.0, fy=300.0, cx=160.0, cy=120.0, width=320, height=240)
    >>> camera.project(np.array([0.1, 0.0, 1.0])).tolist()
    [190.0, 120.0]
    """

    fx: float
    """Focal length along u [px]."""
    fy: float
    """Focal length along v [px]."""
    cx: float
    """Principal point, u [px]."""
    cy: float
    """Principal point, v [px]."""
    width: int
    """Image width [px]."""
    height: int
    """Image height [px]."""
    distortion: Distortion | None = None
    """Distortion of the lens; None: a lens without distortion (pinhole)."""

    @property
    def focal(self) -> float:
        """Geometric mean of the focal lengths [px]: the size in the image over the size [m] of an
        object at 1 m depth; with a distorting lens, on the optical axis.
        """
        return float(np.sqrt(self.fx * self.fy))

    @property
    def is_plain(self) -> bool:
        """True if the camera shows objects that are parallel to the image in their true shape,
        because its pixels are square and its lens does not distort.
        """
        return self.distortion is None and self.fx == self.fy

    def normalise(self, pixels: Array) -> Array:
        """Return the undistorted normalised image coordinates (..., 2), x = X/Z and y = Y/Z in the
        camera frame, that belong to pixels (..., 2) [px].
        """
        bent = (pixels - (self.cx, self.cy)) / (self.fx, self.fy)
        return bent if self.distortion is None else self.distortion.straighten(bent)

    def to_pixels(self, normalised: Array) -> Array:
        """Return the pixels (..., 2) [px] that belong to undistorted normalised image coordinates
        (..., 2), x = X/Z and y = Y/Z in the camera frame.
        """
        bent = normalised if self.distortion is None else self.distortion.bend(normalised)
        return bent * (self.fx, self.fy) + (self.cx, self.cy)

    def project(self, points: Array) -> Array:
        """Return the pixels (..., 2) [px] at which the camera sees points (..., 3), given in the
        camera frame [m]. The points have to be in front of the camera; this is not checked.
        """
        return self.to_pixels(points[..., :2] / points[..., 2:])


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """A rigid transform T_a_b, the pose of frame b in frame a: it takes coordinates [m] in frame b
    to coordinates in frame a. `T_a_b @ T_b_c` is T_a_c.

    >>> T_world_camera = Pose.planar(1.0, 0.0, 0.0)
    >>> T_world_camera.apply(np.array([0.5, 0.0, 0.0])).tolist()
    [1.5, 0.0, 0.0]
    >>> (T_world_camera @ T_world_camera.inverse()).translation.tolist()
    [0.0, 0.0, 0.0]
    """

    rotation: Array
    """Rotation (3, 3)."""
    translation: Array
    """Translation (3,) [m]."""

    def __post_init__(self) -> None:
        try:
            found = self.rotation.shape, self.translation.shape
        except AttributeError:  # not two arrays: lists, for instance
            found = np.shape(self.rotation), np.shape(self.translation)
        if found != ((3, 3), (3,)):
            raise ValueError(f"a pose needs a rotation (3, 3) and a translation (3,), got {found}")

    @staticmethod
    def planar(x: float, y: float, heading: float) -> Pose:
        """Return the pose T_world_object of an object on the table: position x, y [m] at z = 0, and
        rotation about z by `heading` [rad], the direction of the object's x axis from world x
        towards y.
        """
        c = np.cos(heading)
        s = np.sin(heading)
        return Pose(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), np.array([x, y, 0.0]))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Pose):
            return NotImplemented
        same = np.array_equal(self.rotation, other.rotation)
        return same and np.array_equal(self.translation, other.translation)

    __hash__ = None  # type: ignore[assignment]  # as an array has none

    def __matmul__(self, other: Pose) -> Pose:
        return Pose(self.rotation @ other.rotation, self.apply(other.translation))

    def inverse(self) -> Pose:
        """Return the inverse transform T_b_a of a pose T_a_b."""
        return Pose(self.rotation.T, -self.rotation.T @ self.translation)

    def apply(self, points: Array) -> Array:
        """Take points from one frame to another: for a pose T_a_b, return the coordinates (..., 3)
        [m] in frame a of points given by their coordinates (..., 3) [m] in frame b.
        """
        return points @ self.rotation.T + self.translation


@dataclass(frozen=True, slots=True, eq=False)
class Posture:
    """What a robot knows of itself at one moment: its camera's pose in the room (in the target's
    frame, if the robot holds the target), joint positions and limits [m or rad], limits of joint
    rates [m/s or rad/s], the Jacobian (6, n) from joint rates to the camera's twist, and camera
    twists (6,) in the camera frame [m/s, rad/s].

    Of the twists, `twist` is the measured one, `asked` the commanded one and `accepted` the part of
    it that the joint limits allow, all means since the last frame; `under_way` has commands that
    have not acted yet, each with its duration [s].
    """

    T_base_camera: Pose
    """Pose of the camera (x right, y down, z forward) in the frame that the robot is calibrated to:
    the room's, whose z is up and whose table is at z = 0, wherever the robot's own base is; the
    target's, if the robot holds the target.
    """
    twist: Array
    """Mean camera twist (6,) since the last frame [m/s, rad/s]."""
    joints: Array
    """Joint positions (n,) [m or rad]."""
    lower: Array
    """Lower limits of the joints (n,) [m or rad]; -inf for a joint without a limit."""
    upper: Array
    """Upper limits of the joints (n,) [m or rad]; inf for a joint without a limit."""
    jacobian: Array
    """Camera twist per joint rate (6, n)."""
    slowest: Array | float = -math.inf
    """Least joint rates (n,) [m/s or rad/s]: the largest ones backwards; -inf without a limit."""
    fastest: Array | float = math.inf
    """Largest joint rates (n,) [m/s or rad/s]; inf without a limit."""
    accepted: Array | None = None
    """Mean of the commanded camera twist (6,) since the last frame, as far as the joint limits let
    the drives follow it; None: the robot does not report it."""
    asked: Array | None = None
    """Mean of the commanded camera twist (6,) since the last frame; None: the last command."""
    under_way: tuple[tuple[Array, float], ...] | None = None
    """Camera twists (6,) between this moment and the one at which the next command acts, and how
    long each is held [s]; None: the commands not acted yet, a frame interval each."""

    def commanded(
        self, asked: Array | None, under_way: tuple[tuple[Array, float], ...] | None = None
    ) -> Posture:
        """Return a copy of this posture with other commanded twists: `asked`, the mean (6,) since
        the last frame (None: the last command), and `under_way`, the twists (6,) that have not
        acted yet, each with its duration [s] (None: the commands that have not acted, a frame
        interval each).
        """
        return Posture(  # `replace` takes four times as long
            self.T_base_camera,
            self.twist,
            self.joints,
            self.lower,
            self.upper,
            self.jacobian,
            self.slowest,
            self.fastest,
            self.accepted,
            asked,
            under_way,
        )

    @property
    def down(self) -> Array:
        """Unit vector (3,) straight down, in the camera frame; it is against z of the frame of the
        camera's pose (the room, or the target if the robot holds it).
        """
        return -self.T_base_camera.rotation[2]


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One picture of the camera, RGB (H, W, 3), with its number from 0 and its time [s]: simulated,
    since the first picture of a recording, or a real camera's stamp. Depths along the optical axis
    (H, W) [m], nan or 0 where unknown, are given if the camera measures them. If the camera
    delivered no new picture, `fresh` is False: the picture is the last one again, at a new time.
    """

    image: Image
    """The picture, RGB (H, W, 3), read-only."""
    time: float
    """Time of the picture [s]."""
    index: int
    """Number of the frame, from 0."""
    fresh: bool = True
    """False if the camera delivered no new picture; the image is then the last one."""
    depth: DepthPicture | None = None
    """Distance along the optical axis (H, W) [m], nan or 0 where the camera has none; None: the
    camera has no depth picture."""

    def __post_init__(self) -> None:
        """Make the picture read-only here, and leave the caller's array as it is."""
        # numba would compile each loop a second time for pictures that can be written.
        if getattr(getattr(self.image, "flags", None), "writeable", False):
            picture = self.image.view()
            picture.setflags(write=False)
            object.__setattr__(self, "image", picture)

    def black(self) -> Frame:
        """Return a copy of this frame with a black picture of the same size, which takes no memory,
        and without depths.
        """
        picture = np.broadcast_to(np.uint8(0), self.image.shape)
        return Frame(picture, self.time, self.index, self.fresh)


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """The exact pose of the target at the time of one frame, and the projection into the image of
    its reference rectangle, which stands for it in measurements and control: centre (2,) [px];
    corners (4, 2) [px], in the order rear left, front left, front right, rear right (the nose is in
    front); direction theta of the nose, from +u towards +v [rad]; and size, the square root of
    image area over metric area [px/m].

    `visible` is the fraction of the target's silhouette in the picture that other bodies do not
    hide; None if it was not measured.
    """

    centre: Array
    """Projected centre of the target's reference rectangle (2,) [px]."""
    theta: float
    """Direction of the target's nose in the image, from +u towards +v [rad]."""
    size: float
    """Square root of image area over metric area of the reference rectangle [px/m]."""
    corners: Array
    """Projected corners of the reference rectangle (4, 2) [px]."""
    T_world_camera: Pose
    """Pose of the camera (x right, y down, z forward)."""
    T_world_target: Pose
    """Pose of the target (x along its nose, z up)."""
    visible: float | None
    """Fraction, 0..1, of the target's silhouette in the picture that is not hidden by other bodies;
    None if it was not measured."""

    @property
    def depth(self) -> float:
        """Depth [m] of the origin of the target's frame, its distance from the camera along the
        optical axis; below zero the target is behind the camera, and `centre`, `theta`, `size` and
        `corners` are meaningless.
        """
        return float((self.T_world_camera.inverse() @ self.T_world_target).translation[2])


@dataclass(frozen=True, slots=True)
class Spot:
    """A cone of light from above onto the table: its middle (x, y) in the world [m], and its
    brightness, 0 to 1.
    """

    x: float
    """Its middle on the table along world x [m]."""
    y: float
    """Its middle on the table along world y [m]."""
    strength: float
    """Brightness of the light, 0..1."""


@dataclass(frozen=True, slots=True)
class Effect:
    """The combined effect of all disturbances at one time: factors on image and lamp brightness; a
    spot light (None: off); the distance [m], to the right in the picture, of a board from the line
    of sight to the target (None: no board); the pose T_world_target of a second target (None:
    absent); and whether the camera drops the frame.
    """

    gain: float = 1.0
    """Factor on the brightness of the image."""
    lamp: float = 1.0
    """Factor on the brightness of the lamp."""
    spot: Spot | None = None
    """The spot light; None: it is off."""
    board: float | None = None
    """Distance of the board from the line of sight to the target, to the right in the picture
    (along the camera's x) [m]; None: the board is parked."""
    second: Pose | None = None
    """Pose of a second target on the table; None: it is absent."""
    dropped: bool = False
    """True if the camera drops this frame."""

    def __or__(self, other: Effect) -> Effect:
        """Return the combination: factors are multiplied; of spots, boards and second targets, of
        which the world has one each, the later effect's is taken; the frame is dropped if either
        effect drops it.
        """
        return Effect(
            gain=self.gain * other.gain,
            lamp=self.lamp * other.lamp,
            spot=other.spot or self.spot,
            board=self.board if other.board is None else other.board,
            second=other.second or self.second,
            dropped=self.dropped or other.dropped,
        )
