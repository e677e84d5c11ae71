"""A tag that stands still in a film: where it is seen over the whole motion shows the focal length
and the lever along the optical axis, which pairs of pictures three apart cannot tell from each
other.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import t as student

from servo.sight.planar_pose import CornersToPose
from servo.twin import mount as mounts
from servo.twin.mount import Mount, camera_poses
from servo.twin.offset import LEVEL
from servo.twin.robot_motion import RobotMotion
from servo.twin.tracks import Tracks
from sim.geometry import exp_so3
from sim.types import Array, Camera, Pose
from tracking.search.tag_detector import TagDetector
from tracking.sequences.sources import Picture

EVERY = 3
"""Each so many-th picture is searched."""
FEWEST = 60
"""Least number of pictures with the tag."""
FIRST = 10
"""Pictures from which the tag's first pose is computed."""
LEAST_BEND = np.finfo(float).eps
"""Least curvature of the loss that SciPy uses."""
SCALE = 0.5
"""Cauchy scale [px]."""
MOVED = 3.0
"""Median distance from the fit from which on the tag does not stand still [px]."""
SIZE_OFF = 0.02
"""Least relative error of the tag's side that is reported."""
SQUARE = np.array([[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]])
"""Corners of a tag of side 1: x right, y down, clockwise from the top left."""
POSE = slice(8, 14)
SIDE = 14


@dataclass(slots=True)
class TagSightings:
    """The pictures in which a tag was seen: their numbers among those that can be decoded, and the
    tag's corners (4, 2) [px].
    """

    numbers: list[int] = field(default_factory=list)
    corners: list[Array] = field(default_factory=list)

    def watching(self, pictures: Iterable[Picture]) -> Iterator[Picture]:
        """Yield all pictures, and store where a tag is seen in every third one that can be decoded:
        first the tag nearest to the picture's middle, then only tags with its number.
        """
        detector = TagDetector()
        known: int | None = None
        count = 0
        for picture in pictures:
            if picture.image is not None:
                if count % EVERY == 0:
                    height, width = picture.image.shape[:2]
                    last = self.corners[-1] if self.corners else None
                    place = np.array([width, height]) / 2 if last is None else last.mean(axis=0)
                    found = detector.nearest(picture.image, place, known, last)
                    if found is not None:
                        known = found[0]
                        self.numbers.append(count)
                        self.corners.append(found[1])
                count += 1
            yield picture


@dataclass(frozen=True, slots=True)
class StillTag:
    """A tag that stands still, as it is seen in a film: the numbers of the n pictures in which it
    is seen, its corners there (n, 4, 2) in normalised image coordinates (undistorted, by the stated
    focal length), and the side of its square as the user states it [m].
    """

    numbers: NDArray[np.int64]
    corners: Array
    side: float

    @staticmethod
    def of(seen: TagSightings, camera: Camera, side: float) -> "StillTag":
        """Return the tag that a camera saw, with its corners in normalised image coordinates and
        the side of its square that the user states [m].
        """
        corners = [camera.normalise(each) for each in seen.corners]
        return StillTag(np.array(seen.numbers), np.array(corners), side)

    def fitted(self, motion: RobotMotion, film: Tracks, first: Mount) -> "TagFit":
        """Return the mount and the focal length with which the tag stands still, with 95 %
        intervals as those of `mount.fitted`, and the tag's side.

        Args:
            motion: The hand's motion.
            film: The film, for the times of its pictures.
            first: The mount to begin with; its drift stays.
        """
        timed = self.numbers < len(film.times)  # a stopped search may have seen it later
        middle = (film.times[0] + film.times[-1]) / 2
        stamps = film.times[self.numbers[timed]]
        times = stamps + first.drift * (stamps - middle)
        pose_of = CornersToPose((self.side, self.side))
        begin = camera_poses(motion, first, times[:FIRST] + first.offset)
        found_at = self.corners[timed]
        seen = found_at / first.focal
        poses = [pose_of.of(one, at) for one, at in zip(seen[:FIRST], begin, strict=True)]
        ahead = begin[0] @ Pose(np.eye(3), np.array([0.0, 0.0, first.depth]))
        # The last of them: of the two poses that fit, the later pictures choose the right one.
        found = [at @ pose for at, pose in zip(begin, poses, strict=True) if pose is not None]
        tag = [ahead, *found][-1]

        def mount_at(x: Array) -> Mount:
            return replace(
                first,
                offset=first.offset + float(x[0]),
                rotation=first.rotation @ exp_so3(x[1:4]),
                arm=first.arm + x[4:7],
                focal=first.focal * float(np.exp(x[7])),
            )

        def away(x: Array) -> Array:
            now = mount_at(x)
            turns, places = motion.at(times + now.offset)
            square = SQUARE * self.side * np.exp(x[SIDE]) @ exp_so3(x[8:11]).T
            corners = tag.apply(square) + x[11:14]
            from_hand = (corners - places[:, None]) @ turns
            rays = (from_hand - now.lever) @ now.rotation
            there = rays[..., :2] / rays[..., 2:] * now.focal
            return film.focal * (there - found_at).ravel()

        fit = least_squares(away, np.zeros(15), loss="cauchy", f_scale=SCALE, x_scale="jac")
        left = away(fit.x)
        weights = 1 / (1 + (left / SCALE) ** 2)
        # SciPy's Jacobian has the root of the loss's curvature, at least LEAST_BEND, as a factor.
        bend = weights**2 * (1 - (left / SCALE) ** 2)
        slopes = fit.jac / np.sqrt(np.maximum(bend, LEAST_BEND))[:, None]
        scores = slopes * (left * weights)[:, None]
        blocks = ((stamps - stamps[0]) // mounts.BLOCK).astype(int)
        sums = np.stack([np.bincount(np.repeat(blocks, 8), each) for each in scores.T], axis=1)
        inverse = np.linalg.pinv(slopes.T @ (slopes * bend[:, None]))
        count = len(np.unique(blocks))
        freedom = max(count - 15, 1)
        spread = inverse @ (sums.T @ sums) @ inverse * count / freedom
        halves = float(student.ppf((1 + LEVEL) / 2, freedom)) * np.sqrt(np.diag(spread))
        known = first.halves.copy()
        known[: mounts.FOCAL + 1] = halves[:8] + mounts.FLOORS[:8]
        off = float(np.median(np.linalg.norm(left.reshape(-1, 2), axis=1)))
        side = self.side * float(np.exp(fit.x[SIDE]))
        half = side * float(halves[SIDE])
        return TagFit(replace(mount_at(fit.x), halves=known), self.side, side, half, off)


@dataclass(frozen=True, slots=True)
class TagFit:
    """What a tag that stands still shows: the mount with the focal length, and the side of its
    square as it is stated, as it is found, and half of the 95 % interval [m].
    """

    mount: Mount
    stated: float
    side: float
    half: float
    off: float
    """Median distance of its corners from the fit [px]."""

    @property
    def is_still(self) -> bool:
        """True if the corners fit a tag that stands still."""
        return self.off < MOVED

    @property
    def has_size(self) -> bool:
        """True if the found side is the stated one to within 2 % plus the half interval."""
        return abs(self.side / self.stated - 1) < SIZE_OFF + self.half / self.stated
