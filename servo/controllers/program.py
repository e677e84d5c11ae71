"""Policy in a process of its own, in any language, that reads and writes lines of JSON.

The program gets a line of JSON, and after a line with a width and a height the picture as raw bytes
(height x width x 3, red, green, blue); it answers each line with a line of its own:

| it gets | it answers |
|---|---|
| {"seed": 7} | {}, when it has loaded what it needs |
| {"width": 320, "height": 240, "goal": {"camera": {"fx": 300.0, "fy": 300.0, "cx": 160.0, \
"cy": 120.0}, "depth": 0.6}} and the picture at the goal, which begins a run | {} |
| {"width": 320, "height": 240, "posture": {"rotation": [[...], ...], "translation": [...], \
"twist": [...], "joints": [...], "lower": [...], "upper": [...], "jacobian": [[...], ...]}} and \
the camera's picture | {"twist": [vx, vy, vz, wx, wy, wz]} |

The camera is the believed one [px], with "distortion": {"model": ..., "coefficients": [...]} if its
lens has one; the depth is the believed one at the goal [m]. `rotation` (3, 3) and `translation`
(3,) [m] are the camera's pose in the frame of the camera at the first picture, `twist` is its
measured twist (6,) [m/s, rad/s]; `joints` and their limits `lower` and `upper` (n,) [m or rad],
null without a limit, are counted from the first picture; `jacobian` (6, n) is the camera twist per
joint rate. The answer is the camera twist in the camera frame [m/s, rad/s]. The end of its input
asks the program to end, and {"error": "..."} ends the run with that sentence.
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from servo.controllers._plain_law import SEES_PICTURES, PolicyLaw
from sim.plain_part import DRAWN
from sim.types import Array, Camera, Image, Posture
from tracking.guests.guest import Limit
from tracking.guests.json_lines import JsonLines, Line


@dataclass(frozen=True, slots=True)
class Config:
    """Settings of a policy in a process of its own: its command, and time limits of its answers."""

    needs = SEES_PICTURES
    not_from_file = ("command",)

    command: str = ""
    """The program with its arguments, such as "python my_policy.py"; run without a shell."""
    timeout: Limit = 30.0
    """Longest wait for the twist after a picture [s]."""
    loading: Limit = 120.0
    """Longest wait for the first answer, before which the policy loads what it needs [s]."""

    def build(self, rng: np.random.Generator) -> PolicyLaw:
        """Start the program, send it a seed for its random numbers, which is drawn from `rng`, wait
        until it has answered, and return the controller.

        Raises:
            ValueError: The program does not start, or its first answer is missing or not valid.
        """
        program = PolicyProgram(self.command, DRAWN["seed"](rng), self.timeout, self.loading)
        return PolicyLaw(program.act, program.reset)


@final
class PolicyProgram:
    """Connection to a policy, a program in a process of its own that returns a camera twist for
    each picture (`act`); the program is ended when this object is deleted.
    """

    def __init__(self, command: str, seed: int, timeout: float, loading: float) -> None:
        """Start a program and wait until it is ready.

        Args:
            command: The program and its arguments, quoted as in a shell; no shell runs it.
            seed: Seed for the program's random numbers.
            timeout: Longest wait for the answer to a picture [s].
            loading: Longest wait for the first answer [s].

        Raises:
            ValueError: The program does not start, sends no line of JSON, or reports an error.
        """
        self._program = JsonLines(command, seed, timeout, loading)
        self._is_new_run = True

    def reset(self) -> None:
        """Begin a new run: the next call of `act` sends the picture at the goal before the camera's
        picture.
        """
        self._is_new_run = True

    def act(
        self, picture: Image, goal_picture: Image, camera: Camera, posture: Posture, depth: float
    ) -> Array:
        """Send a picture to the program, and return its answer: the camera twist (6,) in the camera
        frame [m/s, rad/s].

        Args:
            picture: The camera's RGB picture (H, W, 3) of uint8.
            goal_picture: The RGB picture (H, W, 3) at the goal; it is sent only in the first call
                of a run, with `camera` and `depth`.
            camera: The camera as the robot believes it to be.
            posture: State of the robot, relative to that at the first picture.
            depth: Believed depth at the goal, on the optical axis [m].

        Raises:
            ValueError: The program has ended, hangs, reports an error, or answers no twist of six
                numbers.
        """
        if self._is_new_run:
            self._is_new_run = False
            self._program.show(
                goal_picture, {"goal": {"camera": intrinsics_of(camera), "depth": depth}}
            )
        answer = self._program.show(picture, {"posture": words_of(posture)})
        twist = answer.get("twist")
        try:
            found = np.array(twist, float)
        except (TypeError, ValueError):
            found = np.empty(0)
        if found.shape != (6,):
            self._program.fail(
                f"answered the twist {str(twist)[:80]}, which is no list of 6 numbers"
            )
        return found


def intrinsics_of(camera: Camera) -> Line:
    """Return a camera's intrinsics as a mapping that JSON can write: the keys fx, fy, cx and cy
    [px], and for a lens that distorts `distortion`, with the keys `model` and `coefficients`.
    """
    found = dict[str, object](fx=camera.fx, fy=camera.fy, cx=camera.cx, cy=camera.cy)
    if camera.distortion is not None:
        model, coefficients = camera.distortion.model, camera.distortion.coefficients
        found["distortion"] = {"model": model, "coefficients": list(coefficients)}
    return found


def words_of(posture: Posture) -> Line:
    """Return a posture as a mapping of lists that JSON can write: the rotation (3, 3) and
    translation (3,) [m] of the camera's pose, the measured camera twist (6,) [m/s, rad/s], the
    joints and their lower and upper limits (n,) [m or rad], None for an infinite one, and the
    Jacobian (6, n).
    """
    return {
        "rotation": posture.T_base_camera.rotation.tolist(),
        "translation": posture.T_base_camera.translation.tolist(),
        "twist": posture.twist.tolist(),
        "joints": posture.joints.tolist(),
        "lower": [_or_none(limit) for limit in posture.lower.tolist()],
        "upper": [_or_none(limit) for limit in posture.upper.tolist()],
        "jacobian": posture.jacobian.tolist(),
    }


def _or_none(limit: float) -> float | None:
    return limit if np.isfinite(limit) else None
