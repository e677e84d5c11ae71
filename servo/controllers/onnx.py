"""A policy that is a network's file (ONNX): pictures in, the twist of the camera out."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import Timer
from typing import Annotated, Any, final

import cv2
import numpy as np
from annotated_types import Ge, Le

from servo.controllers._plain_law import SEES_PICTURES, PolicyLaw
from sim.ranges import File
from sim.types import Array, Image, Posture

INPUTS: dict[str, tuple[int | str, ...]] = {
    "picture": (1, 3, "height", "width"),
    "goal_picture": (1, 3, "height", "width"),
    "joints": (1, "n"),
}
"""What a network may take, and its shape; a word stands for any number."""
EXTRA = "it needs the extra 'onnx': pip install 'servobench[onnx]'"


@dataclass(frozen=True, slots=True)
class Config:
    """The network."""

    file: File = ""
    """ONNX file, which ONNX Runtime runs on one core. Its inputs by name, of 32-bit floats: picture
    and goal_picture (1, 3, height, width), red, green and blue from 0 to 1, resized to the
    network's height and width; joints (1, n) [m or rad]. It may take some of them only. Its first
    output is the camera's twist (1, 6) in the camera's frame [m/s, rad/s]."""
    timeout: Annotated[float, Ge(0.1), Le(3600.0)] = 30.0
    """Longest wait for the network's answer [s]: one with a loop may never end."""
    needs = SEES_PICTURES

    def build(self, rng: np.random.Generator) -> PolicyLaw:
        """Return the controller, which uses no random numbers.

        Raises:
            ValueError: The file cannot be read, or its network takes something else.
        """
        return PolicyLaw(Network(self.file, self.timeout).act)


@final
class Network:
    """A network that is ready to act."""

    def __init__(self, file: str, timeout: float) -> None:
        """Read a file.

        Args:
            file: Its path.
            timeout: Longest wait for an answer [s].

        Raises:
            ValueError: It cannot be read, or the network takes something else.
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
        """Return the twist (6,).

        Raises:
            ValueError: The network cannot use what it is given, such as another number of joints,
                or does not end in time.
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
    """Refuse an input that nobody can fill.

    Raises:
        ValueError: It has another name, type or shape.
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


def _filled(value: Array | Image, shape: Sequence[int | str | None]) -> np.ndarray[Any, Any]:
    """Return a value as the network takes it; a picture keeps its size where any will do."""
    if value.ndim == 1:
        return value[None].astype(np.float32)
    sides = zip(shape[2:], value.shape[:2], strict=True)
    height, width = (side if isinstance(side, int) else own for side, own in sides)
    resized = cv2.resize(value, (width, height), interpolation=cv2.INTER_AREA)
    return resized.transpose(2, 0, 1)[None].astype(np.float32) / np.float32(255)


def _sentence(error: Exception) -> str:
    """Return the last part of what ONNX Runtime says, in one line."""
    return " ".join(str(error).split()).rpartition(" : ")[2]
