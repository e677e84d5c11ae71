"""Films the table with a standing wide camera: a recording in which a camera may turn.

`python tests/tools/filmed.py FILE.mp4` writes the recording that is shipped, with its truth.
"""

import sys
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np

from servo.loop.episode import Episode
from servo.scenario.load import load

STANDS = ("robot.kind=head", "controller.kind=hold", "tracker.kind=truth", "goal.depth=2.0")
"""A camera that looks straight down from 2 m."""


def wide(size, focal, seconds, *changes):
    """The scenario of the standing camera; its pictures have `size` columns, three quarters as many rows."""
    views = (f"camera.width={size}", f"camera.height={size * 3 // 4}", f"camera.fx={focal}")
    start = ("start.x=0", "start.y=0")
    return load("line", [*STANDS, *views, *start, f"run.duration={seconds}", *changes])


def film(scenario):
    """The pictures and the true corners of a camera that looks straight down."""
    with Episode(scenario) as episode:
        episode.world.data.qpos[:] = 0
        episode.world.data.qvel[:] = 0
        episode.world._eye_at = episode.world._set_stage(0.0)
        episode._moment = None
        return zip(*[(step.frame.image, step.truth.corners) for step in episode], strict=True)


def as_folder(folder, scenario):
    """Write a film as PNG files with a truth of corners."""
    pictures, corners = film(scenario)
    for number, picture in enumerate(pictures):
        cv2.imwrite(str(folder / f"{number:05}.png"), picture[..., ::-1])
    np.savetxt(folder / "groundtruth.txt", np.reshape(corners, (-1, 8)), "%.4f", ",")


def as_video(path, scenario):
    """Write a film as a video with a truth of corners beside it."""
    pictures, corners = film(scenario)
    with av.open(str(path), "w") as container:
        rate = Fraction(scenario.camera.rate)
        stream = container.add_stream("libx264", rate, {"crf": "24", "preset": "veryslow"})
        stream.width, stream.height = scenario.camera.width, scenario.camera.height
        stream.pix_fmt = "yuv420p"
        for picture in pictures:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture)))
        container.mux(stream.encode())
    np.savetxt(path.with_suffix(".txt"), np.reshape(corners, (-1, 8)), "%.2f", ",")


if __name__ == "__main__":
    shipped = wide(
        640,
        554.0,
        12,
        "motion.kind=wander",
        "motion.radius=0.26",
        "clutter.number=8",
        "camera.noise=2",
    )
    as_video(Path(sys.argv[1]), shipped)
