"""A camera's calibration file, as ROS (camera_info) or OpenCV (FileStorage, YAML or XML) write it.

Both start pixel coordinates at the middle of the first pixel, and we at its corner: 0.5 px more.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

import cv2
import numpy as np
from pydantic import (
    BaseModel,
    BeforeValidator,
    Field,
    FiniteFloat,
    PositiveInt,
)

from servo.mistake import Mistake, as_mistake
from servo.scenario.fill import validated
from servo.scenario.toml import Table, is_number
from sim.camera.camera import CameraConfig
from sim.camera.distortion import COEFFICIENTS, Model
from sim.files import reading
from sim.types import Camera

LARGEST_FILE = 20_000
"""Largest file [bytes]; a calibration has about a thousand."""
GIVES = ("fovy_deg", "fx", "fy", "cx", "cy", "distortion", "coefficients")
"""Settings that a calibration gives, or replaces."""
MODELS: dict[str, Model] = {
    "plumb_bob": "plumb_bob",
    "radtan": "plumb_bob",
    "radial_tangential": "plumb_bob",
    "rational_polynomial": "rational",
    "rational": "rational",
    "equidistant": "fisheye",
    "fisheye": "fisheye",
    "kannala_brandt": "fisheye",
    "kannala_brandt4": "fisheye",
    "kannala_brandt8": "fisheye",
}
"""Our distortion by the names of ROS, Kalibr, OKVIS and ORB-SLAM, where the formula is the same."""
ROS_NAMES = {own: name for name, own in reversed(MODELS.items())}
"""ROS's name of a distortion; the first one where there are two."""
LENSES: dict[str, Model] = {name.replace("_", ""): model for name, model in MODELS.items()}
"""The same by the letters of their names."""
MIDDLE = 0.5
"""Place of the first pixel's middle: zero in ROS and OpenCV [px]."""
OPENCV = ("%YAML", "<?xml")
"""The beginning of OpenCV's files."""
KEYS = {
    "imagewidth": "image_width",
    "width": "image_width",
    "imageheight": "image_height",
    "height": "image_height",
    "cameramatrix": "camera_matrix",
    "k": "camera_matrix",
    "distortioncoefficients": "distortion_coefficients",
    "d": "distortion_coefficients",
}
"""The keys by their letters; a message of ROS, printed, has the short ones."""
LENS = re.compile(
    r"model|fisheye|lens|mirror|(^|\.)xi$|(camera|distortion|projection)\.?type$|"
    r"^(distortion|projection)$"
)
"""Letters of the keys whose value names a lens, and so is known or refused."""
WIDE = re.compile("fish|equidist|kannala|omnidir")
"""Letters of values that name a lens whatever their key is, but for names of cameras and files."""
NAMES = re.compile("name|title|serial|file|path|id$")
"""Letters of the keys of such names."""
NO_DISTORTION = "none"
UNSAID = ("", NO_DISTORTION, "pinhole", "perspective", "0", "false", "no")
"""Letters of values that leave open which distortion there is."""
YES = ("1", "true", "yes")
"""Letters of the values of a key such as fisheye_model, which is a question."""
ROI = ("x_offset", "y_offset", "width", "height")


def _data(value: object) -> object:
    """Return the numbers of a matrix, which may be a table with `data`."""
    return value.get("data") if isinstance(value, dict) else value


Numbers = Annotated[list[FiniteFloat], Field(min_length=1), BeforeValidator(_data)]


class Calibration(BaseModel):
    """The keys of a calibration that are read, with their types and ranges."""

    image_width: PositiveInt
    image_height: PositiveInt
    camera_matrix: Numbers
    distortion_coefficients: Numbers
    binning_x: Literal[0, 1] = 0
    binning_y: Literal[0, 1] = 0
    roi: dict[str, int] = Field(default_factory=dict[str, int])


def calibrated(camera: Any, place: str) -> Any:
    """Return the table [camera] with the settings of its calibration file in its place.

    Raises:
        Mistake: The file is no calibration or has another shape of image, or the table gives the
            lens as well.
    """
    if not isinstance(camera, dict) or not isinstance(camera.get("calibration"), str):
        return camera
    for key in GIVES:
        if key in camera:
            raise Mistake(f"{place}: {key} and calibration both give the lens; leave one out")
    path = Path(camera["calibration"])
    found = _read(path)
    own = found.pop("size")
    size = [camera.get(key, given) for key, given in zip(("width", "height"), own, strict=True)]
    if all(map(is_number, size)):
        if size[0] * own[1] != size[1] * own[0]:
            raise Mistake(
                f"{place}: {size[0]} x {size[1]} px has not the shape of the {own[0]} x {own[1]} "
                f"px of {path}"
            )
        found |= {key: found[key] * size[0] / own[0] for key in ("fx", "fy", "cx", "cy")}
    kept = {key: value for key, value in camera.items() if key != "calibration"}
    return kept | {"width": size[0], "height": size[1]} | found


def camera_info(camera: Camera) -> dict[str, Any]:
    """Return the fields of ROS's message sensor_msgs/CameraInfo for a camera, but for its header
    and region of interest.
    """
    lens = camera.distortion
    cx, cy = camera.cx - MIDDLE, camera.cy - MIDDLE
    return {
        "height": camera.height,
        "width": camera.width,
        "distortion_model": "plumb_bob" if lens is None else ROS_NAMES[lens.model],
        "d": [0.0] * 5 if lens is None else list(lens.coefficients),
        "k": [camera.fx, 0.0, cx, 0.0, camera.fy, cy, 0.0, 0.0, 1.0],
        "r": np.eye(3).ravel().tolist(),
        "p": [camera.fx, 0.0, cx, 0.0, 0.0, camera.fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        "binning_x": 0,
        "binning_y": 0,
    }


def camera_of_info(info: Any, topic: str) -> Camera:
    """Return the camera of ROS's message sensor_msgs/CameraInfo.

    Raises:
        Mistake: The message is wrong, as for `settings_of`.
    """
    document = {
        "image_width": info.width,
        "image_height": info.height,
        "camera_matrix": list(info.k),
        "distortion_model": info.distortion_model,
        "distortion_coefficients": list(info.d) or [0.0],
        "roi": vars(info.roi),
        "binning_x": info.binning_x,
        "binning_y": info.binning_y,
    }
    found = settings_of(document, topic)
    width, height = found.pop("size")
    lens = CameraConfig(
        distortion=found.pop("distortion"), coefficients=tuple(found.pop("coefficients"))
    ).lens
    return Camera(width=width, height=height, distortion=lens, **found)


def _read(path: Path) -> Table:
    """Return the size (width, height) of a calibration's image, and its settings for it."""
    with as_mistake():
        text = reading.text(path, "calibration", LARGEST_FILE)
    pairs = _of_opencv(text, path) if text.startswith(OPENCV) else _of_yaml(text, path)
    document: Table = {}
    for written, value in pairs:
        key = KEYS.get(_letters(written), str(written))
        if key in document:
            raise Mistake(f"{path}: {key} is there twice; a calibration is that of one camera")
        document[key] = value
    if document.keys().isdisjoint(KEYS.values()):
        raise Mistake(f"{path}: this is no calibration: it should have camera_matrix")
    return settings_of(document, str(path))


def settings_of(document: Table, place: str) -> Table:
    """Return the size (width, height) of a calibration's image, and its settings for it.

    Args:
        document: The keys of the file, and their values.
        place: Its file or topic, for messages.

    Raises:
        Mistake: A key is missing or wrong, the calibration is of a part of the picture, or of a
            lens that is not simulated.
    """
    given = validated(Calibration, document, f"{place}: ")
    size = [given.image_width, given.image_height]
    if [given.roi.get(key, 0) for key in ROI] not in ([0, 0, 0, 0], [0, 0, *size]):
        raise Mistake(f"{place}: roi = {given.roi} should be the whole picture")
    K, values = given.camera_matrix, given.distortion_coefficients
    if len(K) != 9 or K[1] or K[3] or K[6:] != [0.0, 0.0, 1.0] or min(K[0], K[4]) <= 0:
        raise Mistake(
            f"{place}: camera_matrix should be fx 0 cx, 0 fy cy, 0 0 1, without skew, with focal "
            "lengths above zero"
        )
    model = _model(document, place, values)
    count = COEFFICIENTS[model]
    fewest = count - 1 if model == "plumb_bob" else count  # k3 may be left out
    if any(values[count:]) or (any(values) and len(values) < fewest):
        raise Mistake(
            f"{place}: distortion_coefficients has {len(values)} numbers; {model} has {count}"
        )
    values = [*values, *[0.0] * count][:count]
    found = {"size": size, "fx": K[0], "fy": K[4], "cx": K[2] + MIDDLE, "cy": K[5] + MIDDLE}
    return found | {"distortion": model, "coefficients": values}


def _of_yaml(text: str, path: Path) -> list[tuple[Any, Any]]:
    """Return the keys and values of a file of ROS, whose documents may be several or empty."""
    import yaml  # few scenarios need it

    pairs: list[tuple[Any, Any]] = []
    try:
        for node in yaml.compose_all(text, yaml.SafeLoader):
            if isinstance(node, yaml.MappingNode):
                # A dictionary would keep the last of two equal keys.
                pairs += yaml.SafeLoader("").construct_pairs(node, deep=True)
    except (ValueError, yaml.YAMLError) as error:
        mark = getattr(error, "problem_mark", None)
        line = "" if mark is None else f": line {mark.line + 1} is wrong"
        raise Mistake(f"{path}: this is not YAML{line}") from None
    return pairs


def _of_opencv(text: str, path: Path) -> list[tuple[str, Any]]:
    """Return the keys and values of a file of OpenCV."""
    try:
        file = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        root = file.root()
        return [(key, _value(root.getNode(key))) for key in root.keys()]  # noqa: SIM118
    # SystemError: OpenCV failed in its constructor, as it does on a file that is cut.
    except (cv2.error, SystemError, ValueError, OverflowError):
        raise Mistake(f"{path}: this is no file that OpenCV wrote, or it is damaged") from None


def _value(node: cv2.FileNode) -> Any:
    """Return what a node has: a number, a text, a list, a table, or the numbers of a matrix."""
    if node.isInt():
        return int(node.real())
    if node.isReal():
        return node.real()
    if node.isString():
        return node.string()
    if node.isSeq():
        return [_value(node.at(place)) for place in range(node.size())]
    if not node.isMap():
        return None
    if "dt" in node.keys():  # noqa: SIM118
        return node.mat().ravel().tolist() if node.getNode("data").size() else []
    return {key: _value(node.getNode(key)) for key in node.keys()}  # noqa: SIM118


def _model(document: Table, place: str, values: list[float]) -> Model:
    """Return the distortion that the file names; else that of the number of its coefficients."""
    named: dict[Model, str] = {}
    for key, value in _leaves(document):
        word = _letters(key)
        letters = "" if value is None else _letters(value)
        if "fisheye" in word and letters in YES:
            letters = "fisheye"
        is_named = WIDE.search(letters) is not None and not NAMES.search(word)
        if not (LENS.search(word) or is_named) or letters in UNSAID:
            continue
        model = LENSES.get(letters)
        if model is None:
            raise Mistake(
                f"{place}: {key} = {value!r} is not known; there is {', '.join(MODELS)} "
                "(leave it out if it names no lens)"
            )
        named[model] = f"{key} = {value!r}"
    if len(named) > 1:
        raise Mistake(f"{place}: {' and '.join(named.values())} are of different lenses")
    if named:
        return next(iter(named))
    name = document.get("distortion_model")
    if name is not None and _letters(name) == NO_DISTORTION and any(values):
        raise Mistake(f"{place}: distortion_model = {name!r}, but distortion_coefficients has some")
    return "rational" if any(values[COEFFICIENTS["plumb_bob"] :]) else "plumb_bob"


def _leaves(document: Table, above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the keys and values of a file and of the tables in it, whose keys have dots."""
    for key, value in document.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value


def _letters(text: object) -> str:
    """Return a word without capitals, underscores and hyphens, in which spellings differ."""
    return re.sub("[^a-z0-9.]", "", str(text).lower())
