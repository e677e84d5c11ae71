"""Server that runs any policy (a control law that computes the camera twist from pictures), such as
a class of your own in a process of its own: `python -m servo.policy_server module:Class`. It speaks
the protocol of `servo.controllers.program`.
"""

import json
import sys
from collections.abc import Iterator, Mapping
from contextlib import redirect_stdout
from typing import Any, BinaryIO

import numpy as np

from servo.controllers import KINDS
from servo.controllers._plain_law import PolicyLaw
from servo.types import CameraImage
from sim.camera.distortion import Distortion
from sim.installed import Trusted
from sim.kinds import checked
from sim.types import Camera, Pose, Posture
from tracking.exported.command_line import serve
from tracking.exported.program_server import picture_in


def run_policy(
    kind: str,
    preset: str | None = None,
    *,
    requests: BinaryIO | None = None,
    answers: BinaryIO | None = None,
    **settings: object,
) -> None:
    """Run a policy (a control law that computes the camera twist from pictures) for a client that
    speaks the protocol of `servo.controllers.program`: lines of JSON, and pictures as raw bytes.
    The policy is loaded before the first answer; the function returns when the client's input ends.

    Args:
        kind: The policy: "module:Class", or a kind of controller that is a policy.
        preset: Name of a set of the policy's settings; None: its default settings.
        requests: Stream of the client's lines and pictures; None: standard input.
        answers: Stream of the answers (lines of JSON); None: standard output. What the policy
            prints goes to standard error.
        **settings: Settings of the policy.

    Raises:
        ValueError: There is no such policy, a setting has a wrong value, or the client sends
            something that the protocol does not have.
        TypeError: The policy has no such setting.
    """
    lines = requests or sys.stdin.buffer
    out = answers or sys.stdout.buffer
    with redirect_stdout(sys.stderr):  # what a policy prints is no answer
        for answer in _conversation(kind, preset, settings, lines):
            out.write(json.dumps(answer).encode() + b"\n")
            out.flush()


def _conversation(
    kind: str, preset: str | None, settings: Mapping[str, object], requests: BinaryIO
) -> Iterator[Mapping[str, object]]:
    """Yield the answer to each line that a client sends.

    Raises:
        ValueError: The controller is no policy, or the client's lines are out of order.
    """
    config = checked(KINDS.config(Trusted(kind), preset, **settings), kind)
    law: PolicyLaw | None = None
    while line := requests.readline():
        asked: Mapping[str, Any] = json.loads(line)
        if "seed" in asked:
            law = _policy(config.build(np.random.default_rng(asked["seed"])), kind)
            yield {}
            continue
        if law is None or not {"goal", "posture"} & asked.keys():
            raise ValueError(
                "the client sent a line out of order: it must send the seed, then the picture at "
                "the goal, then pictures with the posture"
            )
        picture = picture_in(requests, asked)
        if "goal" in asked:
            camera = _camera(asked)
            law.begin(CameraImage(picture, camera), asked["goal"]["depth"])
            yield {}
        else:
            twist = law.twist(picture, _posture(asked["posture"]))
            yield {"twist": np.asarray(twist, float).tolist()}


def _policy(law: object, kind: str) -> PolicyLaw:
    """Return a controller that was built, if it is a policy to which a client can give what it
    needs.

    Raises:
        ValueError: The controller is not a policy, or needs the robot's posture in the room.
    """
    if isinstance(law, PolicyLaw) and law.starts_at_zero:
        return law
    found = "is no policy"
    if isinstance(law, PolicyLaw):
        found = "needs the robot's posture in the room, which a program does not get"
    raise ValueError(
        f"'{kind}' {found}: give a function act(picture, goal_picture, camera, posture), "
        "perhaps with a last argument depth, or a class with such a method"
    )


def _camera(asked: Mapping[str, Any]) -> Camera:
    """Return the camera [px] in the line before the picture at the goal."""
    words = dict(asked["goal"]["camera"])
    lens = words.pop("distortion", None)
    distortion = lens and Distortion(lens["model"], tuple(lens["coefficients"]))
    return Camera(**words, width=asked["width"], height=asked["height"], distortion=distortion)


def _posture(words: Mapping[str, Any]) -> Posture:
    """Return the posture in the line before a picture; null stands for a joint without a
    limit.
    """
    given = {name: np.array(value, float) for name, value in words.items()}
    return Posture(
        Pose(given["rotation"], given["translation"]),
        given["twist"],
        given["joints"],
        np.where(np.isnan(given["lower"]), -np.inf, given["lower"]),
        np.where(np.isnan(given["upper"]), np.inf, given["upper"]),
        given["jacobian"],
    )


if __name__ == "__main__":
    serve("servo.policy_server", run_policy)
