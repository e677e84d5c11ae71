"""A particle filter on (x, y, theta, ln scale) with constant-velocity evolution
(Teuliere, Marchand, Eck, sections IV and V; Isard and Blake 1998).
"""

import numpy as np

from sim.types import Array
from tracking.loops import particle_loops
from tracking.types import LARGEST_LOG, Estimate, Region, State, Status


class ParticleFilter:
    """Samples, their weights, and the velocity that moves them: predict, weigh, read, resample."""

    def __init__(
        self,
        region: Region,
        state: State,
        count: int,
        noise: tuple[float, float, float],
        rng: np.random.Generator,
    ) -> None:
        """Put all samples on one state.

        Args:
            region: The template; position noise is relative to its size.
            state: State of the target at first.
            count: Number of samples.
            noise: Standard deviations per frame: of x and y over the target's size (the root of its
                area), of theta [rad], of ln scale.
            rng: Source of all draws.
        """
        self.size = size = float(np.sqrt(region.area(state)))
        """Root of the target's area at the start [px]."""
        self._noise = np.array([noise[0] * size, noise[0] * size, noise[1], noise[2]])
        self._rng = rng
        self.samples = np.tile(state.vector, (count, 1))
        self.weights = np.full(count, 1.0 / count)

    def predict(self, velocity: Array, widen: float = 1.0) -> None:
        """Move every sample by the velocity (4,) per frame, and spread them."""
        draws = self._rng.standard_normal(self.samples.shape)
        spread = widen * self._noise
        self.samples = particle_loops.moved(self.samples, velocity, spread, draws, LARGEST_LOG)

    def weigh(self, log_likelihood: Array) -> None:
        """Weigh the samples by a log-likelihood (N,), on top of the weights they have."""
        self.weights = particle_loops.normalised(np.log(self.weights) + log_likelihood)

    def mean(self) -> State:
        """Return the weighted mean. It is read before resampling, which only adds variance."""
        return State.of(particle_loops.mean(self.samples, self.weights))

    def covariance(self) -> Array:
        """Return the covariance (4, 4) of the samples."""
        return particle_loops.covariance(self.samples, self.weights)

    @property
    def follows(self) -> tuple[bool, bool]:
        """True where the angle, and the size, vary between the samples."""
        return bool(self._noise[2] > 0), bool(self._noise[3] > 0)

    def best(self) -> State:
        """Return the sample with the largest weight."""
        return State.of(self.samples[int(np.argmax(self.weights))])

    def estimate(
        self, state: State, covariance: Array, distance: float, status: Status, evaluations: int
    ) -> Estimate:
        """Return the report of a filter that found this state, with a covariance (4, 4), in the
        frame; nan stands in it for what does not vary between the samples.
        """
        kept = np.array([False, False, *(not on for on in self.follows)])
        return Estimate(
            state=state,
            covariance=np.where(kept | kept[:, None], np.nan, covariance),
            distance=distance,
            status=status,
            follows=self.follows,
            ess=particle_loops.effective_size(self.weights),
            evaluations=evaluations,
            particles=particle_loops.cloud(self.samples, self.weights),
        )

    def resample(self, power: float = 1.0) -> None:
        """Draw the samples anew, in proportion to their weights raised to a power."""
        weights = self.weights if power == 1.0 else self.weights**power
        self.samples = self.samples[particle_loops.systematic(weights, self._rng.random())]
        self.weights = np.full(len(self.samples), 1.0 / len(self.samples))

    def gather(self, state: State) -> None:
        """Put all samples on one state, as at the start."""
        self.samples = np.tile(state.vector, (len(self.samples), 1))

    def scatter(self, share: float, size: tuple[int, int], state: State) -> None:
        """Strew a share of the samples evenly over an image of this width and height [px], with a
        state's angle and size: the target may be anywhere (Lenser, Veloso 2000).
        """
        count = round(share * len(self.samples))
        self.samples[:count, :2] = self._rng.uniform((0.0, 0.0), size, (count, 2))
        self.samples[:count, 2:] = state.vector[2:]

    def shift(self, correction: Array) -> None:
        """Move all samples by (4,)."""
        self.samples = self.samples + correction
