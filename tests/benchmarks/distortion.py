"""What a lens's distortion costs a frame at 320x240: `python tests/benchmarks/distortion.py`.

The cameras take turns, frame by frame, in worlds that are open at the same time; medians [ms].
"""

import sys
from contextlib import ExitStack
from statistics import median
from time import perf_counter

from servo.loop.episode import Episode
from servo.scenario.load import load

FRAMES = 300
CAMERAS = {
    "no distortion": [],
    "plumb_bob": ["camera.distortion=plumb_bob", "camera.coefficients=[-0.3,0.1,0.002,-0.003,0.0]"],
    "rational": [
        "camera.distortion=rational",
        "camera.coefficients=[0.5,0.2,0.001,-0.002,0.02,0.8,0.3,0.05]",
    ],
    "no distortion, 60 deg": ["camera.fovy_deg=60"],
    "fisheye of 60 deg": [
        "camera.fovy_deg=60",
        "camera.distortion=fisheye",
        "camera.coefficients=[-0.02,0.005,-0.003,0.0005]",
    ],
    "fisheye of 90 deg": [
        "camera.fovy_deg=90",
        "camera.distortion=fisheye",
        "camera.coefficients=[0.0,0.0,0.0,0.0]",
    ],
}


def main():
    with ExitStack() as opened:
        running = {}
        for name, changes in CAMERAS.items():
            episode = opened.enter_context(Episode(load("line", ["run.duration=60", *changes])))
            running[name] = episode, iter(episode)
        looks, steps = ({name: [] for name in running} for _ in range(2))
        for _ in range(FRAMES):
            for name, (_, episode) in running.items():
                began = perf_counter()
                step = next(episode)
                steps[name].append(perf_counter() - began)
                looks[name].append(step.seconds.render)
        for name in running:
            look, step = (1e3 * median(times[name][5:]) for times in (looks, steps))
            view = running[name][0].world._lens.view
            sys.stdout.write(f"{name:22s} rendered {view.width}x{view.height}  look {look:.2f}  ")
            sys.stdout.write(f"step {step:.2f}\n")


if __name__ == "__main__":
    main()
