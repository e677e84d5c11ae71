"""What a tick of a seven-joint arm pays at a joint's limit: `python tests/benchmarks/inverse.py`.

The way from a camera twist to joint rates, away from every limit and with one joint at its limit, where a quadratic
programme decides; and the programme alone, which is what such a tick pays more. Ways take turns; medians [ms].
"""

import sys
from statistics import median
from time import perf_counter

import numpy as np

from servo.loop.episode import Episode
from servo.scenario.load import load

TIMES = 3000
ROOM = 0.002
"""How far the joint is from where it has to stop [rad]."""


def timed(call, *given) -> float:
    began = perf_counter()
    call(*given)
    return 1e3 * (perf_counter() - began)


def main():
    with Episode(load("arm7_line", [])) as episode:
        next(iter(episode))
        robot, data = episode.world.robot, episode.world.data
        free = robot.joints(data)
        at_limit = free.copy()
        joint = int(np.argmin(robot.upper - free))
        at_limit[joint] = robot._bounds[1][joint] - ROOM
        rng = np.random.default_rng(0)
        found = {"away from limits": [], "at a limit": [], "the programme alone": []}
        for _ in range(TIMES):
            twist = rng.normal(size=6) * [0.1, 0.1, 0.1, 0.2, 0.2, 0.2]
            for name, q in (("away from limits", free), ("at a limit", at_limit)):
                data.qpos[robot.qpos] = q
                robot.refresh(data)
                found[name].append(timed(robot.rates, data, twist))
            J = robot.jacobian(data)
            liked = np.linalg.pinv(J) @ twist
            found["the programme alone"].append(timed(robot._within_limits, data, J, twist, liked))
    for name, times in found.items():
        sys.stdout.write(f"{name:20s} {median(times):.3f}, 95 %: {np.percentile(times, 95):.3f}\n")


if __name__ == "__main__":
    main()
