"""A policy from a network's file (ONNX): pictures in, the camera twist out."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import Timer
from typing import Annotated, Any, final

import cv2
import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from servo.controllers._plain_law import SEES_PICTURES, PolicyLaw
from sim.ranges import File
from sim.types import Array, Image, Posture

INPUTS: dict[str, tuple[int | str, ...]] = {
    "picture": (1, 3, "height", "width"),
    "goal_picture": (1, 3, "height", "width"),
    "joints": (1, "n"),
}
"""Inputs that a network may have, and their shapes; a word stands for any number."""
EXTRA = "the controller 'onnx' needs ONNX Runtime: pip install 'servobench[onnx]'"


@dataclass(frozen=True, slots=True)
class Config:
    """Settings of a learned policy: its ONNX file, and the longest wait for one output [s]."""

    file: File = ""
    """ONNX file, which ONNX Runtime runs on one core. Its inputs by name, of 32-bit floats: picture
    and goal_picture (1, 3, height, width), red, green and blue from 0 to 1, resized to the
    network's height and width; joints (1, n) [m or rad]. Each input is optional. Its first output
    is the camera twist (1, 6) in the camera frame [m/s, rad/s]."""
    timeout: Annotated[float, Ge(0.1), Le(3600.0)] = 30.0
    """Longest wait for the network's output [s]; a network with a loop may never end."""
    needs = SEES_PICTURES

    def build(self, rng: np.random.Generator) -> PolicyLaw:
        """Return the controller, which uses no random numbers.

        Raises:
            ValueError: ONNX Runtime is missing, the file cannot be read, or an input of the network
            has
                another name, type or shape than `Config.file` lists.
        """
        return PolicyLaw(Network(self.file, self.timeout).act)


@final
class Network:
    """A network that has been loaded from an ONNX file."""

    def __init__(self, file: str, timeout: float) -> None:
        """Load an ONNX file.

        Args:
            file: Path of the file.
            timeout: Longest wait for an output [s].

        Raises:
            ValueError: ONNX Runtime is missing, the file cannot be read, or an input of the network
            has
                another name, type or shape than `Config.file` lists.
        """
        try:
            import onnxruntime
        except ModuleNotFoundError:
            raise ValueError(EXTRA) from None
        if not Path(file).is_file():
            raise ValueError(f"file = '{file}': there is no such file")
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1  # a sum then does not depend on how many cores there are
        options.log_severity_level = 4  # what is wrong is raised as well
        providers = ["CPUExecutionProvider"]
        try:
            self._session: Any = onnxruntime.InferenceSession(file, options, providers)
        except Exception as error:  # its errors have nothing else in common
            raise ValueError(f"file = '{file}': {_sentence(error)}") from None
        self._timeout = timeout
        self._new_options = onnxruntime.RunOptions
        self._shapes = {each.name: each.shape for each in self._session.get_inputs()}
        for each in self._session.get_inputs():
            _check_input(file, each.name, each.type, each.shape)

    def act(self, picture: Image, goal_picture: Image, posture: Posture) -> Array:
        """Return the network's camera twist (6,) in the camera frame [m/s, rad/s].

        Args:
            picture: The camera's picture (H, W, 3).
            goal_picture: The picture (H, W, 3) at the goal.
            posture: Gives the joint positions.

        Raises:
            ValueError: An input does not fit the network, such as another number of joints, or the
                network exceeds the time limit.
        """
        given = {"picture": picture, "goal_picture": goal_picture, "joints": posture.joints}
        inputs = {name: _filled(given[name], shape) for name, shape in self._shapes.items()}
        options = self._new_options()
        limit = Timer(self._timeout, setattr, (options, "terminate", True))
        limit.start()
        try:
            found = self._session.run(None, inputs, options)
        except Exception as error:
            late = f"the network gave no twist within {self._timeout:g} s"
            raise ValueError(late if options.terminate else _sentence(error)) from None
        finally:
            limit.cancel()
        return np.ravel(found[0])


def _check_input(file: str, name: str, kind: str, shape: Sequence[int | str | None]) -> None:
    """Check an input of a network.

    Raises:
        ValueError: It has an unknown name, or another type or shape.
    """
    if name not in INPUTS:
        raise ValueError(f"{file}: the input '{name}' is none of {', '.join(INPUTS)}")
    wanted = INPUTS[name]
    fits = len(shape) == len(wanted) and all(
        has == want or not (isinstance(has, int) and isinstance(want, int))
        for has, want in zip(shape, wanted, strict=True)
    )
    if not fits or kind != "tensor(float)":
        raise ValueError(
            f"{file}: the input '{name}' is {tuple(shape)} of {kind}; it should be "
            f"({', '.join(map(str, wanted))}) of tensor(float)"
        )


def _filled(value: Array | Image, shape: Sequence[int | str | None]) -> NDArray[np.generic]:
    """Return a picture or a vector as a network's input; a picture is resized to sides that the
    network fixes.
    """
    if value.ndim == 1:
        return value[None].astype(np.float32)
    sides = zip(shape[2:], value.shape[:2], strict=True)
    height, width = (side if isinstance(side, int) else own for side, own in sides)
    resized = cv2.resize(value, (width, height), interpolation=cv2.INTER_AREA)
    return resized.transpose(2, 0, 1)[None].astype(np.float32) / np.float32(255)


def _sentence(error: Exception) -> str:
    """Return the last part of an error message of ONNX Runtime, in one line."""
    return " ".join(str(error).split()).rpartition(" : ")[2]
