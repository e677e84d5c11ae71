"""Controller that runs a learned policy, a network in an ONNX file: pictures, joint positions,
camera, pose and depth in, the camera twist out.
"""

import re
from collections.abc import Mapping, Sequence
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
from sim.types import Array, Camera, Image, Posture

INPUTS: dict[str, tuple[int | str, ...]] = {
    "picture": (1, 3, "height", "width"),
    "goal_picture": (1, 3, "height", "width"),
    "joints": (1, "n"),
    "camera": (1, 4),
    "pose": (1, 12),
    "depth": (1, 1),
}
"""Inputs that a network may have, and their shapes; a word stands for any number."""
SINCE_START = frozenset({"camera", "pose", "depth"})
"""Inputs of a policy that knows its camera; its joints are counted from the first picture."""
HEAD = re.compile(r"^\[ONNXRuntimeError\] : \d+ : \w+ : ")
"""Matches the beginning of an ONNX Runtime error message: its number and name."""
EXTRA = "the controller 'onnx' needs ONNX Runtime: pip install 'servobench[onnx]'"


@dataclass(frozen=True, slots=True)
class Config:
    """Settings of a learned policy: its ONNX file, and the longest wait [s] for one output of the
    network, a camera twist.
    """

    file: File = ""
    """ONNX file, which ONNX Runtime runs on one core. Its inputs by name, of 32-bit floats: picture
    and goal_picture (1, 3, height, width), red, green and blue from 0 to 1, resized to the
    network's height and width; joints (1, n) [m or rad]; camera (1, 4), the believed fx, fy, cx, cy
    of the pictures before they are resized [px]; pose (1, 12), the rotation by rows and the
    translation [m] of the camera in the frame of the camera at the first picture; depth (1, 1), the
    believed one at the goal [m]. Each input is optional. With camera, pose or depth, joints are
    counted from the first picture. Its first output is the camera twist (1, 6) in the camera frame
    [m/s, rad/s]."""
    timeout: Annotated[float, Ge(0.1), Le(3600.0)] = 30.0
    """Longest wait for the network's output [s]; a network with a loop may never end."""
    needs = SEES_PICTURES

    def build(self, rng: np.random.Generator) -> PolicyLaw:
        """Return the controller with the network loaded; it uses no random numbers.

        Raises:
            ValueError: ONNX Runtime is missing, the file cannot be read, or an input of the network
                has a name, type or shape other than those that the setting `file` describes.
        """
        network = Network(self.file, self.timeout)
        return PolicyLaw(network.act_by_camera if network.knows_camera else network.act)


@final
class Network:
    """Neural network that was loaded from an ONNX file, and computes a camera twist from those of
    these inputs that it has: picture, picture at the goal, joint positions, camera intrinsics,
    camera pose and depth. `timeout` is the longest wait for its output [s].
    """

    def __init__(self, file: str, timeout: float) -> None:
        """Load an ONNX file, and check the inputs of its network.

        Args:
            file: Path of the file.
            timeout: Longest wait for an output [s].

        Raises:
            ValueError: ONNX Runtime is missing, the file cannot be read, or an input of the network
                has a name, type or shape other than those of `Config.file`.
        """
        try:
            import onnxruntime
        except ModuleNotFoundError:
            raise ValueError(EXTRA) from None
        if not Path(file).is_file():
            raise ValueError(f"file = '{file}': there is no such file: name the network's file")
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1  # a sum then does not depend on how many cores there are
        options.log_severity_level = 4  # what is wrong is raised as well
        providers = ["CPUExecutionProvider"]
        try:
            self._session: Any = onnxruntime.InferenceSession(file, options, providers)
        except Exception as error:  # its errors have nothing else in common
            raise ValueError(
                f"file = '{file}': ONNX Runtime cannot load this network; export it again: "
                f"{_reason(error)}"
            ) from None
        self._timeout = timeout
        self._new_options = onnxruntime.RunOptions
        self._shapes = {each.name: each.shape for each in self._session.get_inputs()}
        for each in self._session.get_inputs():
            _check_input(file, each.name, each.type, each.shape)
        self.knows_camera = not SINCE_START.isdisjoint(self._shapes)
        """Whether the network has an input camera, pose or depth."""

    def act(self, picture: Image, goal_picture: Image, posture: Posture) -> Array:
        """Return the first output of a network without the inputs camera, pose and depth
        (`knows_camera` is False) as a vector, which should be a camera twist (6,) in the camera
        frame [m/s, rad/s]; its shape is not checked here. The network is given those of the
        arguments that it has as inputs.

        Args:
            picture: The camera's RGB picture (H, W, 3) of uint8.
            goal_picture: The RGB picture (H, W, 3) of uint8 that was taken at the goal.
            posture: State of the robot; only its joint positions (n,) [m or rad] are used.

        Raises:
            ValueError: An input does not fit the network, such as another number of joints, or the
                network exceeds the time limit.
        """
        return self._twist(
            {"picture": picture, "goal_picture": goal_picture, "joints": posture.joints}
        )

    def act_by_camera(
        self, picture: Image, goal_picture: Image, camera: Camera, posture: Posture, depth: float
    ) -> Array:
        """Return the first output of a network that knows its camera, as a vector, which should be
        a camera twist (6,) in the camera frame [m/s, rad/s]; its shape is not checked here. The
        network is given those of the arguments that it has as inputs.

        Args:
            picture: The camera's RGB picture (H, W, 3) of uint8.
            goal_picture: The RGB picture (H, W, 3) of uint8 that was taken at the goal.
            camera: The camera as the robot believes it to be; its fx, fy, cx, cy [px] are used.
            posture: State of the robot relative to that at the first picture; its joint positions
                and the camera's pose are used.
            depth: Believed depth at the goal, on the optical axis [m].

        Raises:
            ValueError: An input does not fit the network, such as another number of joints, or the
                network exceeds the time limit.
        """
        pose = posture.T_base_camera
        return self._twist(
            {
                "picture": picture,
                "goal_picture": goal_picture,
                "joints": posture.joints,
                "camera": np.array([camera.fx, camera.fy, camera.cx, camera.cy]),
                "pose": np.concatenate([pose.rotation.ravel(), pose.translation]),
                "depth": np.array([depth]),
            }
        )

    def _twist(self, given: Mapping[str, Array | Image]) -> Array:
        """Return the network's first output as a vector (n,), from the values of its inputs and
        perhaps others.

        Raises:
            ValueError: An input does not fit the network, or the network exceeds the time limit.
        """
        inputs = {name: _filled(given[name], shape) for name, shape in self._shapes.items()}
        options = self._new_options()
        limit = Timer(self._timeout, setattr, (options, "terminate", True))
        limit.start()
        try:
            found = self._session.run(None, inputs, options)
        except Exception as error:
            late = (
                f"the network gave no twist within {self._timeout:g} s: correct the network, or "
                "set a longer controller.timeout"
            )
            failed = f"ONNX Runtime cannot run the network; correct it: {_reason(error)}"
            raise ValueError(late if options.terminate else failed) from None
        finally:
            limit.cancel()
        return np.ravel(found[0])


def _check_input(file: str, name: str, kind: str, shape: Sequence[int | str | None]) -> None:
    """Check the name, type and shape of an input of a network against `INPUTS`.

    Raises:
        ValueError: The name is not in `INPUTS`, or type or shape do not fit it.
    """
    if name not in INPUTS:
        raise ValueError(
            f"{file}: the network's input '{name}' is not one of {', '.join(INPUTS)}: rename the "
            "input"
        )
    wanted = INPUTS[name]
    fits = len(shape) == len(wanted) and all(
        has == want or not (isinstance(has, int) and isinstance(want, int))
        for has, want in zip(shape, wanted, strict=True)
    )
    if not fits or kind != "tensor(float)":
        raise ValueError(
            f"{file}: the network's input '{name}' is {tuple(shape)} of {kind}; expected "
            f"({', '.join(map(str, wanted))}) of tensor(float)"
        )


def _filled(value: Array | Image, shape: Sequence[int | str | None]) -> NDArray[np.generic]:
    """Return a vector (n,) as a network's input (1, n), or a picture (H, W, 3) as (1, 3, h, w) from
    0 to 1, both of float32. The picture is resized to the height and width that the network's shape
    fixes.
    """
    if value.ndim == 1:
        return value[None].astype(np.float32)
    sides = zip(shape[2:], value.shape[:2], strict=True)
    height, width = (side if isinstance(side, int) else own for side, own in sides)
    resized = cv2.resize(value, (width, height), interpolation=cv2.INTER_AREA)
    return resized.transpose(2, 0, 1)[None].astype(np.float32) / np.float32(255)


def _reason(error: Exception) -> str:
    """Return the message of an ONNX Runtime error in one line, without its head, such as
    "[ONNXRuntimeError] : 10 : INVALID_GRAPH : ".
    """
    return HEAD.sub("", " ".join(str(error).split()))
