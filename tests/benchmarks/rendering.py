"""What each setting of the renderer costs, and what it looks like:

    uv run --extra dev python tests/benchmarks/rendering.py [FOLDER]

prints medians and the share of pixels that differ from the shipped setting by more than 8 grey
levels, and writes FOLDER/rendering.png, one picture a setting.
"""

import sys
from pathlib import Path
from statistics import median
from time import perf_counter

import cv2
import mujoco
import numpy as np

from servo.loop.episode import Episode
from servo.scenario.load import load
from sim.camera.renderer import OpenGLRenderer
from sim.kinematics.robot import CAMERA

ROUNDS = 40
PLAIN = {}
SETTINGS = {
    "shipped": PLAIN,
    "flat parts in 4 x 4": {"numquads": 4},
    "round parts as MuJoCo has them": {"numslices": 28, "numstacks": 16, "numquads": 4},
    "round parts half as fine": {"numslices": 8, "numstacks": 4},
    "anti-aliased (MSAA 4)": {"offsamples": 4},
    "with a shadow map of 512": {"shadow": True},
}


def picture(world, setting):
    model = world.model
    quality = {k: v for k, v in setting.items() if k != "shadow"}
    before = {k: getattr(model.vis.quality, k) for k in quality}
    model.light("lamp").castshadow = setting.get("shadow", False)
    for key, value in quality.items():
        setattr(model.vis.quality, key, value)
    renderer = OpenGLRenderer(model, CAMERA, world.camera)
    times = []
    for _ in range(ROUNDS):
        began = perf_counter()
        image = renderer.begin(world.data)()
        times.append(perf_counter() - began)
    renderer.close()
    model.light("lamp").castshadow = False
    for key, value in before.items():
        setattr(model.vis.quality, key, value)
    return image, 1e3 * median(times)


def main(folder):
    tiles, shipped = [], None
    with Episode(load("still", ["start.x=0", "start.angle_deg=30"])) as episode:
        mujoco.mj_forward(episode.world.model, episode.world.data)
        for name, setting in SETTINGS.items():
            image, ms = picture(episode.world, setting)
            shipped = image if shipped is None else shipped
            other = np.mean(np.abs(image.astype(int) - shipped).max(axis=2) > 8)
            sys.stdout.write(
                f"{name:32s} {ms:6.2f} ms  {100 * other:5.2f} % of the pixels differ\n"
            )
            tile = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
            label = (f"{name}: {ms:.1f} ms", (4, 12), cv2.FONT_HERSHEY_SIMPLEX, 0.4)
            cv2.putText(tile, *label, (255, 255, 255), 1, cv2.LINE_AA)
            tiles.append(tile)
    tiles += [np.zeros_like(tiles[0])] * (-len(tiles) % 3)
    rows = [np.hstack(tiles[i : i + 3]) for i in range(0, len(tiles), 3)]
    folder.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(folder / "rendering.png"), np.vstack(rows))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "runs"))
