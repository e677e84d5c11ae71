"""A camera's calibration file, as ROS (camera_info) or OpenCV (FileStorage, YAML or XML) write it.

Both start pixel coordinates at the middle of the first pixel, and we at its corner: 0.5 px more.
"""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from servo.mistake import Mistake, as_mistake
from servo.scenario.toml import is_number
from sim.camera.camera import CameraConfig
from sim.camera.distortion import COEFFICIENTS, Model
from sim.files import reading
from sim.types import Camera

Table = dict[str, Any]
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
THERE_IS = f"there is {', '.join(MODELS)}"
ROS_NAMES = {own: name for name, own in reversed(MODELS.items())}
"""ROS's name of a distortion; the first one where there are two."""
MIDDLE = 0.5
"""Place of the first pixel's middle: zero in ROS and OpenCV [px]."""
BY_COUNT: dict[int, Model] = {4: "plumb_bob", 5: "plumb_bob", 8: "rational"}
"""OpenCV's distortion by the number of its coefficients that are not zero at the end."""
OPENCV = ("%YAML", "<?xml")
"""The beginning of OpenCV's files."""
MATRICES = ("camera_matrix", "distortion_coefficients")
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
NAMING = re.compile(
    "(cam(era)?|calibration|dist(ortion)?(coefficients)?|lens|projection|intrinsics?)*"
    "(model|type)+(name)?|distortion|lens|projection"
)
"""Letters of the keys whose value names a lens, and so is known or refused."""
OWNED = re.compile(
    "(?!.*(model|type|lens|distortion)).*(serial.*|(name|title|id|topic|path|file|image)s?)"
)
"""Letters of the keys whose value is a name of something: a camera called "fisheye" may be none."""
FISHEYE = re.compile("fish|equidist|kannala")
"""Letters of a fisheye, in a key or in a value;"""
OMNI = re.compile("omni(?!vision)|mirrorparameters")
"""those of a lens that sees all around, which is not simulated (but for a maker of sensors)."""
XI = re.compile("(^|[^a-z])xi$")
"""End of a key that has the distance of such a lens's mirror."""
NO_DISTORTION = "none"
UNSAID = ("", NO_DISTORTION, "pinhole", "perspective")
"""Letters of values that leave open which distortion there is."""
YES = ("1", "true", "yes")
NO = ("0", "false", "no")
BINNING = ("binning_x", "binning_y")
ROI = ("x_offset", "y_offset", "width", "height")


def calibrated(camera: Any, place: str) -> Any:
    """Return the table [camera] with the settings of its calibration file in its place.

    Raises:
        Mistake: The file is none, does not fit the image size, or its settings are given as well.
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
        Mistake: It is no calibration of whole pictures, with a distortion that is known.
    """
    document = {
        "image_width": info.width,
        "image_height": info.height,
        "camera_matrix": list(info.k),
        "distortion_model": info.distortion_model,
        "distortion_coefficients": list(info.d) or [0.0],
        "roi": vars(info.roi),
    }
    found = settings_of(document | {key: getattr(info, key) for key in BINNING}, topic)
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
        Mistake: It is no calibration of whole pictures, or of another lens than is simulated.
    """
    size = [document.get(key) for key in ("image_width", "image_height")]
    for key, value in zip(("image_width", "image_height"), size, strict=True):
        if type(value) is not int or value <= 0:
            raise Mistake(f"{place}: {key} = {value!r} should be a number of pixels")
    _check_whole(document, size, place)
    K, values = (_numbers(document.get(key), key, place) for key in MATRICES)
    if len(K) != 9 or K[1] or K[3] or K[6:] != [0.0, 0.0, 1.0] or min(K[0], K[4]) <= 0:
        raise Mistake(
            f"{place}: camera_matrix should be fx 0 cx, 0 fy cy, 0 0 1, without skew, with focal "
            "lengths above zero"
        )
    model = _model(document, place, values)
    written = len(values)
    while len(values) > COEFFICIENTS[model] and values[-1] == 0:
        values = values[:-1]
    if model == "plumb_bob" and len(values) == COEFFICIENTS[model] - 1:
        values = [*values, 0.0]  # without k3
    if not any(values):
        values = [0.0] * COEFFICIENTS[model]
    if len(values) != COEFFICIENTS[model]:
        raise Mistake(
            f"{place}: distortion_coefficients has {written} numbers; "
            f"{model} has {COEFFICIENTS[model]}"
        )
    found = {"size": size, "fx": K[0], "fy": K[4], "cx": K[2] + MIDDLE, "cy": K[5] + MIDDLE}
    return found | {"distortion": model, "coefficients": values}


def _check_whole(document: Table, size: Sequence[Any], place: str) -> None:
    """Refuse what says that pictures are not those of the whole sensor, pixel by pixel."""
    binning = [document.get(key) or 1 for key in BINNING]
    if binning != [1, 1]:
        raise Mistake(
            f"{place}: {' and '.join(BINNING)} are {binning[0]} and {binning[1]}; they should be 0 "
            "or 1: calibrate the pictures as they are"
        )
    roi = document.get("roi") or {}
    corner = [roi.get(key, 0) for key in ROI] if isinstance(roi, dict) else [roi]
    if corner not in ([0, 0, 0, 0], [0, 0, *size]):
        raise Mistake(
            f"{place}: roi ({', '.join(ROI)}) is {', '.join(map(str, corner))}; it should be the "
            "whole picture: calibrate the pictures as they are"
        )


def _of_yaml(text: str, path: Path) -> list[tuple[Any, Any]]:
    """Return the keys and values of a file of ROS, whose documents may be several or empty."""
    import yaml  # few scenarios need it

    pairs: list[tuple[Any, Any]] = []
    loader = yaml.SafeLoader(text)
    try:
        while loader.check_node():
            node = loader.get_node()
            if isinstance(node, yaml.MappingNode):
                # A dictionary would keep the last of two equal keys.
                pairs += loader.construct_pairs(node, deep=True)
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
    written = dict(_leaves(document))
    possible = {key: _possible(f"{place}: {key}", key, value) for key, value in written.items()}
    left = set(COEFFICIENTS).intersection(*possible.values())
    if not left:
        said = [
            f"{key} = {written[key]!r}"
            for key in possible
            if len(possible[key]) < len(COEFFICIENTS)
        ]
        raise Mistake(f"{place}: {' and '.join(said)} are of different lenses")
    if len(left) == 1:
        return left.pop()
    name = document.get("distortion_model")
    if name is not None and _letters(name) == NO_DISTORTION and any(values):
        raise Mistake(f"{place}: distortion_model = {name!r}, but distortion_coefficients has some")
    last = max((i + 1 for i, value in enumerate(values) if value), default=0)
    return BY_COUNT[min((n for n in BY_COUNT if n >= last), default=max(BY_COUNT))]


def _leaves(document: Table, above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the keys and values of a file and of the tables in it, whose keys have dots."""
    for key, value in document.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value


def _possible(place: str, key: str, value: Any) -> set[Model]:
    """Return the distortions that a key of the file leaves open."""
    word = _letters(key)
    letters = "" if value is None else _letters(value)
    if letters in UNSAID or OWNED.fullmatch(word):
        return set(COEFFICIENTS)
    if FISHEYE.search(word):
        if letters not in (*YES, *NO):
            raise Mistake(f"{place} = {value!r} should be 0 or 1 (leave it out if it is neither)")
        return {"fisheye"} if letters in YES else {"plumb_bob", "rational"}
    if (OMNI.search(word) or XI.search(key.lower())) and letters not in NO:
        raise Mistake(f"{place} = {value!r} is of a lens that is not simulated; {THERE_IS}")
    found: set[Model] = {model for name, model in MODELS.items() if _letters(name) == letters}
    names_one = NAMING.fullmatch(word) or FISHEYE.search(letters) or OMNI.search(letters)
    if names_one and not found:
        more = "" if key == "distortion_model" else " (leave it out if it names no lens)"
        raise Mistake(f"{place} = {value!r} is not known; {THERE_IS}{more}")
    return found or set(COEFFICIENTS)


def _letters(text: object) -> str:
    """Return a word without what its spellings differ in: capitals, underscores, hyphens."""
    return re.sub("[^a-z0-9]", "", str(text).lower())


def _numbers(data: Any, key: str, place: str) -> list[float]:
    """Return the numbers of a matrix, which may be a table; YAML takes 1e-05 for a text."""
    data = data.get("data") if isinstance(data, dict) else data
    if data is None:
        raise Mistake(f"{place}: {key} is missing, or has no data")
    if data == []:
        zeros = "" if key == "camera_matrix" else "; a lens without distortion has zeros"
        raise Mistake(f"{place}: {key}.data is empty{zeros}")
    try:
        numbers = np.array(data, np.float64)
    except (TypeError, ValueError, OverflowError):
        numbers = np.array([np.nan])
    if numbers.ndim != 1 or not numbers.size or not np.isfinite(numbers).all():
        raise Mistake(f"{place}: {key}.data should be a list of finite numbers")
    return numbers.tolist()
