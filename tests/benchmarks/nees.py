"""Whether trackers are as far off as they state (NEES): `python tests/benchmarks/nees.py [TRACKER ...]`.

Each tracker closes the loop in `SCENARIOS`. For each picture in which it is LOCKED, the squared error
of x, y, angle and ln scale is divided by the variance that it states: 1 on average where what it
states is right, below where it is off by less than it states, above where by more. The square root of
the mean is the factor of the standard deviation. A tracker that states nothing has nan.
"""

import sys

import numpy as np

from servo.loop.episode import Episode
from servo.mistake import Mistake
from servo.scenario.load import load
from tracking.trackers import KINDS

SCENARIOS = ("line", "circle", "noise", "box_line", "plate_circle", "mesh_circle")
SECONDS = 3.0
NEEDS_MORE = ("opencv", "trax")
"""Trackers that need a file or a program."""


def squares(step):
    """Return squared errors over stated variances (4,); nan where nothing is stated or followed."""
    found = step.estimate.state.vector - step.true_state_estimated.vector
    found[2] = np.angle(np.exp(1j * found[2]))
    with np.errstate(divide="ignore", invalid="ignore"):
        return found**2 / np.diagonal(step.estimate.covariance)


def nees(tracker, name):
    """Return the mean NEES (4,) of a tracker in a scenario, and the number of LOCKED pictures."""
    settings = [f"tracker.kind={tracker}", f"run.duration={SECONDS}"]
    with Episode(load(name, settings)) as episode:
        steps = [s for s in episode if s.seen and s.decided and s.picture > 0]
    rows = np.array([squares(step) for step in steps]).reshape(-1, 4)
    return rows.mean(axis=0) if len(rows) else np.full(4, np.nan), len(rows)


def main(*trackers):
    sys.stdout.write(
        f"{'tracker':14}{'scenario':14}{'x':>8}{'y':>8}{'angle':>8}{'size':>8}  LOCKED\n"
    )
    for tracker in trackers or [k for k in KINDS.names() if k not in NEEDS_MORE]:
        for name in SCENARIOS:
            try:
                found, count = nees(tracker, name)
            except Mistake as error:
                sys.stdout.write(f"{tracker:14}{name:14}{error}\n")
                continue
            cells = "".join(f"{value:8.2g}" for value in found)
            sys.stdout.write(f"{tracker:14}{name:14}{cells}  {count}\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main(*sys.argv[1:])
