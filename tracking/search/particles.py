"""A particle filter on (x, y, theta, ln scale) with constant-velocity evolution
(Teuliere, Marchand, Eck, sections IV and V; Isard and Blake 1998).
"""

import numpy as np

from sim.types import Array
from tracking.loops import particle_loops
from tracking.types import LARGEST_LOG, Estimate, Region, State, Status


class ParticleFilter:
    """A set of N particles: samples (N, 4) of x, y [px], theta [rad] and ln scale, and weights
    (N,), which sum to 1. In each frame `predict`, `weigh`, `mean` and `resample` are called in this
    order. All samples begin at `state`; `noise` has the standard deviations of the noise that
    `predict` adds in each frame: of x and y over the target's size (the root of its area at the
    start), of theta [rad], of ln scale.
    """

    def __init__(
        self,
        region: Region,
        state: State,
        count: int,
        noise: tuple[float, float, float],
        rng: np.random.Generator,
    ) -> None:
        """Create the filter with all samples at one state, and equal weights.

        Args:
            region: The template; position noise is relative to its size.
            state: State of the target at first.
            count: Number of samples.
            noise: Standard deviations per frame: of x and y over the target's size (the root of its
                area), of theta [rad], of ln scale.
            rng: Generator of all random numbers.
        """
        self.size = size = float(np.sqrt(region.area(state)))
        """Root of the target's area at the start [px]."""
        self.unit = size / state.scale
        """The same at scale 1 [px]."""
        self._noise = np.array([noise[0] * size, noise[0] * size, noise[1], noise[2]])
        self._rng = rng
        self.samples = np.tile(state.vector, (count, 1))
        self.weights = np.full(count, 1.0 / count)

    def predict(self, velocity: Array, widen: float = 1.0) -> None:
        """Move all samples by the expected change (4,) of x, y [px], theta [rad] and ln scale since
        the last frame, and add normal noise, whose standard deviations are multiplied by `widen`;
        ln scale is clipped to -5..5.
        """
        draws = self._rng.standard_normal(self.samples.shape)
        self.samples = self.samples + velocity + widen * self._noise * draws
        self.samples[:, 3] = self.samples[:, 3].clip(-LARGEST_LOG, LARGEST_LOG)

    def weigh(self, log_likelihood: Array) -> None:
        """Multiply the weights by a likelihood, given by its natural logarithm (N,) up to a
        constant, and scale them to the sum 1.
        """
        # In logarithms: likelihoods of a sharp layer underflow.
        self.weights = particle_loops.normalised(np.log(self.weights) + log_likelihood)

    def mean(self) -> State:
        """Return the state at the weighted mean of the samples. Call it before `resample`, which
        would add variance.
        """
        return State.of(particle_loops.mean(self.samples, self.weights))

    def covariance(self) -> Array:
        """Return the weighted covariance (4, 4) of the samples in x, y [px], theta [rad] and ln
        scale.
        """
        return particle_loops.covariance(self.samples, self.weights)

    @property
    def follows(self) -> tuple[bool, bool]:
        """Pair of bools: True if the samples vary in angle, and True if they vary in size, because
        the noise of this coordinate is above 0.
        """
        return bool(self._noise[2] > 0), bool(self._noise[3] > 0)

    def best(self) -> State:
        """Return the sample with the largest weight as a state."""
        return State.of(self.samples[int(np.argmax(self.weights))])

    def estimate(
        self, state: State, covariance: Array, distance: float, status: Status, evaluations: int
    ) -> Estimate:
        """Return the estimate of a frame, with the samples, weights and effective sample size.

        Args:
            state: The estimated state of the target.
            covariance: Covariance (4, 4) of x, y [px], theta [rad] and ln scale; rows and columns
                of an angle or a size that does not vary between the samples become nan.
            distance: Distance from the target's appearance, 0..1.
            status: LOCKED, UNSURE or LOST.
            evaluations: Number of histograms that were read.
        """
        # Samples that never vary in a coordinate say nothing about it: 0 would claim certainty.
        angle, size = follows = self.follows
        kept = np.array([False, False, not angle, not size])
        particles = np.empty((len(self.samples), 5))
        particles[:, :4] = self.samples
        particles[:, 3] = np.exp(self.samples[:, 3])
        particles[:, 4] = self.weights
        return Estimate(
            state=state,
            covariance=np.where(kept | kept[:, None], np.nan, covariance),
            distance=distance,
            status=status,
            follows=follows,
            ess=particle_loops.effective_size(self.weights),
            evaluations=evaluations,
            particles=particles,
        )

    def resample(self, power: float = 1.0) -> None:
        """Replace the samples by as many systematic draws, each with a probability in proportion to
        its weight raised to `power`; then all weights are equal.
        """
        # Systematic: a sample gets N w_i copies, rounded up or down, which adds little chance.
        weights = self.weights if power == 1.0 else self.weights**power
        self.samples = self.samples[particle_loops.systematic(weights, self._rng.random())]
        self.weights = np.full(len(self.samples), 1.0 / len(self.samples))

    def scatter(self, share: float, size: tuple[int, int], state: State) -> None:
        """Redraw x and y of the first samples uniformly over the picture, because the target may be
        anywhere; weights stay.

        It is sensor resetting (Lenser, Veloso 2000).

        Args:
            share: Share of the samples that is redrawn, 0..1.
            size: Width and height of the picture [px].
            state: State whose angle and size these samples get.
        """
        # After resampling the order of samples has no meaning: the first ones are as good as any.
        count = round(share * len(self.samples))
        self.samples[:count, :2] = self._rng.uniform((0.0, 0.0), size, (count, 2))
        self.samples[:count, 2:] = state.vector[2:]
