"""Detection of the printed sheet of AprilTags in a photograph; an error gives the likely reason for
a failure.

The homography from the plane is a least-squares fit to the corners of all tags (Hartley and
Zisserman, Multiple View Geometry in Computer Vision, 2nd edition, section 4.1); the tags' known
side makes it metric.
"""

import cv2
import numpy as np

from servo.photo.photograph import Photograph
from servo.photo.sheet import DICTIONARY, MIDDLES, SIDE, tag_corners
from sim.types import Array, Camera, Image

LEAST_TAGS = 3
"""Number of the sheet's tags that must be seen."""
WIDEST_EDGE = 8.0
"""Width of the sharpest edges above which a photograph is called blurred [px]."""
LARGEST_ERROR = 0.02
"""Largest rms distance of the tags' corners from their places, relative to the tags' side: more has
a sheet that is not flat or a lens that bends."""
OTHERS = {
    "AprilTag 25h9": cv2.aruco.DICT_APRILTAG_25H9,
    "ArUco 4x4": cv2.aruco.DICT_4X4_1000,
    "ArUco 5x5": cv2.aruco.DICT_5X5_1000,
    "ArUco 6x6": cv2.aruco.DICT_6X6_1000,
    "ArUco 7x7": cv2.aruco.DICT_7X7_1000,
}
"""Families of tags that other people's sheets have."""


def seen_in(image: Image, camera: Camera | None, scale: float) -> Photograph:
    """Find the printed sheet of AprilTags in a photograph; return the photograph with its camera
    and the homography from the sheet's plane [m] to normalised image coordinates.

    Args:
        image: The photograph, RGB, uint8 (H, W, 3).
        camera: Intrinsics of the camera that took it; None: a lens without distortion, and the
            principal point in the image's centre.
        scale: Printed size of the sheet relative to its design size, in which a tag has a side of
            60 mm.

    Raises:
        ValueError: Fewer than 3 of the sheet's 6 tags are seen; the rms distance of their corners
            from their places on a flat sheet is more than 2 % of a tag's side; or the camera has
            another image size than the photograph.
    """
    height, width = image.shape[:2]
    camera = camera or Camera(width, width, width / 2, height / 2, width, height)
    if (camera.width, camera.height) != (width, height):
        raise ValueError(
            f"the calibration is for {camera.width} x {camera.height} px, and the photograph has "
            f"{width} x {height} px: give the calibration of such pictures"
        )
    found = {number: each for number, each in _tags(image, DICTIONARY) if number in MIDDLES}
    if len(found) < LEAST_TAGS:
        raise ValueError(_why_few(image, len(found)))
    places = scale * np.concatenate([tag_corners(number) for number in found])
    pixels = np.concatenate([*found.values()]) + 0.5
    plane_to_camera = cv2.findHomography(places, camera.normalise(pixels))[0]
    H = (plane_to_camera / plane_to_camera[2, 2]).astype(float)
    back = np.column_stack([camera.normalise(pixels), np.ones(len(pixels))]) @ np.linalg.inv(H).T
    error = float(np.sqrt(np.mean(np.sum((back[:, :2] / back[:, 2:] - places) ** 2, axis=1))))
    if error > LARGEST_ERROR * scale * SIDE:
        raise ValueError(
            f"the tags' corners are {1e3 * error:.1f} mm from their places: the sheet is not flat, "
            "a second sheet is seen, or the lens bends the picture, which --calibration takes out"
        )
    return Photograph(image, camera, H, len(found), error, scale)


def _tags(image: Image, dictionary: cv2.aruco.Dictionary) -> list[tuple[int, Array]]:
    """Return the number and the corners (4, 2) [px, from the first pixel's middle] of each tag of a
    family in a photograph.
    """
    options = cv2.aruco.DetectorParameters()
    options.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_APRILTAG
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    corners, numbers, _ = cv2.aruco.ArucoDetector(dictionary, options).detectMarkers(grey)
    if not corners:
        return []
    places = [np.asarray(each, float).reshape(4, 2) for each in corners]
    return list(zip(map(int, numbers.ravel()), places, strict=True))


def _why_few(image: Image, count: int) -> str:
    """Return a sentence that says why `count` tags of the sheet are seen, which are too few."""
    if count:
        return (
            f"{count} of the sheet's {len(MIDDLES)} tags {'is' if count == 1 else 'are'} seen, and "
            f"{LEAST_TAGS} are needed: show the whole sheet, larger and with its white border"
        )
    width = edge_width(image)
    if width > WIDEST_EDGE:
        return (
            f"no tag of the sheet is seen: the photograph is blurred, its sharpest edges are "
            f"{width:.0f} px wide; take a sharp one"
        )
    own = sorted(number for number, _ in _tags(image, DICTIONARY))
    if own:
        listed = ", ".join(map(str, own))
        return (
            f"no tag of the sheet is seen, but the AprilTag {listed}: the sheet's are "
            f"{min(MIDDLES)} to {max(MIDDLES)}; print it by servobench photo --sheet sheet.pdf"
        )
    for family, kind in OTHERS.items():
        if len(_tags(image, cv2.aruco.getPredefinedDictionary(kind))) >= LEAST_TAGS:
            return (
                f"no tag of the sheet is seen, but some of the family {family}: print the sheet by "
                "servobench photo --sheet sheet.pdf"
            )
    return (
        "no tag of the sheet is seen: show the whole sheet, larger, evenly lit and with its white "
        "border"
    )


def edge_width(image: Image) -> float:
    """Return the width of the sharpest edges [px] in a photograph, RGB (H, W, 3), as a measure of
    blur: the range of grey levels (1st to 99th percentile) over the 99.9th percentile of the
    gradient's magnitude.
    """
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32)
    slopes = np.hypot(cv2.Sobel(grey, -1, 1, 0), cv2.Sobel(grey, -1, 0, 1)) / 8
    low, high = np.percentile(grey, [1, 99])
    return float((high - low) / max(float(np.percentile(slopes, 99.9)), 1e-3))
