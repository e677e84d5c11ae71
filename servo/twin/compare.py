"""The comparison of a robot's log with the film of its camera: the offset of the film's clock,
mistakes in the log, the mount (pose of the camera in the hand), and a verdict.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from servo.twin import mount as mounts
from servo.twin import offset as offsets
from servo.twin.corrections import Correction, Smooth, disguises, motion
from servo.twin.diagnosis import corrected, diagnose
from servo.twin.robot_motion import RobotMotion
from servo.twin.tracks import Tracks
from servo.twin.verdict import (
    SHALLOW,
    SLIDES,
    TURNS,
    Fits,
    Trust,
    Verdict,
    judge,
    preferred,
    second_axes,
)
from sim.types import Array

ROUGH = 0.04
"""Interval of the offsets of a search over the whole log [s]."""
OVERLAP = 0.6
"""Least overlap of film and log in this search, as a share of the shorter of the two."""
LAST = 0.5, 0.3, 0.3
"""Cauchy scale of each step of the fit with a turn [px]."""
THIRDS = 3
"""Parts of a film whose offsets show a drift."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """The result of the comparison of a robot's log with the film of its camera."""

    fits: Fits
    """What was fitted; the times of its points are on the log's clock but for the offset."""
    motion: RobotMotion
    """The hand's motion after all corrections; for a camera that stands still, the motion of the
    base in the hand's frame."""
    flows: Array
    """Affine flows (p, 6) of consecutive pictures [1/s]."""
    verdict: Verdict


def compare(
    smooth: Smooth, tracks: Tracks, trust: Trust, tick: Callable[[str], None]
) -> Comparison:
    """Compare a robot's log with the points of a film: estimate the offset of the film's clock and
    the mount (pose of the camera in the hand), and look for mistakes in log and film.

    Args:
        smooth: The smoothed log.
        tracks: Points that were followed through the film, with times on the log's clock to within
            1 s.
        trust: What is known of the camera.
        tick: Called after each fit, with a note about it.
    """
    steps = tracks.steps
    flows = offsets.affine_flows(steps)
    rng = np.random.default_rng(0)
    offset = offsets.found(motion(smooth), steps, flows, rng)
    surely = () if offset.depth > SHALLOW else _revealing(smooth, steps)
    is_shown = bool(offset.depth > SHALLOW or surely)
    known = offset.value if is_shown and not surely and not offset.at_end else None
    axes = second_axes(motion(smooth), tracks)
    along = None if trust.focal else trust.along or 0.0
    search = is_shown and (axes[0] >= SLIDES or axes[1] >= TURNS)
    diagnosis = preferred(
        diagnose(smooth, tracks, known, along, tick, surely=surely, search=search), trust.believed
    )
    given = diagnosis.best.corrections
    moved = motion(smooth, *given)
    film = corrected(tracks, given)
    if given:
        flows = offsets.affine_flows(film.steps)
        offset = offsets.found(moved, film.steps, flows, rng)
    first = replace(diagnosis.best.mount, drift=_drift(moved, film))
    fixed = mounts.FOCAL if along is None else mounts.LEVER_ALONG
    mount = mounts.fitted(moved, film, first, (fixed, *mounts.TURN))
    turned = mounts.fitted(moved, film, mount, (fixed,), LAST)
    tag = None
    # A mirrored film shows no tag; a mount that is far off gives no begin.
    if trust.tag is not None and diagnosis.is_good:
        tag = trust.tag.fitted(moved, film, mount)
        if tag.is_still:
            # The plane was found for another focal length and lever.
            fixed = (mounts.FOCAL, mounts.LEVER_ALONG, *mounts.TURN)
            again = mounts.fitted(moved, film, tag.mount, fixed, LAST)
            mount = replace(tag.mount, plane=again.plane)
    fits = Fits(offset, diagnosis, mount, turned, film, axes, smooth.is_inverse, tag)
    return Comparison(fits, moved, flows, judge(fits, trust))


def _revealing(smooth: Smooth, steps: Tracks) -> tuple[Correction, ...]:
    """Return the correction with which a log that does not explain the film does explain it, if
    there is one: of the film's rate, or of joint angles in degrees.
    """
    deepest = SHALLOW
    best: tuple[Correction, ...] = ()
    for each in disguises(smooth):
        film = corrected(steps, (each,))
        found = offsets.curve_of(motion(smooth, each), film, offsets.affine_flows(film))
        if found.depth > deepest:
            deepest = found.depth
            best = (each,)
    return best


def _drift(moved: RobotMotion, film: Tracks) -> float:
    """Return a first estimate of the drift of the clocks [s/s], from the offsets of the thirds of a
    film; 0 if one of these is not clear.
    """
    first = film.first
    parts = np.array_split(np.flatnonzero(film.second - first == 1), THIRDS)
    middles: list[float] = []
    values: list[float] = []
    for part in parts:
        chosen = np.isin(np.arange(len(first)), part)
        some = film.only(chosen)
        if not chosen.any():
            return 0.0
        found = offsets.curve_of(moved, some, offsets.affine_flows(some))
        if found.depth < SHALLOW or found.at_end:
            return 0.0
        middles.append(float(film.times[first[part]].mean()))
        values.append(found.value)
    return float(np.polyfit(middles, values, 1)[0])


def rough_begin(smooth: Smooth, tracks: Tracks) -> float:
    """Return the time on the log's clock at which a film begins whose times have another clock [s]:
    where the hand's motion explains the motion of the film's points best, to about 20 ms.

    Args:
        smooth: The smoothed log.
        tracks: Points that were followed through the film, with times from any origin.
    """
    steps = tracks.steps
    room = smooth.times[-1] - smooth.times[0]
    length = tracks.times[-1] - tracks.times[0]
    early = -(1 - OVERLAP) * min(length, room)
    late = room - OVERLAP * min(length, room)
    grid = smooth.times[0] - tracks.times[0] + np.arange(early, max(late, early + ROUGH), ROUGH)
    best, _ = offsets.explained(motion(smooth), steps, offsets.affine_flows(steps), grid)
    return best
