"""The score of a run in one world (random scenario) of a benchmark."""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from servo.bench.benchmark import ARRIVED_DEG, ARRIVED_MM, FARTHEST, HELD_SHARE, HELD_SIZE
from servo.study.run import Record
from sim.types import Array

PICTURE = "first_picture"
LAST = "last_picture"
"""Settings of a record: the SHA-256 of the first and the last picture of the run."""
ERROR = "error_sizes"
"""Series of a record: the target's error in each picture (`errors_of`), in target sizes."""
DIGITS = 12
"""Digits of a picture's digest."""
DECIMALS = 9
"""Decimals of a score."""

Share = Annotated[float, Ge(0), Le(1)]


@dataclass(frozen=True, slots=True)
class WorldScore:
    """The result of a contestant in one world (random scenario) of a benchmark: its score (`area`,
    0 to 1), whether it held the target or arrived at its goal (`held`), and digests of the run's
    first and last picture ("": none).
    """

    area: Share
    """Score in this world, 0 to 1."""
    held: bool
    """Whether the robot held its target in at least 95 % of the pictures, or arrived."""
    picture: str = ""
    """Digest of the first picture; empty where nothing was rendered."""
    last: str = ""
    """Digest of the last picture, which depends on the contestant; empty in older rows."""


def area_within(errors: Array, most: float) -> float:
    """Return the mean of max(0, 1 - error / most) over non-negative errors (n,), from 0 to 1;
    `most` is in the unit of the errors.

    It is the area under the curve of the share of errors below tau, for tau from 0 to `most`,
    divided by `most`.

    >>> area_within(np.array([0.0, 1.0, 5.0]), 2.0)
    0.5
    """
    return float(np.clip(1 - errors / most, 0, 1).mean())


def world_score(score: str, record: Record) -> WorldScore:
    """Return the result of a contestant in one world (random scenario), from the record of the run.

    If `score`, the benchmark's kind of score, is "held", the score is that of `score_errors`. If it
    is "arrives", the score is 1 if the run did not end early, the camera ends within 10 mm and 1
    degree of its goal, and no corner of the target was ever outside the picture, where a detector
    would have lost it; else 0. "reaches" is the same, but the target may leave the picture.
    """
    first, last = (record.settings[name][:DIGITS] for name in (PICTURE, LAST))
    if score == "held":
        return replace(score_errors(record.series[ERROR]), picture=first, last=last)
    lasts = bool(np.isfinite(record.series[ERROR][-1]))
    seen = score == "reaches" or record.measures["out_of_view_pct"] == 0.0
    arrived = lasts and seen and is_within(record, ARRIVED_MM, ARRIVED_DEG)
    return WorldScore(float(arrived), arrived, first, last)


def score_errors(errors: Array) -> WorldScore:
    """Return a tracker's result in one world (random scenario) from the error in each picture (n,)
    [target sizes]: its score, which is `area_within` 2 target sizes, and whether it held the
    target, with an error of at most 1 in at least 95 % of the pictures.
    """
    errors = np.asarray(errors, float)
    held = float(np.mean(errors <= HELD_SIZE)) >= HELD_SHARE
    return WorldScore(round(area_within(errors, FARTHEST), DECIMALS), held)


def is_within(record: Record, position: float, rotation: float) -> bool:
    """Return True if the camera was within a distance [mm] and an angle [deg] of its goal at the
    end of a run; False also if this was not measured.
    """
    near = record.measures["end_position_mm"] <= position
    return bool(near and record.measures["end_rotation_deg"] <= rotation)
