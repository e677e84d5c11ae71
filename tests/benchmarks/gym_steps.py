"""Steps a second of one environment: uv run --extra gym python tests/benchmarks/gym_steps.py [KIND].

It steps `line` with a command of zero, features observed, and prints steps a second of each of five
episodes; a tracker's kind may be named.
"""

import sys
from time import perf_counter

import numpy as np
from rich.console import Console

from servo.cli.terminal import plain
from servo.gym import ServoEnv

EPISODES = 5
STEPS = 100


def main() -> None:
    """Print the table."""
    overrides = [f"tracker.kind={kind}" for kind in sys.argv[1:]]
    env = ServoEnv("line", overrides)
    still = np.zeros_like(env.action_space.sample())
    for seed in range(EPISODES):
        env.reset(seed=seed)
        began = perf_counter()
        for _ in range(STEPS):
            env.step(still)
        plain(Console(), f"{STEPS / (perf_counter() - began):.0f} steps a second")
    env.close()


if __name__ == "__main__":
    main()
