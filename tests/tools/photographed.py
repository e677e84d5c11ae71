"""Photographs of a known plane with the printed sheet of tags on it, made without a renderer."""

import io
from pathlib import Path

import cv2
import numpy as np

import scenes
from servo.photo.sheet import PAPERS, drawn
from sim.files.picture_file import decoded, read_image
from sim.types import Camera

PX = 1200
"""Resolution of the plane [px/m]."""
SIZE = (1.5, 1.2)
"""Width and height of the plane [m]."""
EVERY = 0.15
"""Distance of the plane's red dots [m]."""
DOT = 0.009
"""Their radius [m]."""


def printed(paper="a4", dpi=300):
    """The sheet as a printer prints it."""
    file = io.BytesIO()
    drawn(paper).savefig(file, format="png", dpi=dpi)
    return decoded(file.getvalue())


def ground(seed=0):
    """A rough grey plane with red dots on a lattice around its middle."""
    width, height = (round(side * PX) for side in SIZE)
    rough = np.random.default_rng(seed).normal(0, 1, (height, width)).astype(np.float32)
    grey = sum(cv2.GaussianBlur(rough, (0, 0), s) * s for s in (2, 6, 18))
    image = np.repeat((130 + 25 * grey)[..., None], 3, axis=2).clip(40, 220).astype(np.uint8)
    for point in lattice():
        cv2.circle(image, to_pixels(point, image), round(16 * DOT * PX), (200, 30, 30), -1, 16, 4)
    return image


def gravel():
    """A plane of the shipped gravel."""
    file = Path(scenes.__file__).parent / "grounds" / "gravel.png"
    tile = cv2.resize(read_image(file), (600, 600), interpolation=cv2.INTER_CUBIC)
    width, height = (round(side * PX) for side in SIZE)
    return np.tile(tile, (3, 3, 1))[:height, :width]


def lattice():
    steps = [np.arange(-3, 4), np.arange(-2, 3)]
    return EVERY * np.stack(np.meshgrid(*steps), axis=2).reshape(-1, 2)


def to_pixels(point, image):
    height, width = image.shape[:2]
    at = np.array([width / 2 + point[0] * PX, height / 2 - point[1] * PX]) - 0.5
    return tuple(np.rint(16 * at).astype(int).tolist())


def with_sheet(image, sheet, turn=0.0, size=PAPERS["a4"]):
    """The plane with the sheet on its middle, turned."""
    height, width = image.shape[:2]
    corners = np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]]) * np.array(size) / 2
    corners = corners @ turned(turn).T
    there = np.column_stack([width / 2 + corners[:, 0] * PX, height / 2 - corners[:, 1] * PX]) - 0.5
    tall, wide = sheet.shape[:2]
    here = np.array([[0, 0], [wide, 0], [wide, tall], [0, tall]]) - 0.5
    M = cv2.getPerspectiveTransform(here.astype(np.float32), there.astype(np.float32))
    # Smoothed before it is made smaller, as no warp of OpenCV does.
    smooth = cv2.GaussianBlur(sheet, (0, 0), 0.4 * wide / (size[0] * PX))
    laid = cv2.warpPerspective(smooth, M, (width, height), flags=cv2.INTER_LINEAR)
    paper = cv2.warpPerspective(np.full((tall, wide), 255, np.uint8), M, (width, height))
    return np.where(paper[..., None] > 127, laid, image)


def turned(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


def photograph(plane, eye, focal=740.0, size=(800, 600), lens=None, blur=0.0, noise=0.0):
    """The plane as a camera sees it that looks at its middle from `eye` [m], with light that fades
    to the left; and this camera.
    """
    z = -np.array(eye) / np.linalg.norm(eye)
    x = np.cross(z, [0, 0, 1])
    x /= np.linalg.norm(x)
    R = np.stack([x, np.cross(z, x), z])
    camera = Camera(focal, focal, size[0] / 2, size[1] / 2, *size, lens)
    u, v = np.meshgrid(*((np.arange(2 * n) + 0.5) / 2 for n in size))
    seen = camera.normalise(np.stack([u, v], axis=2))
    rays = np.concatenate([seen, np.ones_like(u)[..., None]], axis=2) @ R
    points = np.array(eye[:2]) + (-eye[2] / rays[..., 2:]) * rays[..., :2]
    height, width = plane.shape[:2]
    at = (points * (PX, -PX) + (width / 2, height / 2) - 0.5).astype(np.float32)
    image = cv2.remap(
        plane, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT
    )
    image = cv2.resize(image, size, interpolation=cv2.INTER_AREA) * (
        0.5 + 0.5 * np.linspace(0, 1, size[0])[:, None]
    )
    if blur:
        image = cv2.GaussianBlur(image, (0, 0), blur)
    image = image + np.random.default_rng(1).normal(0, noise, image.shape)
    return image.clip(0, 255).round().astype(np.uint8), camera


def dots_in(picture, tile):
    """Places of the red dots in a straightened picture that is `tile` wide [m], from its middle."""
    scale = picture.shape[1] / tile
    red, green = picture[..., 0].astype(int), picture[..., 1].astype(int)
    is_red = ((red > 1.8 * green) & (red > 50)).astype(np.uint8)
    _, _, found, middles = cv2.connectedComponentsWithStats(is_red)
    whole = found[:, cv2.CC_STAT_AREA] > 0.93 * np.pi * (DOT * scale) ** 2
    whole[0] = False
    height, width = picture.shape[:2]
    return (middles[whole] + 0.5 - (width / 2, height / 2)) * (1, -1) / scale
