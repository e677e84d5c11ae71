"""Conversion of camera calibrations: reads files in the formats of ROS (camera_info) and OpenCV
(FileStorage), and converts ROS's messages CameraInfo to cameras and back.

ROS and OpenCV measure pixel coordinates from the centre of the top left pixel, servobench from its
outer corner: the principal point is 0.5 px larger here.
"""

import re
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import cv2
import numpy as np
from pydantic import BaseModel, BeforeValidator, Field, FiniteFloat, PositiveInt

from servo.mistake import Mistake, as_mistake
from servo.scenario.draws import leaves
from servo.scenario.fill import validated
from servo.scenario.toml import Table, is_number, is_table
from sim.camera.camera import CameraConfig
from sim.camera.distortion import COEFFICIENTS, Model
from sim.files import reading
from sim.types import Camera

LARGEST_FILE = 20_000
"""Largest file that is read [bytes]; a calibration has about a thousand."""
GIVES = ("fovy_deg", "fx", "fy", "cx", "cy", "distortion", "coefficients")
"""Settings of [camera] that a calibration gives or replaces."""
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
"""Distortion models of servobench by their names in ROS, Kalibr, OKVIS and ORB-SLAM."""
ROS_NAMES = {own: name for name, own in reversed(MODELS.items())}
"""ROS's name of each distortion model."""
LENSES: dict[str, Model] = {name.replace("_", ""): model for name, model in MODELS.items()}
"""Distortion models by the names in `MODELS` without underscores, as `_letters` returns them."""
MIDDLE = 0.5
"""Coordinates of the first pixel's middle in servobench [px]; they are zero in ROS and OpenCV."""
OPENCV = ("%YAML", "<?xml")
"""Beginnings of the files that OpenCV writes."""
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
"""Names of the keys by their spellings, as `_letters` returns them; printed messages of ROS have
the short ones."""
LENS = re.compile(
    r"model|fisheye|lens|mirror|(^|\.)xi$|(camera|distortion|projection)\.?type$|"
    r"^(distortion|projection)$"
)
"""Matches keys whose value names a lens: an unknown value is then an error."""
WIDE = re.compile("fish|equidist|kannala|omnidir")
"""Matches values that name a lens under any key, except under those that match `NAMES`."""
NAMES = re.compile("name|title|serial|file|path|id$")
"""Matches keys of the names of cameras and files."""
NO_DISTORTION = "none"
UNSAID = ("", NO_DISTORTION, "pinhole", "perspective", "0", "false", "no")
"""Values that do not tell which distortion the lens has."""
YES = ("1", "true", "yes")
"""Values of a key such as fisheye_model that mean that the lens is a fisheye."""
ROI = ("x_offset", "y_offset", "width", "height")


def _data(value: object) -> object:
    """Return the numbers of a matrix, given as a list or as a table whose key `data` has the
    list.
    """
    return value.get("data") if is_table(value) else value


Numbers = Annotated[list[FiniteFloat], Field(min_length=1), BeforeValidator(_data)]


class Calibration(BaseModel):
    """The values of a calibration file that are numbers, with their types and ranges: image size
    [px], camera matrix (9 numbers, row by row), distortion coefficients, binning and region of
    interest. The name of the distortion model is read separately, as its key varies.
    """

    image_width: PositiveInt
    image_height: PositiveInt
    camera_matrix: Numbers
    distortion_coefficients: Numbers
    binning_x: Literal[0, 1] = 0
    binning_y: Literal[0, 1] = 0
    roi: dict[str, int] = Field(default_factory=dict[str, int])


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """Intrinsics that a calibration file gives for the table [camera] of a scenario: image size,
    focal lengths and principal point [px], which is measured from the image's top left corner, and
    the model and coefficients of the lens distortion.
    """

    width: int
    """Image width [px]."""
    height: int
    """Image height [px]."""
    fx: float
    """Focal lengths fx, fy and principal point cx, cy [px], measured from the image's corner."""
    fy: float
    cx: float
    cy: float
    distortion: Model
    coefficients: list[float]
    """Coefficients of the distortion, in OpenCV's order."""


def calibrated(camera: object, place: str) -> object:
    """Return a table [camera] of a scenario in which the settings of the calibration file that its
    key `calibration` names replace this key: image size, focal lengths and principal point [px],
    and distortion. If the table has another width than the file, the lengths are scaled to it.

    Args:
        camera: The table, which is not changed; anything without a text `calibration` is returned
            as it is.
        place: Where the table comes from; it begins messages.

    Raises:
        Mistake: The file is no calibration, its lens model is not simulated, its image has another
            aspect ratio than the table's, or the table also has a setting that the file gives.
    """
    if not is_table(camera) or not isinstance(camera.get("calibration"), str):
        return camera
    for key in GIVES:
        if key in camera:
            raise Mistake(f"{place}: {key} and calibration both give the lens; leave one out")
    path = Path(str(camera["calibration"]))
    found = _read(path)
    width = camera.get("width", found.width)
    height = camera.get("height", found.height)
    if is_number(width) and is_number(height):
        if width * found.height != height * found.width:
            raise Mistake(
                f"{place}: {width} x {height} px has another aspect ratio than the {found.width} x "
                f"{found.height} px of {path}: correct camera.width or camera.height"
            )
        scaled = {
            key: getattr(found, key) * width / found.width for key in ("fx", "fy", "cx", "cy")
        }
        found = replace(found, **scaled)
    kept = {key: value for key, value in camera.items() if key != "calibration"}
    return kept | asdict(found) | {"width": width, "height": height}


def camera_info(camera: Camera) -> dict[str, Any]:
    """Return the fields of ROS's message sensor_msgs/CameraInfo for a camera, by name, without
    header and region of interest. The principal point [px] is measured from the centre of the top
    left pixel, as in ROS.
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
    """Return the camera (intrinsics [px] and lens distortion) that a ROS message
    sensor_msgs/CameraInfo describes.

    Args:
        info: The message, an object with the message's fields.
        topic: Its topic, for error messages.

    Raises:
        Mistake: A field is wrong, the region of interest is not the whole picture, or the lens
            model is not simulated.
    """
    document: Table = {
        "image_width": info.width,
        "image_height": info.height,
        "camera_matrix": list(info.k),
        "distortion_model": info.distortion_model,
        "distortion_coefficients": list(info.d) or [0.0],
        "roi": vars(info.roi),
        "binning_x": info.binning_x,
        "binning_y": info.binning_y,
    }
    found = intrinsics_of(document, topic)
    return _camera(found)


def camera_in(path: Path) -> Camera:
    """Return the camera (intrinsics [px] and lens distortion) that a calibration file of ROS or
    OpenCV describes.

    Raises:
        Mistake: The file cannot be read or is no calibration, or its lens model is not simulated.
    """
    return _camera(_read(path))


def _camera(found: Intrinsics) -> Camera:
    config = CameraConfig(distortion=found.distortion, coefficients=tuple(found.coefficients))
    size = (found.width, found.height)
    return Camera(found.fx, found.fy, found.cx, found.cy, *size, distortion=config.lens)


def _read(path: Path) -> Intrinsics:
    """Read a calibration file of ROS or OpenCV.

    Raises:
        Mistake: The file cannot be read or is no calibration, or a key in it is wrong.
    """
    with as_mistake():
        text = reading.text(path, "calibration", LARGEST_FILE)
    pairs = _of_opencv(text, path) if text.startswith(OPENCV) else _of_yaml(text, path)
    document: Table = {}
    for written, value in pairs:
        key = KEYS.get(_letters(written), str(written))
        if key in document:
            raise Mistake(f"{path}: {key} is given twice: leave only the calibration of one camera")
        document[key] = value
    if document.keys().isdisjoint(KEYS.values()):
        raise Mistake(
            f"{path}: this is no calibration of a camera: camera_matrix is missing: name a file of "
            "ROS or OpenCV"
        )
    return intrinsics_of(document, str(path))


def intrinsics_of(document: Table, place: str) -> Intrinsics:
    """Check the keys and values of a calibration, and return them as intrinsics; the principal
    point is moved by 0.5 px, so that it is measured from the image's top left corner.

    Args:
        document: Values by key, named as in files of ROS's camera_calibration.
        place: The file or the topic, for messages.

    Raises:
        Mistake: A key is missing or wrong, the region of interest is not the whole picture, or the
            lens model is not simulated.
    """
    given = validated(Calibration, document, f"{place}: ")
    size = (given.image_width, given.image_height)
    if tuple(given.roi.get(key, 0) for key in ROI) not in ((0, 0, 0, 0), (0, 0, *size)):
        raise Mistake(
            f"{place}: roi = {given.roi} is not the whole picture; give the calibration of "
            "the whole picture"
        )
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
            f"{place}: distortion_coefficients has {len(values)} numbers, and the lens model "
            f"{model} has {count}: correct the numbers or the model"
        )
    values = [*values, *[0.0] * count][:count]
    return Intrinsics(*size, K[0], K[4], K[2] + MIDDLE, K[5] + MIDDLE, model, values)


def _of_yaml(text: str, path: Path) -> list[tuple[object, object]]:
    """Return the keys and values of a YAML file of ROS, which may have several documents.

    Raises:
        Mistake: The text is not YAML; the message names the file `path`.
    """
    import yaml  # few scenarios need it

    pairs: list[tuple[object, object]] = []
    try:
        for node in yaml.compose_all(text, yaml.SafeLoader):
            if isinstance(node, yaml.MappingNode):
                # A dictionary would keep the last of two equal keys.
                pairs += yaml.SafeLoader("").construct_pairs(node, deep=True)
    except (ValueError, yaml.YAMLError) as error:
        mark = getattr(error, "problem_mark", None)
        line = "it" if mark is None else f"line {mark.line + 1}"
        raise Mistake(f"{path}: this calibration is not valid YAML: correct {line}") from None
    return pairs


def _of_opencv(text: str, path: Path) -> list[tuple[str, object]]:
    """Return the keys and values of a YAML or XML file that OpenCV's FileStorage wrote.

    Raises:
        Mistake: OpenCV cannot read the text; the message names the file `path`.
    """
    try:
        file = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        root = file.root()
        return [(key, _value(root.getNode(key))) for key in root.keys()]  # noqa: SIM118
    # SystemError: OpenCV failed in its constructor, as it does on a file that is cut.
    except (cv2.error, SystemError, ValueError, OverflowError):
        raise Mistake(
            f"{path}: OpenCV cannot read this file, though it begins like a file of OpenCV: write "
            "the calibration again, or, for a YAML file of ROS, remove the line %YAML"
        ) from None


def _value(node: cv2.FileNode) -> object:
    """Return the value of a node of OpenCV's FileStorage: a number, a text, a list, a table, or the
    list of a matrix's numbers; None for an empty node.
    """
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
    """Return the distortion model that a calibration file names; if it names none, "rational" for
    coefficients that are not zero beyond the fifth, else "plumb_bob".

    Args:
        document: Keys and values of the file.
        place: The file or the topic, for messages.
        values: The distortion's coefficients.

    Raises:
        Mistake: The file names an unknown lens or several different ones, or has the distortion
            model "none" with coefficients that are not zero.
    """
    named: dict[Model, str] = {}
    for key, value in leaves(document):
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
                f"{place}: {key} = {value!r} is no known lens model; there is {', '.join(MODELS)} "
                "(leave it out if it names no lens)"
            )
        named[model] = f"{key} = {value!r}"
    if len(named) > 1:
        raise Mistake(
            f"{place}: {' and '.join(named.values())} are of different lenses: leave one out"
        )
    if named:
        return next(iter(named))
    name = document.get("distortion_model")
    if name is not None and _letters(name) == NO_DISTORTION and any(values):
        raise Mistake(
            f"{place}: distortion_model = {name!r}, but distortion_coefficients are given: "
            "leave one out"
        )
    return "rational" if any(values[COEFFICIENTS["plumb_bob"] :]) else "plumb_bob"


def _letters(text: object) -> str:
    """Return a text in lower case with only its letters, digits and dots, so that spellings of one
    name are equal.
    """
    return re.sub("[^a-z0-9.]", "", str(text).lower())
