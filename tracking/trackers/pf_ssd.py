"""Particle filter and multiple-kernel SSD together (Teuliere, Marchand, Eck, section V).

A small particle filter survives fast motion and occlusion but is coarse; Newton's descent is exact
but has a small basin. So the filter proposes its mean x^PF, and the descent starts from there:

    if d_m(x^PF) <= tau:  x = Newton(x^PF)      else:  x = x^PF

The paper prints >=, which contradicts the sentence before it: a large distance means an occlusion,
where Newton would lock onto what is in front.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, final

import numpy as np
from annotated_types import Ge, Le

from sim.ranges import Share
from sim.types import Array, Frame, Image
from tracking.appearance.bins import LabelledImage
from tracking.appearance.layout import Combine, Sampling
from tracking.appearance.model import SampledModel
from tracking.lock import Lock, LockLimits
from tracking.recognition import LOCK, Recogniser
from tracking.search.newton import Descent, KernelGrid, KernelModel
from tracking.search.particles import ParticleFilter
from tracking.search.velocity import Velocity
from tracking.settings import (
    PLAIN,
    AppearanceSettings,
    CellPoints,
    Contrast,
    Count,
    Inset,
    ParticleSettings,
    Sharpness,
    Spread,
    Turn,
)
from tracking.trackers._cloud import WIDER
from tracking.trackers.mk_pf import CELLS, VIDEO
from tracking.types import Estimate, Region, State, Status, check_region

STEPS = 8
"""Most histogram evaluations of one descent: it begins near, and ends after about five."""
HIDDEN = 0.5
"""Power of the weights in resampling while the target is not seen: 75 particles would gather on
what hides it, and miss it when it comes out."""
PRESETS: dict[str, dict[str, Any]] = {
    "paper": PLAIN | {"inset": 0.0, "density": 16, "sudden": 0.0},
    "video": VIDEO | {"particles": 300, "occluded": 0.3, "trust": 0.15, "inset": 0.0},
}


@dataclass(frozen=True, slots=True)
class Config(AppearanceSettings, ParticleSettings):
    """Settings; the defaults hold for the 60 x 30 px car at 5 to 30 Hz."""

    particles: Count = 75
    gamma: Sharpness = 20.0
    """Sharpness of the likelihood exp(-gamma d_m^2) (equation 13)."""
    noise: Spread = 0.1
    turn_noise: Turn = 0.04
    """Spread of theta per frame [rad]."""
    scale_noise: Share = 0.02
    """Spread of ln scale per frame."""
    contrast: Contrast = 0.5
    learn: bool = False
    """The particles weigh bins by how well they separate the target from its surroundings, and
    follow slow changes of both in the pictures where it was found; the descent does not."""
    inset: Inset = 0.03
    """Share of the region's width and height that the descent's kernels leave out, half on each
    side: there the background shows, whose change would be taken for the target's. From 0.06 on
    what is left of our car no longer holds its angle against parallax."""
    density: CellPoints = 4
    """Points along each side of a cell at which a particle reads the image."""
    combine: Combine = "mean"
    """The cells' squared distances are combined by their mean, or by their sum, which is the mean
    with so many times gamma."""
    occluded: Share = 0.6
    """The paper's tau: no descent where the filter's mean is farther from the target than this
    distance d_m."""
    trust: Annotated[float, Ge(0), Le(1000)] = 0.6
    """The descent is believed up to this distance from the filter's mean, over the target's
    size."""
    sudden: Annotated[float, Ge(0), Le(1000)] = 1.5
    """A distance this many times the median of recent good frames is not believed at first if the
    target seems to jump as well: so it is where something begins to hide it and draws the estimate
    along. 0: it is believed."""

    def build(self, rng: np.random.Generator) -> PfSsd:
        """Return the tracker; its samples are drawn from the generator."""
        return PfSsd(self, rng)


@final
class PfSsd:
    """The combination."""

    def __init__(self, config: Config, rng: np.random.Generator) -> None:
        self._config = config
        self._rng = rng

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Learn both representations from the first frame."""
        check_region(frame, region, state)
        c = self._config
        self._size = float(np.sqrt(region.area(state)))
        # Only the kernels leave the rim out: the particles' ring needs the whole target.
        whole = replace(c, inset=0.0)
        sampling = Sampling(c.density, CELLS, combine=c.combine)
        self._cells = SampledModel(frame.image, region, state, whole, sampling)
        image = self._cells.label(frame.image).image
        grid = KernelGrid(CELLS, levels=c.levels, inset=c.inset)
        self._kernels = KernelModel(image, region, state, grid)
        noise = (c.noise, c.turn_noise, c.scale_noise)
        self._filter = ParticleFilter(region, state, c.particles, noise, self._rng)
        self._lock = Lock(LOCK if c.views > 0 else LockLimits(sudden=c.sudden))
        self._status = Status.LOCKED
        self._found = state
        self._velocity = Velocity(state, c.velocity_memory)
        self._recogniser = None
        if c.views > 0:
            self._recogniser = Recogniser(c.views, image, region, state, self._cells)

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Predict, weigh, descend if the target is seen, resample."""
        c = self._config
        labelled = self._cells.label(frame.image)
        image = labelled.image
        lost = self._status is Status.LOST
        widen = WIDER if lost and self._recogniser is None else 1.0
        self._filter.predict(self._velocity.step(ego), widen)
        if lost:
            height, width = image.shape[:2]
            self._filter.scatter(c.scatter, (width, height), self._found)
        if lost and self._recogniser is not None:
            self._recogniser.send(self._filter, labelled, self._found)
        self._filter.weigh(-c.gamma * self._cells.energy(labelled, self._filter.samples))
        searched = lost and self._recogniser is not None  # in many places: their mean is none
        proposed = self._filter.best() if searched else self._filter.mean()
        descended = self._descend(image, proposed)
        evaluations = len(self._filter.samples) + descended.evaluations
        if self._status is not Status.LOCKED:
            # A hidden target comes out away from the mean: the best particle may be nearer.
            other = self._descend(image, self._filter.best())
            evaluations += other.evaluations
            descended = min(descended, other, key=lambda end: end.distance)
        state, distance = self._judge(labelled, proposed, descended, frame.time)
        estimate = self._filter.estimate(state, distance, self._status, evaluations)
        # While the target is hidden the velocity stays; the mean moves by it and by chance.
        seen = self._status is Status.LOCKED
        self._filter.resample(1.0 if seen else HIDDEN)
        if seen:
            if lost:
                self._filter.gather(state)
            else:
                self._filter.shift(state.vector - proposed.vector)
            self._cells.learn(labelled, state)
            if self._recogniser is not None:
                self._recogniser.learn(labelled, state, distance)
            self._found = state
        # States while the target is lost carry no information on its motion.
        self._velocity.learn(state, seen=seen and not lost)
        return estimate

    def _judge(
        self, image: LabelledImage, proposed: State, descended: Descent, time: float
    ) -> tuple[State, float]:
        """Set the status; return the state and distance to report.

        With views, the end of the descent, which knows the first picture only, must resemble
        what was learned more than its beginning does.
        """
        if self._recogniser is None:
            jump = self._velocity.jump(descended.state, self._size)
            self._status = self._lock.judge(descended.distance, time, jump)
            state = descended.state if self._status is Status.LOCKED else proposed
            return state, descended.distance
        ends = (proposed, descended.state)
        energy = self._cells.energy(image, np.stack([end.vector for end in ends]))
        state = ends[int(np.argmin(energy))]
        distance = self._recogniser.doubt(image, state, self._filter, time)
        self._status = self._lock.judge(distance, time)
        return state, distance

    def _descend(self, image: Image, proposed: State) -> Descent:
        """Descend from the proposal; return the proposal itself if that leads too far away."""
        c = self._config
        descent = self._kernels.descend(image, proposed, most=STEPS, hopeless=c.occluded)
        moved = descent.state.vector - proposed.vector
        if float(np.hypot(moved[0], moved[1])) <= c.trust * self._size:
            return descent
        return Descent(proposed, 1.0, descent.evaluations)
