"""OpenCV's contributed trackers on the frames of our benchmarks, in an environment of their own.

    uv run --extra dev python tests/benchmarks/peers.py film.npz
    uv run --no-project --with opencv-contrib-python-headless --with numpy \
        python tests/benchmarks/peers.py film.npz

The first command, in our environment, films; the second one, in which OpenCV has its contributed
modules, times KCF, CSRT and MIL on the film, one thread each.
"""

import sys
from pathlib import Path
from statistics import median
from time import perf_counter

import cv2
import numpy as np

WARM = 5


def shoot(path):
    import speed

    film = speed.film(60.0)
    x, y = np.array([film.state.x, film.state.y]) - [film.region.width / 2, film.region.height / 2]
    box = np.round([x, y, film.region.width, film.region.height]).astype(int)
    np.savez_compressed(path, frames=np.stack([f.image for f in film.frames]), box=box)


def time_peers(path):
    film = np.load(path)
    frames = [np.ascontiguousarray(f[..., ::-1]) for f in film["frames"]]
    cv2.setNumThreads(1)
    for name in ("KCF", "CSRT", "MIL"):
        tracker = getattr(cv2, f"Tracker{name}_create")()
        tracker.init(frames[0], tuple(int(v) for v in film["box"]))
        times = []
        for frame in frames[1:]:
            began = perf_counter()
            tracker.update(frame)
            times.append(perf_counter() - began)
        sys.stdout.write(f"{name:5s} {1e3 * median(times[WARM:]):6.2f} ms\n")


if __name__ == "__main__":
    file = Path(sys.argv[1])
    if file.exists():
        time_peers(file)
    else:
        shoot(file)
