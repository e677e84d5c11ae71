"""The jobs of the claims about the closed loop: a scenario with an estimator, and its draws."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import resources
from math import cos, radians, sin
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from servo.loop.measured_run import measured_run
from servo.papers.groups import Result
from servo.scenario import load as scenarios
from servo.scenario.draws import stream
from servo.scenario.load import Scenario
from sim.types import Array
from tracking.files.json_text import number

ALONG = "yn"
"""The feature along which the car of `reversal` drives back and forth."""
LINE = "line"
REVERSAL = "reversal"
BEFORE = 0.45
"""How far from the middle of the table the car of `line` starts [m]."""
CAR = (0.11, 0.06)
"""Half the length and width of what must be free around the car (2,) [m]."""
EVERY = 0.05
"""Time between two places at which the car must be clear of toys [s]."""


def varied(scenario: str, seed: int) -> tuple[str, ...]:
    """Draws of a run: the start of the camera; heading, speed and place of the car, and how long it
    drives before it reverses, which is also the phase of its reversals. What lets the car drive
    through a toy on the table is drawn again.
    """
    rng = np.random.default_rng([seed, *b"vary"])
    while True:
        changes = _drawn(scenario, rng)
        if is_clear(scenarios.load(scenario, changes, seed)):
            return changes


def is_clear(scenario: Scenario) -> bool:
    """Whether the car drives around all toys of the room."""
    places, radii = _toys()
    motion = scenario.motion.build(stream(scenario.run.seed, "motion"))
    for time in np.arange(0.0, scenario.run.duration, EVERY):
        car = motion.at(float(time)).inverse()
        seen = places @ car.rotation.T + car.translation
        apart = np.linalg.norm(np.maximum(np.abs(seen[:, :2]) - CAR, 0.0), axis=1)
        if (apart < radii).any():
            return False
    return True


@cache
def _toys() -> tuple[Array, Array]:
    """Where the toys are (n, 3), and the radius around each (n,) [m]."""
    with resources.as_file(resources.files("scenes")) as folder:
        room = mujoco.MjSpec.from_file(str(folder / "room.xml"))
    names = [geom.name for geom in room.geoms if geom.classname.name == "toy"]
    model = room.compile()
    toys = [model.geom(name).id for name in names]
    return model.geom_pos[toys], model.geom_rbound[toys]


def _drawn(scenario: str, rng: np.random.Generator) -> tuple[str, ...]:
    x, y, angle = rng.uniform((-30, -20, -20), (30, 20, 20)).tolist()
    heading, speed, length = rng.uniform((-180, 0.07, 0.5), (180, 0.12, 0.8)).tolist()
    drawn = {
        "start.x": x,
        "start.y": y,
        "start.angle_deg": angle,
        "motion.heading_deg": heading,
        "motion.speed": speed,
    }
    if scenario == REVERSAL:
        drawn["motion.length"] = length
    else:
        drawn["motion.x"] = -BEFORE * cos(radians(heading))
        drawn["motion.y"] = -BEFORE * sin(radians(heading))
    return tuple(f"{key}={value:.4f}" for key, value in drawn.items())


@dataclass(frozen=True, slots=True)
class LoopSeries:
    """A job: one scenario in the closed loop with one estimator and one seed."""

    scenario: str
    estimator: str
    seed: int
    changes: tuple[str, ...] = ()
    """As with --set."""
    label: str = ""
    """Distinguishes jobs that differ in `changes` only."""

    @property
    def key(self) -> str:
        parts = [self.scenario, self.label, self.estimator, str(self.seed)]
        return "loop/" + "-".join(filter(None, parts))

    def describe(self) -> dict[str, Any]:
        return {"scenario": self._scenario().table}

    def run(self, folder: Path) -> Result:
        """Measures, and errors and velocities over time."""
        del folder
        steps, report = measured_run(self._scenario())
        along = steps[0].scene.features.names.index(ALONG)
        return {
            "scenario": self.scenario,
            "estimator": self.estimator,
            "seed": self.seed,
            "label": self.label,
            "measures": {name: number(value) for name, value in report.measures.items()},
            "time": [s.frame.time for s in steps],
            "servo_error": [s.servo_error for s in steps],
            "estimated": [float(s.prediction.motion[along]) for s in steps],
            "true": [number(float(s.target_motion_true[along])) for s in steps],
        }

    def _scenario(self) -> Scenario:
        changes = [f"estimator.kind={self.estimator}", *self.changes]
        return scenarios.load(self.scenario, changes, self.seed)
