"""What the weight of the manipulability does on the way of a seven-joint arm.

    python tests/benchmarks/manipulability.py [BASES]

prints for each weight the smallest singular value of the Jacobian on the way, its manipulability on
average and the least room to a limit, medians over bases, and how many of the runs hold the target.
"""

import sys
from dataclasses import replace

import numpy as np
from arms import HELD, can_reach, drawn

from servo.loop.episode import Episode
from servo.loop.run_measures import summarise
from servo.scenario.load import load

WEIGHTS = (0.0, 0.3, 1.0, 3.0, 10.0)
SEED = 300


def arm_on(base, name):
    robot = ["robot.kind=mjcf", "robot.model=arm7", f"robot.base={base}"]
    return load(name, [*robot, "tracker.kind=truth"], seed=0)


def measured(scenario, weight):
    """Return the smallest singular value, the mean manipulability, the room, and whether it holds."""
    steps, weakest, volume = [], [], []
    with Episode(scenario, seen=False) as episode:
        robot = episode.world.robot
        robot._inversion = replace(robot._inversion, manipulability=weight)
        for step in episode:
            J = robot.jacobian(episode.world.data)
            values = np.linalg.svd(J, compute_uv=False)
            weakest.append(values.min())
            volume.append(values.prod())
            steps.append(step)
    found = summarise(steps, scenario.measure, 1 / scenario.camera.rate)
    room = min(step.margins.min() for step in steps)
    return min(weakest), np.mean(volume), room, found.measures["not_held_pct"] < HELD


def main(count="10"):
    for name in ("circle", "wander"):
        rng, bases = np.random.default_rng(SEED), []
        while len(bases) < int(count):
            base = drawn(rng)
            if can_reach(arm_on(base, name)):
                bases.append(base)
        for weight in WEIGHTS:
            rows = np.array([measured(arm_on(base, name), weight) for base in bases])
            weakest, volume, room = np.median(rows[:, :3], axis=0)
            sys.stdout.write(
                f"{name}, {weight:g}: {weakest:.4f}, {volume:.4f}, {room:.3f}, "
                f"{rows[:, 3].sum():.0f} of {count} hold\n"
            )
            sys.stdout.flush()


if __name__ == "__main__":
    main(*sys.argv[1:])
