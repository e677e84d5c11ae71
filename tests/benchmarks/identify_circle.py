"""Simulate a robot with drawn errors, identify it from its log, and simulate what was identified.

    python tests/benchmarks/identify_circle.py 30

prints how often each interval covers the true value, and the gain from which the loop swings, of the
robot and of the one that was identified.
"""

import sys
import tempfile
import tomllib
from pathlib import Path

import numpy as np
from measured import measured_run

from servo.cli.identify_command import estimated
from servo.identify.log import read
from servo.scenario.load import load

sys.path.append(str(Path(__file__).parents[1] / "tools"))
from robot_log import STILL, write_log

SECONDS = 40.0
SWINGS = 2.0
"""A loop swings whose error in its second half is more than this [px]."""


def drawn(rng):
    """Draw the errors of a robot: delay, lag, jitter [ms], play, noise [m]."""
    low, high = np.array([(10, 80), (10, 100), (5, 30), (0.5e-3, 8e-3), (0.05e-3, 0.4e-3)]).T
    values = rng.uniform(low, high).tolist()
    return dict(zip(("delay", "lag", "jitter", "play", "noise"), values, strict=True))


def settings(true):
    """The changes of a scenario."""
    noise = [true["noise"]] * 3 + [0.0] * 3
    play = [true["play"]] * 3 + [0.0] * 3
    return [
        f"run.latency_ms={true['delay']}",
        f"run.jitter_ms={true['jitter']}",
        f"robot.lag_ms={true['lag']}",
        f"robot.backlash={play}",
        f"robot.encoder_noise={noise}",
    ]


def covered(true, found, delay):
    """Name and, for each interval, whether it covers."""
    pairs = [("delay", found.delay, delay), ("lag", found.lag, true["lag"] / 1e3)]
    pairs += [("jitter", found.jitter, true["jitter"] / 1e3)]
    pairs += [(f"play {joint}", each, true["play"]) for joint, each in found.play.items()]
    pairs += [(f"noise {joint}", each, true["noise"]) for joint, each in found.noise.items()]
    return {name: bool(each.low <= value <= each.high) for name, each, value in pairs}


def gain_that_swings(changes):
    """The gain from which the loop swings on a still target [1/s], to 3 %."""
    low, high = 4.0, 40.0
    while high / low > 1.03:
        middle = np.sqrt(low * high)
        still = [each for each in STILL if "controller" not in each]
        more = [f"controller.gain={middle}", "run.duration=6", "start.x=-30"]
        steps, _ = measured_run(load("line", [*still, *more, *changes]))
        late = [step.servo_error for step in steps[len(steps) // 2 :]]
        low, high = (low, middle) if np.sqrt(np.mean(np.square(late))) > SWINGS else (middle, high)
    return low


def changes_of(text):
    """The lines that `servobench identify` writes, as changes of a scenario."""
    table = tomllib.loads(text)
    return [f"{part}.{key}={value}" for part, keys in table.items() for key, value in keys.items()]


def main(count, first=0, gains=10):
    """Print the coverage of each interval, and both gains of the first robots."""
    hits = []
    ratios = []
    for seed in range(first, first + count):
        with tempfile.TemporaryDirectory() as name:
            path = Path(name) / "log.csv"
            true = drawn(np.random.default_rng([1, seed]))
            delay = write_log(path, settings(true), seed=seed, seconds=SECONDS)
            found, text = estimated(read(path), "line")
        hits.append(covered(true, found, delay))
        missed = [key for key, hit in hits[-1].items() if not hit]
        print(seed, "missed:", *missed, flush=True)  # noqa: T201
        if len(ratios) < gains:
            before, after = map(gain_that_swings, (settings(true), changes_of(text)))
            ratios.append(after / before)
            print(f"  gains {before:.2f} {after:.2f}", flush=True)  # noqa: T201
    for key in hits[0]:
        print(f"{key}: {sum(hit[key] for hit in hits)} of {count}")  # noqa: T201
    print(f"ratios of gains: {min(ratios):.3f} to {max(ratios):.3f}")  # noqa: T201


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
