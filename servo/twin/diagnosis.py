"""Which mistakes in a log or a film explain that the two do not fit: the log is fitted with each
correction of a list, then with pairs of them, and the lowest robust cost wins if it is clear.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from operator import attrgetter, itemgetter

import numpy as np

from servo.twin import mount as mounts
from servo.twin import offset as offsets
from servo.twin.corrections import (
    Correction,
    Smooth,
    corrections,
    millimetres,
    mixed,
    motion,
    turned,
)
from servo.twin.mount import Mount
from servo.twin.tracks import Tracks
from sim.types import Array

CLEAR = 1.15
"""Least ratio of two costs that tells one correction from another."""
GOOD = 1.6
SMALL = 0.15
"""Nothing more is wrong if the cost is below so many times that of the best motion of each pair of
pictures, or the points' distance from the fit is below this share of their motion: a log has noise,
too."""
TRIED = 120, 4
"""Pairs of pictures of a trial, and each so many-th point of them is used."""
GLANCED = 60, 8
"""The same for a first glance."""
EVERY = 4
"""Each so many-th pair of consecutive pictures gives a trial its offset and its start."""
KEPT = 12
"""Number of corrections, or of pairs of them, that fit best at the first glance and are then
tried."""
TRIAL = 3.0, 3.0, 1.0, 1.0, 0.5, 0.3
GLANCE = 3.0, 1.0, 0.5
"""Cauchy scale of each step of a trial, and of a first glance [px]."""
COARSE = 0.03
"""Interval of the offsets of a trial [s]."""
NEAR = 0.15
"""Largest distance of a trial's offset from the known one [s]."""
TINY = 1e-9
FARTHEST = 60.0
"""Largest plausible distance of a scene [m]."""
ROUNDS = 3
"""Steps in which the turn between two frames of a log is found."""
SINGLES = 4
"""Number of best single corrections that are combined with all others; usual ones are combined with
usual ones in any case."""


@dataclass(frozen=True, slots=True)
class Trial:
    """The fit of the camera's mount to log and film after some corrections of them, and how well it
    fits: `cost` is the mean Cauchy cost of the points with a scale of 0.3 px, infinite if the scene
    would be behind the camera.
    """

    corrections: tuple[Correction, ...]
    cost: float
    mount: Mount
    share: float
    """Median distance of the points from the fit, over their median motion."""


def is_good(trial: Trial, floor: float) -> bool:
    """Return True if a trial explains the pictures nearly as well as any motion can: its cost is
    below 1.6 times `floor`, or the points are off the fit by less than 15 % of their motion.

    Args:
        trial: The fit after some corrections.
        floor: Cost of the best motion of each pair of pictures, from `floor_of`.
    """
    return trial.cost < GOOD * floor or (np.isfinite(trial.cost) and trial.share < SMALL)


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """The corrections that a robot's log and its film need: the fit with the best ones (`best`),
    fits with the same number of other corrections that explain the recording about as well, the
    likeliest first (`others`), and the fit before any search (`as_it_is`).
    """

    best: Trial
    others: list[Trial]
    as_it_is: Trial
    floor: float
    """Cost of the best motion of each pair of pictures."""

    @property
    def is_clean(self) -> bool:
        """True if the best fit needs no corrections."""
        return not self.best.corrections

    @property
    def is_good(self) -> bool:
        """True if the best fit explains the pictures nearly as well as any motion can, so that
        nothing more is wrong.
        """
        return is_good(self.best, self.floor)


def effect(given: tuple[Correction, ...]) -> tuple[float, Array]:
    """Return what corrections change in a film: the factor on its times, and the signs (2,) of x
    and y in its pictures, 1 or -1.
    """
    flips = np.prod([[1.0, 1.0], *(each.flips for each in given)], axis=0)
    return float(np.prod([each.stretch for each in given])), flips


def corrected(tracks: Tracks, given: tuple[Correction, ...]) -> Tracks:
    """Return the followed points of a film after corrections that flip the film or stretch its
    times, which keeps the time of the first picture.
    """
    stretch, flips = effect(given)
    return replace(
        tracks,
        times=tracks.times[0] + (tracks.times - tracks.times[0]) * stretch,
        before=tracks.before * flips,
        after=tracks.after * flips,
    )


def floor_of(tracks: Tracks) -> float:
    """Return the mean Cauchy cost of the points (scale 0.3 px) if each pair of pictures has the
    motion of a plane that fits it best. No mount of the camera can have a much lower cost.
    """
    middle = tracks.before
    x, y = middle[..., 0], middle[..., 1]
    one, none = np.ones_like(x), np.zeros_like(x)
    rows = np.stack(
        [
            np.stack([one, x, y, none, none, none, x * x, x * y], axis=2),
            np.stack([none, none, none, one, x, y, x * y, y * y], axis=2),
        ],
        axis=2,
    )
    flat = rows.reshape(len(x), -1, 8)
    moved = ((tracks.after - tracks.before) * tracks.focal).reshape(len(x), -1, 1)
    known = np.repeat(tracks.known, 2, axis=1).astype(float)[..., None]
    weights = known
    away = np.zeros(tracks.known.shape)
    for scale in mounts.SCALES:
        weighted = flat * weights
        normal = weighted.transpose(0, 2, 1) @ flat + 1e-9 * np.eye(8)
        fit = np.linalg.solve(normal, weighted.transpose(0, 2, 1) @ moved)
        away = np.linalg.norm((moved - flat @ fit).reshape(*x.shape, 2), axis=2)
        weights = known / (1 + np.repeat(away / scale, 2, axis=1)[..., None] ** 2)
    return float(np.mean(np.log1p((away[tracks.known] / mounts.LAST) ** 2)))


def diagnose(
    smooth: Smooth,
    tracks: Tracks,
    known: float | None,
    along: float | None,
    tick: Callable[[str], None],
    *,
    surely: tuple[Correction, ...] = (),
    search: bool = True,
) -> Diagnosis:
    """Return the corrections that a robot's log and the film of its camera need: those that surely
    are needed, and none, one or two of `corrections` and `mixed`, with which the log fits the film
    best.

    Args:
        smooth: The smoothed log.
        tracks: Points that were followed through the film.
        known: Offset of the film's clock, if it is known [s].
        along: Distance from the hand's origin to the camera along the optical axis [m], if it is to
            be kept and the focal length estimated; None: the reverse.
        tick: Called after each fit, with a note about it.
        surely: Corrections that are known to be needed, and are part of each fit.
        search: Whether corrections are tried; False: the log is only fitted as it is.
    """
    steps = tracks.steps
    thin = np.arange(len(steps.first)) % EVERY == 0
    steps = steps.only(thin)
    flows = offsets.affine_flows(steps)
    part = _part(tracks, *TRIED)
    floor = floor_of(part)

    surely = (*surely, *_unit(smooth, steps, flows, known, surely))

    def tried(*given: Correction, of: Tracks = part, scales: tuple[float, ...] = TRIAL) -> Trial:
        trial = _trial(smooth, of, steps, flows, known, along, (*given, *surely), scales)
        supposed = " and ".join(each.mistake for each in given)
        tick(f"supposing that {supposed}" if given else "supposing that the log is right")
        return trial

    as_it_is = tried()
    if not search or as_it_is.cost < CLEAR * floor:
        return Diagnosis(as_it_is, [], as_it_is, floor)
    coarse = _part(tracks, *GLANCED)

    def best_of(choices: Iterable[tuple[Correction, ...]]) -> list[Trial]:
        """Return the trials of the corrections that look best at a glance, the best one first."""
        glances = [(tried(*each, of=coarse, scales=GLANCE).cost, each) for each in choices]
        glances.sort(key=itemgetter(0))
        return sorted((tried(*each) for _, each in glances[:KEPT]), key=attrgetter("cost"))

    candidates = corrections(smooth)
    singles = best_of((each,) for each in candidates)
    trials = [as_it_is, *singles]
    two_frames = list(mixed(smooth))
    if not any(is_good(trial, floor) for trial in trials):
        trials += [tried(each) for each in two_frames]
    if not any(is_good(trial, floor) for trial in trials):
        best = [trial.corrections[0] for trial in singles[:SINGLES] if trial.corrections]
        pairs = {
            frozenset((id(one), id(other))): (one, other)
            for one in candidates
            for other in [*candidates, *two_frames]
            if (one in best or (one.is_usual and (other.is_usual or other in two_frames)))
            and one.mistake.split()[:4] != other.mistake.split()[:4]
        }
        trials += best_of(pairs.values())
    least = min(trial.cost for trial in trials)
    near = [trial for trial in trials if trial.cost <= CLEAR * least]
    fewest = min(len(trial.corrections) for trial in near)
    same = sorted(
        (trial for trial in near if len(trial.corrections) == fewest),
        key=lambda trial: (-sum(each.is_usual for each in trial.corrections), trial.cost),
    )
    return Diagnosis(same[0], same[1:], as_it_is, floor)


def _part(tracks: Tracks, pairs: int, every: int) -> Tracks:
    """Return evenly spread pairs of pictures that are three pictures apart (of consecutive ones if
    there are no such pairs), with each `every`-th point: from `pairs` to about twice as many, or
    all if there are fewer.
    """
    spans = tracks.second - tracks.first > 1
    chosen = np.zeros(len(spans), bool)
    places = np.flatnonzero(spans if spans.any() else ~spans)
    chosen[places[:: max(1, len(places) // pairs)]] = True
    return tracks.only(chosen, every)


def _unit(
    smooth: Smooth,
    steps: Tracks,
    flows: Array,
    known: float | None,
    surely: tuple[Correction, ...],
) -> tuple[Correction, ...]:
    """Return the correction of lengths in millimetres if the scene would be more than 60 m away; an
    empty tuple if not, or if the offset is not known. No residual shows the unit, only the depth.
    """
    if known is None:
        return ()
    film = corrected(steps, surely)
    far = mounts.start(motion(smooth, *surely), film, flows, known).depth
    return (millimetres(smooth),) if far > FARTHEST else ()


def _trial(
    smooth: Smooth,
    part: Tracks,
    steps: Tracks,
    flows: Array,
    known: float | None,
    along: float | None,
    given: tuple[Correction, ...],
    scales: tuple[float, ...],
) -> Trial:
    """Return the fit to the pairs of pictures `part` after the corrections `given`; its offset and
    its start come from the consecutive pictures `steps` and their affine flows.
    """
    moved = motion(smooth, *given)
    film = corrected(part, given)
    whole = corrected(steps, given)
    stretch, (sx, sy) = effect(given)
    changed = flows / stretch * (sx, 1.0, sx * sy, sy, sx * sy, 1.0)
    reach = offsets.WIDEST if known is None or stretch != 1 else NEAR
    middle = 0.0 if known is None or stretch != 1 else known
    grid = middle + np.arange(-reach, reach + COARSE / 2, COARSE)
    best, _ = offsets.explained(moved, whole, changed, grid)
    fixed = (mounts.FOCAL if along is None else mounts.LEVER_ALONG, mounts.DRIFT, *mounts.TURN)
    if any(each.turn is not None for each in given):
        fixed = fixed[:2]
        for _ in range(ROUNDS):
            given = turned(given, mounts.turn_of(moved, whole, changed, best), smooth, moved)
            moved = motion(smooth, *given)
    first = mounts.start(moved, whole, changed, best, along or 0.0)
    found = mounts.fitted(moved, film, first, fixed, scales)
    # A scene behind the camera explains slides of the other sign.
    cost = found.cost if found.plane[2] > 0 else np.inf
    moves = np.linalg.norm(film.after - film.before, axis=2)[film.known]
    share = found.off / max(film.focal * float(np.median(moves)), TINY)
    return Trial(given, cost, found, share)
