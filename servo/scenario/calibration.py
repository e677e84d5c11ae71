"""A camera's calibration file, as ROS (camera_info) or OpenCV (FileStorage) write it in YAML.

Both start pixel coordinates at the middle of the first pixel, and we at its corner: 0.5 px more.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import yaml

from servo.mistake import Mistake
from servo.scenario.toml import is_number
from sim.camera.distortion import COEFFICIENTS, Model
from sim.files import reading

Table = dict[str, Any]
LARGEST = 20_000
"""Largest file [bytes]; a calibration has about a thousand."""
GIVES = ("fovy_deg", "fx", "fy", "cx", "cy", "distortion", "coefficients")
"""Settings that a calibration gives, or replaces."""
MODELS: dict[str, Model] = {
    "plumb_bob": "plumb_bob",
    "rational_polynomial": "rational",
    "equidistant": "fisheye",
    "fisheye": "fisheye",
}
"""Our distortion by ROS's name."""
BY_COUNT: dict[int, Model] = {4: "plumb_bob", 5: "plumb_bob", 8: "rational"}
"""OpenCV's distortion by the number of its coefficients that are not zero at the end."""
OPENCV = "%YAML:1.0"
"""The first line of OpenCV's files, which YAML does not allow."""
MOST_PIXELS = 100_000


class _Loader(yaml.SafeLoader):
    """Reads plain values, and OpenCV's matrices as tables; it does not merge tables by `<<`, which
    can make a small file without end.
    """

    def flatten_mapping(self, node: Any) -> None:
        """Leave a table as it is."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        """Refuse aliases, which can make a small file without end."""
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("it has aliases (*name), which are not taken")
        return super().compose_node(parent, index)


_Loader.add_constructor("tag:yaml.org,2002:opencv-matrix", _Loader.construct_yaml_map)


def calibrated(camera: Any, place: str) -> Any:
    """The table [camera] with the settings of its calibration file in its place.

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


def _read(path: Path) -> Table:
    """The size (width, height) of a calibration's image, and its settings for it."""
    document = _document(path)
    size = [_whole(document, key, path) for key in ("image_width", "image_height")]
    K = _numbers(document, "camera_matrix", path, 9)
    if K[1] or K[3] or K[6:] != [0.0, 0.0, 1.0]:
        raise Mistake(f"{path}: camera_matrix should be fx 0 cx, 0 fy cy, 0 0 1, without skew")
    if min(K[0], K[4]) <= 0:
        raise Mistake(
            f"{path}: camera_matrix has the focal lengths {K[0]:g}, {K[4]:g}; they are above zero"
        )
    found = {"size": size, "fx": K[0], "fy": K[4], "cx": K[2] + 0.5, "cy": K[5] + 0.5}
    values = _numbers(document, "distortion_coefficients", path)
    model = _model(document, path, values)
    while len(values) > COEFFICIENTS[model] and values[-1] == 0:
        values = values[:-1]
    if model == "plumb_bob" and len(values) == COEFFICIENTS[model] - 1:
        values = [*values, 0.0]  # without k3
    if len(values) != COEFFICIENTS[model]:
        raise Mistake(
            f"{path}: distortion_coefficients has {len(values)} numbers; "
            f"{model} has {COEFFICIENTS[model]}"
        )
    return found | {"distortion": model, "coefficients": values}


def _document(path: Path) -> Table:
    """The top table of a YAML file."""
    try:
        text = reading.text(path, "calibration", LARGEST)
    except ValueError as error:
        raise Mistake(str(error)) from None
    try:
        document = yaml.load(text.removeprefix(OPENCV), _Loader)
    except (ValueError, RecursionError, yaml.YAMLError) as error:
        mark = getattr(error, "problem_mark", None)
        line = "" if mark is None else f": line {mark.line + 1} is wrong"
        raise Mistake(f"{path}: this is not YAML{line}") from None
    if not isinstance(document, dict):
        raise Mistake(f"{path}: this is no calibration: it should have camera_matrix")
    return document


def _model(document: Table, path: Path, values: list[float]) -> Model:
    """Our distortion: ROS names it; in OpenCV's files the number of coefficients tells."""
    name = document.get("distortion_model")
    if name is None:
        if document.get("fisheye_model"):
            return "fisheye"
        last = max((i + 1 for i, value in enumerate(values) if value), default=0)
        return BY_COUNT[min((n for n in BY_COUNT if n >= last), default=max(BY_COUNT))]
    if not isinstance(name, str) or name not in MODELS:
        raise Mistake(
            f"{path}: distortion_model = {name!r} is not known; there is {', '.join(MODELS)}"
        )
    return MODELS[name]


def _whole(document: Table, key: str, path: Path) -> int:
    value = document.get(key)
    if type(value) is not int or not 0 < value <= MOST_PIXELS:
        raise Mistake(f"{path}: {key} = {value!r} should be a number of pixels")
    return value


def _numbers(document: Table, key: str, path: Path, count: int | None = None) -> list[float]:
    """The numbers of a matrix, which lie in its `data`."""
    matrix = document.get(key)
    data: Any = matrix.get("data") if isinstance(matrix, dict) else None
    numbers = [_number(value) for value in data] if isinstance(data, list) else []
    if not numbers or not all(map(math.isfinite, numbers)) or len(numbers) != (count or len(data)):
        raise Mistake(
            f"{path}: {key}.data should be a list of {f'{count} ' if count else ''}finite numbers"
        )
    return numbers


def _number(value: Any) -> float:
    """A number, also one such as 1e-05, which YAML takes for a text; nan for anything else."""
    try:
        return math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan
