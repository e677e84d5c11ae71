"""Fingerprints of runs, to see what a change of the code does to their numbers.

    python tests/tools/fingerprints.py write before.json      # at the old commit
    python tests/tools/fingerprints.py write after.json       # at the new one
    python tests/tools/fingerprints.py compare before.json after.json

A fingerprint is a checksum of each column of steps.parquet (without wall-clock times), of each
measure, and of the twists and rewards of the environments of `servo.gym`. Names of scenarios after
the file limit what is run.
"""

import argparse
import json
import sys
import zlib
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import gymnasium
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))  # this checkout, not one that is installed

import servo
import servo.gym
from servo.loop.measure import TIMED as TIMED_MEASURE
from servo.loop.run_measures import summarise
from servo.output.steps_table import TIMED, quantities_of, table_of
from servo.scenario.catalogue import shipped

PICTURES = 60
SEEDS = 0, 3
RENDERERS = "opengl", "exact"
ENVIRONMENTS = "line", "turn_90_points", "tag_still", "arm7_line"


def checksum(values: object) -> int:
    """Return a checksum of values; each float counts with all its digits."""
    return zlib.crc32(repr(values).encode())


def of_run(name: str, seed: int, renderer: str) -> dict[str, int]:
    """Return the fingerprint of a scenario's first pictures."""
    scenario = servo.load(name, [f"camera.renderer={renderer}", "measure.after=0"], seed=seed)
    with servo.Episode(scenario) as episode:
        steps = list(islice(episode, PICTURES))
        table = table_of(steps, quantities_of(episode))
    found = {
        column: checksum(table[column].to_pylist())
        for column in table.column_names
        if not column.startswith(TIMED)
    }
    found["corner_errors"] = checksum([step.corner_errors.tolist() for step in steps])
    measures = summarise(steps, scenario.measure, 1 / scenario.camera.rate).measures
    measures.pop(TIMED_MEASURE)
    return found | {f"measure {each}": checksum(value) for each, value in measures.items()}


def of_environment(name: str, action: str) -> dict[str, int]:
    """Return the fingerprint of an environment whose actions are of a kind."""
    env = gymnasium.make(
        servo.gym.ID, scenario=name, overrides=["run.latency=3"], action=action, redraw=9
    )
    first, info = env.reset(seed=1)
    rng = np.random.default_rng(0)
    seen = [np.asarray(first).tolist()]
    rewards = [info["distance_px"]]
    for _ in range(20):
        moves = 0.1 * rng.uniform(-1, 1, env.action_space.shape or ())
        observation, reward, _, _, info = env.step(moves)
        seen.append(np.asarray(observation).tolist())
        rewards.append((reward, info["distance_px"], info["twist"].tolist()))
    env.close()
    return {"observations": checksum(seen), "rewards": checksum(rewards)}


def fingerprints(names: list[str]) -> Iterator[tuple[str, dict[str, int]]]:
    """Yield the name of each run and its fingerprint."""
    for name in names or sorted(shipped()):
        for renderer in RENDERERS:
            for seed in SEEDS:
                yield f"{name} {renderer} seed {seed}", of_run(name, seed, renderer)
    for name in ENVIRONMENTS if not names else ():
        for action in servo.gym.ACTIONS:
            yield f"gym {name} {action}", of_environment(name, action)


def write(path: Path, names: list[str]) -> None:
    """Write the fingerprints of all runs to a file."""
    found = dict[str, dict[str, int] | str]()
    for name, fingerprint in fingerprints(names):
        found[name] = fingerprint
        sys.stderr.write(f"{name}\n")
    path.write_text(json.dumps(found, indent=1) + "\n")


def compare(before: Path, after: Path) -> int:
    """Print what differs between two files; return the number of runs that do."""
    first, second = (json.loads(path.read_text()) for path in (before, after))
    different = 0
    for name in [each for each in first if each in second]:
        old = first[name]
        new = second[name]
        changed = [each for each in old if each in new and old[each] != new[each]]
        gone = [each for each in old if each not in new]
        different += bool(changed)
        if changed or gone:
            sys.stdout.write(f"{name}: {', '.join(changed)}; gone: {', '.join(gone)}\n")
    missing = [each for each in first if each not in second]
    sys.stdout.write(f"{different} of {len(first)} runs differ; missing: {missing}\n")
    return different


def main() -> int:
    """Do what the command line says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("action", choices=["write", "compare"])
    parser.add_argument("path", type=Path)
    parser.add_argument("others", nargs="*")
    given = parser.parse_args()
    if given.action == "compare":
        return int(compare(given.path, Path(given.others[0])) > 0)
    write(given.path, given.others)
    return 0


if __name__ == "__main__":
    sys.exit(main())
