"""From how many drawn bases an arm holds the target: `python tests/benchmarks/arms.py arm7 [BASES] [NAME ...]`.

A base is drawn up to 0.7 m from the table's middle, and turned to it within 60 degrees; it is taken
if each of a few moments of the way can be reached by itself.
"""

import sys
from math import atan2, degrees

import numpy as np

from servo.loop.episode import Episode, measured_run
from servo.mistake import Mistake
from servo.scenario.load import load
from sim import placement
from sim.kinematics.inverse_kinematics import reach

MOMENTS = 5
HELD = 1.0
"""Off the target for less than this [% of the time]."""


def drawn(rng):
    """Draw a base: x, y, z [m], yaw [deg]."""
    angle, distance = rng.uniform(0, 2 * np.pi), rng.uniform(0.3, 0.7)
    x, y = float(distance * np.cos(angle)), float(distance * np.sin(angle))
    return [x, y, rng.uniform(0.4, 0.9), degrees(atan2(-y, -x)) + rng.uniform(-60, 60)]


def can_reach(scenario):
    """Return whether the start and single moments of the way can be reached."""
    try:
        episode = Episode(scenario, seen=False)
    except Mistake:
        return False
    with episode:
        world, goal = episode.world, episode.goal
        for time in np.linspace(0, scenario.run.duration, MOMENTS):
            target = world._stage.target(time)
            heading = float(np.arctan2(target.rotation[1, 0], target.rotation[0, 0]))
            point = target.apply(world.outline.mean(axis=0))
            above = point, heading, goal.pixel, goal.theta, scenario.goal.depth
            if not reach(world.robot, world.data, placement.camera_above(world.camera, *above)):
                return False
    return True


def main(model, count="10", *names):
    for name in names or ("line", "circle", "wander"):
        rng = np.random.default_rng(0)
        off = []
        while len(off) < int(count):
            robot = ["robot.kind=mjcf", f"robot.model={model}", f"robot.base={drawn(rng)}"]
            scenario = load(name, robot)
            if can_reach(scenario):
                off.append(measured_run(scenario)[1].measures["not_held_pct"])
        sys.stdout.write(f"{name}: {sum(np.array(off) < HELD)} of {count} hold\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
