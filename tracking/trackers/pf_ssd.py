"""Tracker: particle filter and multiple-kernel SSD together (Teuliere, Marchand, Eck, section V).

A small particle filter survives fast motion and occlusion but is coarse; Newton's descent is exact
but has a small basin. So the filter proposes its mean x^PF, and the descent starts from there:

    if d_m(x^PF) <= tau:  x = Newton(x^PF)      else:  x = x^PF

with d_m the distance of the histograms there from the target's. The paper prints >=, which
contradicts the sentence before it: a large distance means an occlusion, where Newton would lock
onto what is in front.
"""

from dataclasses import dataclass, replace
from typing import Annotated, final

import numpy as np
from annotated_types import Ge, Le

from sim.ranges import Share
from sim.types import Array, Frame, Image
from tracking.appearance.bins import LabelledImage, as_seen
from tracking.appearance.layout import Combine, Sampling
from tracking.appearance.model import SampledModel
from tracking.loss import LossLimits
from tracking.search.newton import Descent, KernelGrid, KernelModel, shows_angle
from tracking.settings import PLAIN, CellPoints, Count, Inset, Spread
from tracking.trackers._cloud import CloudMethod, ParticleTracker
from tracking.trackers.mk_pf import CELLS, VIDEO, SimilaritySettings
from tracking.types import Region, State, Status

STEPS = 8
"""Most histogram evaluations of one descent: it begins near, and ends after about five."""
HIDDEN = 0.5
"""Exponent of the weights in resampling while the target is not seen: with 1, 75 particles gather
on the object in front of it, and miss it when it comes out."""
PRESETS: dict[str, dict[str, object]] = {
    "paper": {**PLAIN, "inset": 0.0, "density": 16, "sudden": 0.0},
    "video": {**VIDEO, "particles": 300, "occluded": 0.3, "trust": 0.15, "inset": 0.0},
}


@dataclass(frozen=True, slots=True)
class Config(SimilaritySettings):
    """Settings of the particles, and of Newton's descent from their mean: the largest distance d_m
    of the mean, 0..1, with which a descent begins (`occluded`), its largest length as a share of
    the target's size (`trust`), and the share of the region's sides that its kernels leave out
    (`inset`). Particles read `density` points along each side of a cell of the template. At a
    sudden rise of the distance to `sudden` times the usual one the target counts as not seen (0: no
    such check).

    The defaults were tuned for the 60 x 30 px car at 5 to 30 Hz.
    """

    particles: Count = 75
    noise: Spread = 0.1
    learn: bool = False
    """The particles weigh bins by how well they separate the target from its surroundings, and
    follow slow changes of both in pictures in which it is LOCKED; the descent does not."""
    inset: Inset = 0.03
    """Share of the region's width and height that the descent's kernels leave out, half on each
    side: there the background shows, whose change would be taken for the target's. From 0.06 on
    what is left of our car no longer holds its angle against parallax."""
    density: CellPoints = 4
    """Points along each side of a cell at which a particle reads the image."""
    combine: Combine = "mean"
    """The cells' squared distances are combined by their mean, or by their sum, which acts like
    the mean with gamma multiplied by the number of cells."""
    occluded: Share = 0.6
    """The paper's tau: no descent where the distance d_m of the histograms at the filter's mean
    exceeds this."""
    trust: Annotated[float, Ge(0), Le(1000)] = 0.6
    """Largest distance of the descent's end from the filter's mean at which the end is used, over
    the target's size.
    """
    sudden: Annotated[float, Ge(0), Le(1000)] = 1.5
    """If the distance exceeds this many times the median of recent good frames, and the estimate
    jumps, the target counts as not seen at first: something begins to hide it and pulls the
    estimate along. 0: no such check.
    """

    @property
    def sampling(self) -> Sampling:
        return Sampling(self.density, CELLS, combine=self.combine)

    @property
    def method(self) -> CloudMethod:
        return CloudMethod(hidden=HIDDEN)

    def model(self, image: Image, region: Region, state: State) -> SampledModel:
        """Return the reference histograms by which particles are weighed, learnt from the first
        picture, RGB (H, W, 3), in which the target is the rectangle `region` [px] at `state`. The
        setting `inset` is not used, as it is for the descent's kernels only: particles are also
        weighed by how unlike the whole target the ring around their region is.
        """
        return SampledModel(image, region, state, replace(self, inset=0.0))

    def build(self, rng: np.random.Generator) -> ParticleTracker:
        """Return a new tracker with these settings, which draws its particles from `rng`."""
        return PfSsd(self, rng)


@final
class PfSsd(ParticleTracker):
    """Particle filter whose mean is refined by Newton's descent on histograms. Without the settings
    `views` and `witness`, it reports the descent's end if the target is seen there, and else the
    mean of the particles; with one of them, whichever of both is more like the learnt appearance,
    or, with `witness`, another place to which a lost target's estimate jumps. After a frame in
    which the target was not seen, a second descent begins at the best particle. There is no descent
    from a state whose distance exceeds `occluded`, and an end farther away than `trust` is not
    used.
    """

    def __init__(self, config: Config, rng: np.random.Generator) -> None:
        super().__init__(config, LossLimits(sudden=config.sudden), rng)
        self._config = config

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Learn the target's histograms for particles and descent from the first frame, in which it
        is the rectangle `region` [px] at `state`, and put all particles on this state.

        Raises:
            ValueError: `check_region` refuses the picture or the region: a side of the region is
                shorter than 4 px, for instance, or most of it is outside the picture.
        """
        super().start(frame, region, state)
        c = self._config
        image = as_seen(frame.image, even=c.even)
        grid = KernelGrid(CELLS, levels=c.levels, inset=c.inset)
        # Where the particles do not turn at all, as on recordings, the descent alone does, unless
        # the target looks the same at all angles.
        alone = c.turn_noise == 0 and shows_angle(image, region, state)
        turns = alone or self._cloud.follows[0]
        self._kernels = KernelModel(image, region, state, grid, turns=turns)

    def _search(self, image: LabelledImage, change: Array, widen: float) -> int:
        cloud = self._cloud
        cloud.predict(change, widen)
        # After the prediction, because particles redrawn uniformly need no motion model.
        self._strew(image)
        cloud.weigh(-self._config.gamma * self._energy(image, cloud.samples))
        return len(cloud.samples)

    def _judge(
        self, image: LabelledImage, proposed: State, time: float
    ) -> tuple[State, Array, float, int]:
        """Report the end of a descent where the target is seen there, else the proposed state.

        The end of a descent has its own covariance, because the particles spread as they are moved,
        whether the picture shows the state or not. With views or a witness, the end is reported
        where it is more like the learned appearance than the proposed state is (the descent knows
        the first picture only), and a witness may make the estimate jump to another place.
        """
        end = self._descend(image.image, proposed)
        evaluations = end.evaluations
        if self._status is not Status.LOCKED:
            # A hidden target comes out away from the mean: the best particle may be nearer.
            other = self._descend(image.image, self._cloud.best())
            evaluations += other.evaluations
            end = min(end, other, key=lambda end: end.distance)
        if self._witness is not None:
            both = np.stack([proposed.vector, end.state.vector])
            ends_there = bool(np.argmin(self._energy(image, both)))
            best = end.state if ends_there else proposed
            state, distance, more = self._hear(self._witness, image, best, time)
            evaluations += more
            ends_there = state is end.state
            if not ends_there:
                return state, self._cloud.covariance(), distance, evaluations
        elif self._recogniser is None:
            jump = self._velocity.jump(end.state, self._cloud.unit)
            self._status = self._loss.judge(end.distance, time, jump)
            ends_there = self._status is Status.LOCKED
            distance = end.distance
        else:
            both = np.stack([proposed.vector, end.state.vector])
            ends_there = bool(np.argmin(self._model.energy(image, both)))
            state = end.state if ends_there else proposed
            distance = self._recogniser.doubt(image, state, self._cloud, time)
            self._status = self._loss.judge(distance, time)
        if ends_there:
            covariance = self._kernels.covariance(image.image, end.state)
            return end.state, covariance, distance, evaluations
        return proposed, self._cloud.covariance(), distance, evaluations

    def _descend(self, image: Image, proposed: State) -> Descent:
        """Return the end of a descent from a state that the particles propose; that state itself if
        its distance exceeds `occluded`, or, with distance 1, if the descent ends farther away than
        `trust` allows.
        """
        descent = self._kernels.descend(image, proposed, most=STEPS, hopeless=self._config.occluded)
        moved = descent.state.vector - proposed.vector
        if float(np.hypot(moved[0], moved[1])) <= self._config.trust * self._cloud.size:
            return descent
        return Descent(proposed, 1.0, descent.evaluations)
