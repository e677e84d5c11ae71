"""A log of the simulated gantry, moved by steps, as a robot of one's own would write it."""

import csv

import numpy as np

from servo.loop.episode import Episode
from servo.scenario.load import load

STILL = ["motion.kind=still", "controller.kind=hold", "tracker.kind=truth", "estimator.kind=none"]
MOVED = 2
"""The slides x and y."""
ROOM = 0.06
"""A slide that is farther from its start is sent back [m]."""


def write_log(path, changes, *, seed=0, seconds=20.0):
    """Write a log of the scenario `line` with a still target; the mean delay of its commands [s].

    Every 0.2 to 0.6 s the slides take new rates, 0.03 to 0.08 m/s, or stand.
    """
    rng = np.random.default_rng(seed)
    rates = np.zeros(6)
    until = 0.5
    delays = []
    with (
        Episode(
            load("line", [*STILL, f"run.duration={seconds}", *changes]), steered=True, seen=False
        ) as episode,
        path.open("w", newline="") as file,
    ):
        robot = episode.world.robot
        joints = [f"{name}_{unit}" for name, unit in zip(robot.names, robot.units, strict=True)]
        head = [f"{kind}_{joint}" for kind in ("joint", "encoder") for joint in joints]
        head += [f"command_{joint}_s" for joint in joints]
        table = csv.writer(file)
        table.writerow(["time_s", "arrived_s", "asked_s", *head])
        tick = episode.world.ticks[1]
        late = 1e-3 * episode.scenario.run.latency_ms
        for _ in range(episode.frames):
            step = episode.look()
            time = step.frame.time
            if time == 0:
                start = step.joints
            if time >= until:
                until = time + rng.uniform(0.2, 0.6)
                way = step.joints - start
                rates = rng.choice([-1, 1], 6) * rng.uniform(0.03, 0.08, 6)
                rates = np.where(np.abs(way) > ROOM, -np.sign(way) * np.abs(rates), rates)
                rates *= (np.arange(6) < MOVED) * (rng.random() > 0.25)
                asked = time + step.age
                delays.append(np.ceil((asked + late) / tick - 1e-6) * tick - asked)
            encoders = episode.world.believed(step.posture).joints
            asked = time + step.age
            table.writerow([time, asked, asked, *step.joints, *encoders, *rates])
            episode.move(step, step.posture.jacobian @ rates)
    return float(np.mean(delays))
