"""The runs that test claims: trackers on painted sequences, and scenarios in the closed loop."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from importlib import resources
from math import cos, radians, sin
from pathlib import Path

import mujoco
import numpy as np

from servo.loop.episode import run
from servo.scenario import load as scenarios
from servo.scenario.draws import stream
from servo.scenario.load import Scenario
from servo.scenario.toml import Table
from servo.study.run import Job, Record
from servo.study.scenario_run import record_of
from servo.study.sequence_run import (
    TRACKER,
    TRACKS,
    Contender,
    Entry,
    Generated,
    TrackedSequence,
)
from sim.types import Array
from tracking.evaluation.track_file import read
from tracking.sequences.painted import KINDS as GENERATORS
from tracking.sequences.sequence import Sequence as Painting
from tracking.sequences.sources import PaintedSource
from tracking.trackers import KINDS as TRACKERS


def contender(
    kind: str, preset: str | None = None, label: str | None = None, **settings: float | str
) -> Contender:
    """Return a tracker's settings, with the label under which tables show it; no tracker is built.

    Args:
        kind: Kind of the tracker.
        preset: Name of a preset that gives the settings that are not in `settings`; None: the
            defaults.
        label: Label of the tracker; None: KIND, or KIND-PRESET with a preset.
        **settings: Changed settings.
    """
    config = TRACKERS.config(kind, preset, **settings)
    return Contender(label or (kind if preset is None else f"{kind}-{preset}"), config)


@dataclass(frozen=True, slots=True)
class CachedPainting(Generated):
    """A kind of painted (synthetic) sequence with its settings, cut to its first `pictures`
    pictures (None: not cut). The pictures of the sequence that `build` returned last are kept in
    memory, because painting takes longer than tracking.
    """

    pictures: int | None = None
    """Number of first pictures to which the sequence is cut; None: all."""

    def describe(self) -> Table:
        """Return kind and settings of the painted sequence by the keys "kind" and "settings", and,
        if it is cut, its number of pictures by "pictures".
        """
        few = {} if self.pictures is None else {"pictures": self.pictures}
        return Generated.describe(self) | few

    def build(self, seed: int) -> Painting:
        """Return the painted sequence of a seed. Calls with the same seed, one after the other,
        return the same sequence, whose pictures are painted only once.
        """
        return _painted(self.kind, self.config, seed, self.pictures)


@lru_cache(maxsize=1)
def _painted(kind: str, config: object, seed: int, pictures: int | None) -> Painting:
    """Return the first `pictures` pictures of a painted sequence (None: all), which are cached
    until another sequence is painted.
    """
    sequence = Generated(kind, config).build(seed)
    source, states = sequence.source, sequence.states
    assert isinstance(source, PaintedSource)
    assert states is not None
    return replace(
        sequence,
        source=PaintedSource(cache(source.paint), len(states[:pictures])),
        truth=sequence.truth[:pictures],
        states=states[:pictures],
    )


def generated(kind: str, **settings: float | str) -> Generated:
    """Return a kind of painted (synthetic) sequence of pictures, with some settings changed from
    its defaults. Its `build(seed)` returns another sequence for each seed, and keeps the pictures
    of the last one in memory.
    """
    return CachedPainting(kind, GENERATORS.config(kind, **settings))


def sequence_jobs(
    trackers: Sequence[Contender],
    entries: Sequence[Entry],
    seeds: Iterable[int],
    pictures: int | None = None,
) -> list[Job]:
    """Return a job for each sequence of pictures, seed and tracker; all trackers of one sequence
    and seed are consecutive.

    Args:
        trackers: Trackers with their settings.
        entries: Kinds of painted (synthetic) sequences, or recorded sequences.
        seeds: Seeds of the trackers and of the painted sequences.
        pictures: Number of first pictures to which sequences of `generated` are cut; None: all.
    """
    cut = [replace(e, pictures=pictures) if isinstance(e, CachedPainting) else e for e in entries]
    return [
        Job(
            0,
            TrackedSequence(tracker, entry),
            seed,
            {TRACKER: tracker.label},
            name=f"{tracker.label}/{entry.name}-{seed}",
        )
        for entry in cut
        for seed in seeds
        for tracker in trackers
    ]


def states_found(folder: Path, run: Record) -> Array:
    """Return the states (frames, 4) of the target that a tracker estimated in a run: x, y [px],
    theta [rad], scale (1: as in the first picture).

    Args:
        folder: Folder of the study, which has a file of estimates for each run.
        run: Record of the run.
    """
    track = f"{run.settings[TRACKER]}/{run.settings['family']}-{run.seed}.csv"
    return read(folder / TRACKS / track).states


ALONG = "yn"
"""The feature along which the car of `reversal` drives back and forth."""
TIME = "time_s"
ERROR = "servo_error_px"
ESTIMATED = "motion_estimated"
TRUE = "motion_true"
LINE = "line"
REVERSAL = "reversal"
START_DISTANCE = 0.45
"""Distance from the middle of the table at which the car of `line` starts [m]."""
CAR = (0.11, 0.06)
"""Half length and half width of the car's clearance rectangle (2,) [m]."""
INTERVAL = 0.05
"""Interval at which the car is tested for contact with toys [s]."""
AROUND = (
    "start.x = { uniform = [-8.0, 8.0] }, start.y = { uniform = [-8.0, 8.0] }, "
    "start.angle_deg = { uniform = [-5.0, 5.0] }"
)
REGISTERED = {
    LINE: f"{AROUND}, motion.y = {{ uniform = [-0.03, 0.0] }}, "
    "motion.heading_deg = { uniform = [-3.0, 0.5] }, motion.speed = { uniform = [0.08, 0.1] }",
    REVERSAL: f"{AROUND}, motion.x = {{ uniform = [-0.06, 0.06] }}, "
    "motion.length = { uniform = [0.4, 0.55] }",
    "reversal_5hz": f"{AROUND}, motion.x = {{ uniform = [-0.06, 0.06] }}, "
    "motion.length = { uniform = [0.6, 0.7] }",
    "sine": f"{AROUND}, motion.y = {{ uniform = [-0.06, 0.06] }}, "
    "motion.heading_deg = { uniform = [-15.0, 15.0] }, "
    "motion.frequency = { uniform = [0.17, 0.21] }",
    "circle": f"{AROUND}, motion.frequency = {{ uniform = [0.12, 0.16] }}",
}
"""The tables [vary] of the scenarios when the rules were fixed; the scenarios' files may change."""


@cache  # several claims are tested on the same draws
def varied(scenario: str, seed: int) -> tuple[str, ...]:
    """Return random settings of a run as changes, such as "start.x=4.2000"; the same scenario and
    seed give the same ones.

    They are the camera's start, the car's heading and speed, and the distance between reversals in
    the scenario `reversal`, or the car's start in others. If the car would touch a toy on the
    table, all are drawn again.
    """
    rng = np.random.default_rng([seed, *b"vary"])
    while True:
        changes = _drawn(scenario, rng)
        if is_clear(scenarios.load(scenario, (registered(scenario), *changes), seed)):
            return changes


def registered(scenario: str) -> str:
    """Return the change of settings, as for the option --set, that gives a scenario the random
    distributions (its table [vary]) that it had when the rules of the claims were fixed.
    """
    return f"vary={{ {REGISTERED[scenario]} }}"


def is_clear(scenario: Scenario) -> bool:
    """Return True if the car of a scenario passes all toys on the table without contact during the
    run, by its clearance rectangle every 0.05 s.
    """
    places, radii = _toys()
    motion = scenario.motion.build(stream(scenario.run.seed, "motion"))
    for time in np.arange(0.0, scenario.run.duration, INTERVAL):
        car = motion.at(float(time)).inverse()
        seen = places @ car.rotation.T + car.translation
        apart = np.linalg.norm(np.maximum(np.abs(seen[:, :2]) - CAR, 0.0), axis=1)
        if (apart < radii).any():
            return False
    return True


@cache
def _toys() -> tuple[Array, Array]:
    """Return positions (n, 3) in the room's frame and bounding radii (n,) of the toys [m]."""
    with resources.as_file(resources.files("scenes")) as folder:
        room = mujoco.MjSpec.from_file(str(folder / "room.xml"))
    names = [geom.name for geom in room.geoms if geom.classname.name == "toy"]
    model = room.compile()
    toys = [model.geom(name).id for name in names]
    return model.geom_pos[toys], model.geom_rbound[toys]


def _drawn(scenario: str, rng: np.random.Generator) -> tuple[str, ...]:
    """Draw settings of a run as `varied` does, without looking at the toys."""
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
        drawn["motion.x"] = -START_DISTANCE * cos(radians(heading))
        drawn["motion.y"] = -START_DISTANCE * sin(radians(heading))
    return tuple(f"{key}={value:.4f}" for key, value in drawn.items())


@dataclass(frozen=True, slots=True)
class EstimatedLoop:
    """A scenario, with changes as for --set, whose runs in the closed loop record the servo error
    [px] and the target's estimated and true velocity [m/s] over time.
    """

    name: str
    """Name of the scenario."""
    changes: tuple[str, ...]
    """Changes of the scenario, as with --set."""

    def describe(self) -> dict[str, object]:
        """Return the name of the scenario and its changes, by the keys "scenario" and "changes"."""
        return {"scenario": self.name, "changes": list(self.changes)}

    def perform(self, job: Job, folder: Path) -> Record:
        """Run the scenario with the job's seed, and return its record. No file is written into
        `folder`.

        The series of the record are "time_s" [s], "servo_error_px" [px], and "motion_estimated" and
        "motion_true": the rate [m/s] of the feature yn that the target's own motion causes,
        estimated and true.
        """
        scenario = scenarios.load(self.name, self.changes, job.seed)
        steps = [step.light() for step in run(scenario)]
        along = steps[0].scene.features.names.index(ALONG)
        series = {
            TIME: np.array([s.frame.time for s in steps]),
            ERROR: np.array([s.servo_error for s in steps]),
            ESTIMATED: np.array([s.prediction.motion[along] for s in steps]),
            TRUE: np.array([s.target_motion_true[along] for s in steps]),
        }
        return replace(record_of(job, scenario, steps), series=series)


def loop_job(
    scenario: str, estimator: str, seed: int, changes: Sequence[str], **settings: str
) -> Job:
    """Return the run of a scenario in the closed loop with an estimator of the target's motion, as
    a job. The random distributions of the scenario are those at the time when the claims' rules
    were fixed (`registered`).

    Args:
        scenario: Name of the scenario.
        estimator: Kind of the estimator.
        seed: Seed of the run.
        changes: Changes of settings, such as "camera.rate=5.0".
        **settings: Labels that distinguish this run from others of the same scenario and estimator,
            such as rate="5Hz"; the record has them too.
    """
    name = "-".join([*settings.values(), scenario, estimator, str(seed)]).replace(" ", "")
    changes = (registered(scenario), f"estimator.kind={estimator}", *changes)
    return Job(
        0,
        EstimatedLoop(scenario, changes),
        seed,
        {"estimator": estimator, **settings},
        name=f"loop/{name}",
    )
