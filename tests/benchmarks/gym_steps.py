"""Steps a second of environments: uv run --extra gym python tests/benchmarks/gym_steps.py [KIND].

It steps `line` with a command of zero, features observed, and prints steps a second of each of five
episodes; a tracker's kind may be named. With `--envs N` it steps a vector environment of N, and
prints the steps of all of them together.
"""

import argparse
from time import perf_counter, process_time

import gymnasium
import numpy as np
from rich.console import Console

from servo.cli.terminal import plain
from servo.gym import environment_id

EPISODES = 5
STEPS = 100


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kind", nargs="?", default="pf_ssd", help="kind of the tracker")
    parser.add_argument("--envs", type=int, help="number of environments of a vector environment")
    given = parser.parse_args()
    name = environment_id("line")
    overrides = [f"tracker.kind={given.kind}"]
    if given.envs is None:
        env = gymnasium.make(name, overrides=overrides).unwrapped
    else:
        env = gymnasium.make_vec(
            name, given.envs, vectorization_mode="vector_entry_point", overrides=overrides
        )
    still = np.zeros_like(env.action_space.sample())
    steps = STEPS * (given.envs or 1)
    for seed in range(EPISODES):
        env.reset(seed=seed)
        began = perf_counter()
        cpu = process_time()
        for _ in range(STEPS):
            env.step(still)
        wall = steps / (perf_counter() - began)
        busy = steps / (process_time() - cpu)
        plain(Console(), f"{wall:.0f} steps a second, {busy:.0f} a second of CPU")
    env.close()


if __name__ == "__main__":
    main()
