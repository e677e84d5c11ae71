"""What a tick of a seven-joint arm costs: `python tests/benchmarks/inverse.py`.

The way from a camera twist to joint rates, without and with the manipulability, and with accelerations, where a
quadratic programme decides. Ways take turns; medians [ms].
"""

import sys
from dataclasses import replace
from statistics import median
from time import perf_counter

import mujoco
import numpy as np

from sim.camera.camera import CameraConfig
from sim.kinematics.robot import Robot
from sim.models.assembly import build_model
from sim.robots import mjcf
from sim.targets import car

TIMES = 3000
TICK = 1 / 120
BENT = [0.3, 0.6, 0.4, 1.2, 0.5, 0.8, 0.2]


def main():
    rng = np.random.default_rng(0)
    whole = mjcf.Config().build(rng)
    plain = replace(whole, inversion=replace(whole.inversion, manipulability=0.0))
    slow = mjcf.Config(acceleration=3.0)
    designs = {
        "towards the middle": plain,
        "with manipulability": whole,
        "with accelerations": replace(plain, drives=slow),
        "with both": replace(whole, drives=slow),
    }
    model = build_model(480.0, CameraConfig(), whole, car.Config().build(rng))
    data = mujoco.MjData(model)
    robots = {name: Robot(model, design) for name, design in designs.items()}
    data.qpos[robots["with both"].qpos] = BENT
    robots["with both"].refresh(data)
    found = {name: [] for name in robots}
    for _ in range(TIMES):
        twist = rng.normal(size=6) * [0.1, 0.1, 0.1, 0.2, 0.2, 0.2]
        for name, robot in robots.items():
            began = perf_counter()
            robot.rates(data, twist, TICK, np.zeros(len(BENT)))
            found[name].append(1e3 * (perf_counter() - began))
    for name, times in found.items():
        sys.stdout.write(f"{name:20s} {median(times):.3f}, 95 %: {np.percentile(times, 95):.3f}\n")


if __name__ == "__main__":
    main()
