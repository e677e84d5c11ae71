"""Print the SHA-256 of the first and the last picture of scenarios with the exact renderer: python
tests/tools/pictures.py [SCENARIO ...]; all shipped ones by default. On two machines, such as one
with and one without OpenGL (MUJOCO_GL=off), the lines should be the same.
"""

import hashlib
import sys

from servo.loop.episode import Episode
from servo.scenario.catalogue import shipped
from servo.scenario.load import load
from sim.types import Image

EXACT = ("camera.renderer=exact", "camera.textures=fine")
"""The settings of `--exact`."""


def main() -> None:
    """Print a line for each scenario."""
    for name in sys.argv[1:] or shipped():
        first, last = pictures_of(name)
        sys.stdout.write(f"{name} {_digest(first)} {_digest(last)}\n")
        sys.stdout.flush()


def pictures_of(name: str) -> tuple[Image, Image]:
    """Return the first and the last picture (H, W, 3) of a scenario's run."""
    with Episode(load(name, EXACT)) as episode:
        pictures = [
            step.frame.image for step in episode if step.frame.index in (0, episode.frames - 1)
        ]
    return pictures[0], pictures[-1]


def _digest(image: Image) -> str:
    return hashlib.sha256(image.tobytes()).hexdigest()


if __name__ == "__main__":
    main()
