"""Homography between the picture at a goal and the camera's picture, from matched points or from
all pixels.

Points: ORB (Rublee, Rabaud, Konolige and Bradski 2011, ORB: an efficient alternative to SIFT or
SURF); SIFT (Lowe 2004, Distinctive image features from scale-invariant keypoints); RootSIFT
(Arandjelovic and Zisserman 2012, Three things everyone should know to improve object retrieval) on
affine views of the goal (Morel and Yu 2009, ASIFT: a new framework for fully affine invariant image
comparison). Pixels: ECC (Evangelidis and Psarakis 2008, Parametric image alignment using enhanced
correlation coefficient maximization). All are OpenCV's implementations.
"""

from dataclasses import dataclass
from itertools import product
from typing import Literal, Protocol

import cv2
import numpy as np
from cv2.typing import MatLike
from numpy.typing import NDArray

from servo.types import CameraImage
from sim.types import Array, Camera, Image

Method = Literal["orb", "sift", "affine_sift", "ecc"]
STRONGEST = 500
"""Most points of a picture."""
RATIO = 0.8
"""A match counts if its distance is below this share of that of the next place (Lowe 2004)."""
NEIGHBOURS = 6
APART = 8.0
"""Another place: among the nearest neighbours, the first one this far away in the picture [px].
Nearer ones are the same point in another affine view."""
FEWEST = 10
"""Fewest matches that fit one homography; below, two unrelated pictures may have one too."""
MISS = 3.0
"""Largest distance of a match that fits the homography [px]."""
TILTS = (np.sqrt(2), 2.0, 2 * np.sqrt(2))
DIRECTIONS = (0.0, 45.0, 90.0, 135.0)
"""Affine views of the goal: factors by which it is compressed, and their directions [deg]."""
CONTRAST = 4.0
TILES = (8, 8)
"""Limit of the local contrast equalisation, and the tiles of the picture in which it is made."""
STEPS = 50
LEAST_GAIN = 1e-4
"""ECC ends after this many steps, or at a smaller gain of the correlation."""
SMOOTH = 5
"""Side of the filter before ECC, in pixels of half the size."""
LEAST_CORRELATION = 0.5
"""Below this correlation of both pictures ECC has found nothing."""


class Alignment(Protocol):
    """Finds the homography from the picture that was taken at the goal to each further picture of
    the same camera.
    """

    def find(self, picture: Image) -> Array | None:
        """Return the homography (3, 3) from the picture at the goal to another picture, in
        normalised image coordinates of a lens without distortion; None if none is found. It is
        called once for each picture, in order.

        Args:
            picture: The other picture, RGB (H, W, 3) of uint8.
        """
        ...


@dataclass(frozen=True, slots=True)
class Points:
    """The n points of interest of a picture: their coordinates (n, 2) [px], measured from the
    centre of the top left pixel as in OpenCV, and their descriptors (n, m).
    """

    pixels: Array
    descriptors: MatLike


def matrix_of(camera: Camera, size: float = 1.0) -> Array:
    """Return the matrix (3, 3) of a camera's intrinsics for OpenCV's pixel coordinates, which are
    measured from the centre of the top left pixel. Lens distortion is left out.

    Args:
        camera: The intrinsics.
        size: Factor by which the picture is resized, such as 0.5.
    """
    u, v = size * camera.cx - 0.5, size * camera.cy - 0.5
    return np.array([[size * camera.fx, 0.0, u], [0.0, size * camera.fy, v], [0.0, 0.0, 1.0]])


class Flattened:
    """Makes pictures as a pinhole with the intrinsics of a camera would take them: pictures of a
    plane are related by a homography only without the lens's distortion.
    """

    def __init__(self, camera: Camera) -> None:
        """Compute where in a picture of the camera each pixel of the pinhole's picture is seen."""
        self._at: NDArray[np.float32] | None = None
        if camera.distortion is not None:
            v, u = np.mgrid[: camera.height, : camera.width] + 0.5
            rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy], axis=-1)
            self._at = (camera.to_pixels(rays) - 0.5).astype(np.float32)

    def of(self, picture: Image) -> Image:
        """Return the pinhole's picture, black where the camera does not see; the picture itself if
        the lens has no distortion.
        """
        if self._at is None:
            return picture
        bent = cv2.remap(picture, self._at[..., 0], self._at[..., 1], cv2.INTER_LINEAR)
        return np.asarray(bent, np.uint8)


def alignment(method: Method, goal: CameraImage) -> Alignment:
    """Return an object that finds homographies from the picture at the goal to other pictures.

    Args:
        method: "orb", "sift" or "affine_sift" (from matched points), or "ecc" (from all pixels).
        goal: The picture at the goal, with its camera.
    """
    match method:
        case "ecc":
            return ByPixels(goal)
        case "orb":
            return ByPoints(cv2.ORB.create(STRONGEST), cv2.NORM_HAMMING, goal)
        case "sift":
            return ByPoints(_sift(), cv2.NORM_L2, goal)
        case "affine_sift":
            return ByPoints(_sift(), cv2.NORM_L2, goal, strong=True)


def _sift() -> cv2.Feature2D:
    """Return OpenCV's SIFT; without its precise upscaling, points are a quarter of a pixel off."""
    return cv2.SIFT.create(STRONGEST, enable_precise_upscale=True)


class ByPoints:
    """Finds homographies from the picture at the goal to other pictures of the same camera, by
    matching points of interest such as SIFT's.
    """

    def __init__(
        self, detector: cv2.Feature2D, norm: int, goal: CameraImage, *, strong: bool = False
    ) -> None:
        """Detect the points of the goal's picture.

        Args:
            detector: Detects points and describes them.
            norm: OpenCV's norm of the difference of two descriptors.
            goal: The goal's picture; other pictures are from the same camera.
            strong: Whether contrast is equalised, descriptors are RootSIFT's, and the goal is also
                described as it looks from the side.
        """
        self._detector = detector
        self._matcher = cv2.BFMatcher(norm)
        self._strong = strong
        self._intrinsics = matrix_of(goal.camera)
        self._flattened = Flattened(goal.camera)
        self._grey_goal = self._grey(goal.image)
        views = [(self._grey_goal, np.eye(3))]
        if strong:
            asides = product(TILTS, DIRECTIONS)
            views += [_seen_aside(self._grey_goal, tilt, turn) for tilt, turn in asides]
        found = [self._points(*view) for view in views]
        kept = [points for points in found if len(points.pixels)] or found[:1]
        self._described = Points(
            np.concatenate([points.pixels for points in kept]),
            np.concatenate([points.descriptors for points in kept]),
        )
        self._before: Array | None = None
        """Homography of the picture before [px]; None if it was not found."""

    def find(self, picture: Image) -> Array | None:
        """Return the homography (3, 3) from the picture at the goal to another picture, in
        normalised image coordinates of a lens without distortion; None if fewer than 10 matched
        points fit one.

        Args:
            picture: The other picture, RGB (H, W, 3) of uint8.
        """
        seen = self._points(self._grey(picture), np.eye(3))
        found = None
        if self._strong and self._before is not None:
            # The goal as it looked from where the camera was is the nearest view of all.
            found = self._fitted(seen, self._warped(self._before))
        if found is None:
            found = self._fitted(seen, self._described)
        self._before = found
        if found is None:
            return None
        K = self._intrinsics
        return np.linalg.inv(K) @ found @ K

    def _fitted(self, seen: Points, goal: Points) -> Array | None:
        """Return the homography (3, 3) [px] from the goal's points to those of a picture; None if
        fewer than `FEWEST` matches fit one.
        """
        if min(len(seen.pixels), len(goal.pixels)) < FEWEST:
            return None
        found = self._matcher.knnMatch(seen.descriptors, goal.descriptors, k=NEIGHBOURS)
        place = np.array([[match.trainIdx for match in row] for row in found])
        distance = np.array([[match.distance for match in row] for row in found])
        there = goal.pixels[place]
        is_other = np.linalg.norm(there - there[:, :1], axis=2) > APART
        second = np.where(is_other, distance, np.inf).min(axis=1)
        good = distance[:, 0] < RATIO * second
        if np.count_nonzero(good) < FEWEST:
            return None
        H, fits = cv2.findHomography(there[good, 0], seen.pixels[good], cv2.USAC_MAGSAC, MISS)
        if np.count_nonzero(fits) < FEWEST:  # also where there is no H
            return None
        return np.asarray(H, np.float64)

    def _grey(self, picture: Image) -> Image:
        grey = cv2.cvtColor(self._flattened.of(picture), cv2.COLOR_RGB2GRAY)
        if self._strong:
            grey = cv2.createCLAHE(CONTRAST, TILES).apply(grey)
        return np.asarray(grey, np.uint8)

    def _warped(self, H: Array) -> Points:
        """Return the points that are found in the goal's picture warped by a homography (3, 3)
        [px], with their coordinates in the picture that is not warped.
        """
        height, width = self._grey_goal.shape
        return self._points(cv2.warpPerspective(self._grey_goal, H, (width, height)), H)

    def _points(self, grey: MatLike, view: Array) -> Points:
        """Return the points of a grey picture that is a warped view of another picture, with their
        coordinates in that other picture. `view` is the homography (3, 3) [px] from the other
        picture to the grey one.
        """
        points, descriptors = self._detector.detectAndCompute(grey, None)
        if not points:
            return Points(np.zeros((0, 2)), np.zeros((0, 1)))
        if self._strong:
            sums = np.maximum(descriptors.sum(axis=1, keepdims=True), 1.0)
            descriptors = np.sqrt(descriptors / sums)
        pixels = np.array([[point.pt] for point in points])
        back = cv2.perspectiveTransform(pixels, np.linalg.inv(view))
        return Points(back[:, 0].astype(np.float64), np.asarray(descriptors))


def _seen_aside(grey: Image, tilt: float, turn: float) -> tuple[MatLike, Array]:
    """Return a grey picture as it looks from the side, and the affine map (3, 3) [px] from the
    given picture to this view.

    Args:
        grey: The picture (H, W).
        tilt: Factor by which it is compressed.
        turn: Direction of the compression in the given picture, from right towards down [deg].
    """
    height, width = grey.shape
    turned = cv2.getRotationMatrix2D((0, 0), turn, 1.0)
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]]) @ turned[:, :2].T
    turned[:, 2] = -corners.min(axis=0)
    sides = np.ceil(np.ptp(corners, axis=0)).astype(int).tolist()
    level = cv2.warpAffine(grey, turned, sides)
    # Without the blur, compression would make points of fine texture that is not seen there.
    level = cv2.GaussianBlur(level, (0, 0), 0.8 * np.sqrt(tilt**2 - 1), sigmaY=0.01)
    # `resize` keeps the picture's left edge, which is half a pixel left of the first centre.
    squeeze = np.array([[1 / tilt, 0.0, 0.5 / tilt - 0.5], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    view = squeeze @ np.vstack([turned, [0.0, 0.0, 1.0]])
    return cv2.resize(level, None, fx=1 / tilt, fy=1.0), view


class ByPixels:
    """Finds homographies from the picture at the goal to successive pictures of the same camera, by
    maximising the correlation of all pixels (ECC). Each search starts from the last homography that
    was found, the first one from the identity.
    """

    def __init__(self, goal: CameraImage) -> None:
        """Store the goal's picture, halved; other pictures are from the same camera."""
        self._intrinsics = matrix_of(goal.camera, size=0.5)
        self._flattened = Flattened(goal.camera)
        self._goal = _halved(self._flattened.of(goal.image))
        self._before = np.eye(3, dtype=np.float32)

    def find(self, picture: Image) -> Array | None:
        """Return the homography (3, 3) from the picture at the goal to another picture, in
        normalised image coordinates of a lens without distortion; None if the search does not
        converge, or the pictures correlate by less than 0.5.

        Args:
            picture: The other picture, RGB (H, W, 3) of uint8.
        """
        end = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, STEPS, LEAST_GAIN)
        try:
            correlation, found = cv2.findTransformECC(
                self._goal,
                _halved(self._flattened.of(picture)),
                self._before.copy(),
                cv2.MOTION_HOMOGRAPHY,
                end,
                np.full(self._goal.shape, 255, np.uint8),
                SMOOTH,
            )
        except cv2.error:  # how it says that it does not converge
            return None
        if correlation < LEAST_CORRELATION:
            return None
        self._before = np.asarray(found, np.float32)
        return np.linalg.inv(self._intrinsics) @ self._before @ self._intrinsics


def _halved(picture: Image) -> Image:
    grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
    half = cv2.resize(grey, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    return np.asarray(half, np.uint8)
