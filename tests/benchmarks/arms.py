"""From how many drawn bases an arm holds the target: `python tests/benchmarks/arms.py arm7 [BASES] [NAME ...] [SETTING=VALUE ...]`.

A base is drawn behind the table's middle, and turned to it within 60 degrees; it is taken if each of
a few moments of the way can be reached by itself. The shares of time off the target are printed too.
"""

import sys
from math import atan2, degrees

import numpy as np
from measured import measured_run

from servo.loop.episode import Episode
from servo.mistake import Mistake
from servo.scenario.load import load
from sim.kinematics.inverse_kinematics import reach

MOMENTS = 7
HELD = 1.0
"""Off the target for less than this [% of the time]."""


def drawn(rng):
    """Draw a base: x, y, z [m], yaw [deg]."""
    x = rng.uniform(-0.5, 0.5)
    y = rng.uniform(0.25, 0.75)
    z = rng.uniform(0.3, 1.0)
    return [x, y, z, degrees(atan2(-y, -x)) + rng.uniform(-60, 60)]


def can_reach(scenario):
    """Return whether the start and single moments of the way can be reached."""
    try:
        episode = Episode(scenario, seen=False)
    except Mistake:
        return False
    with episode:
        world = episode.world
        T_target_eye = world._stage.target(0.0).inverse() @ world._eye_at
        for time in np.linspace(0, scenario.run.duration, MOMENTS)[1:]:
            if not reach(world.robot, world.data, world._stage.target(time) @ T_target_eye):
                return False
    return True


def main(model, count="10", *words):
    settings = [word for word in words if "=" in word]
    names = [word for word in words if "=" not in word]
    for name in names or ("line", "circle", "wander"):
        rng = np.random.default_rng(11)
        off = []
        while len(off) < int(count):
            robot = ["robot.kind=mjcf", f"robot.model={model}", f"robot.base={drawn(rng)}"]
            scenario = load(name, robot + settings, seed=0)
            if can_reach(scenario):
                off.append(measured_run(scenario)[1].measures["not_held_pct"])
        sys.stdout.write(f"{name}: {sum(np.array(off) < HELD)} of {count} hold, {off}\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
