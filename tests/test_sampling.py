import numpy as np
import pytest

from tracking.loops import particle_loops
from tracking.search.particles import ParticleFilter
from tracking.types import LARGEST_LOG, Region, State

RNG = np.random.default_rng(8)


def test_weights_of_huge_negative_logs_still_sum_to_one():
    weights = particle_loops.normalised(np.array([-1e4, -1e4 + np.log(3.0)]))
    np.testing.assert_allclose(weights, [0.25, 0.75])


def test_effective_size_of_equal_and_of_single_weights():
    assert particle_loops.effective_size(np.full(8, 1 / 8)) == pytest.approx(8.0)
    assert particle_loops.effective_size(np.array([1.0, 0.0, 0.0])) == 1.0


def test_mean_and_covariance_are_the_weighted_ones():
    samples, weights = RNG.normal(size=(50, 3)), RNG.dirichlet(np.ones(50))
    np.testing.assert_allclose(
        particle_loops.covariance(samples, weights),
        np.cov(samples.T, aweights=weights, ddof=0),
        atol=1e-12,
    )
    np.testing.assert_allclose(
        particle_loops.mean(samples, weights), np.average(samples, 0, weights)
    )


def test_samples_move_with_noise_and_their_size_is_limited():
    region, state = Region(40.0, 10.0), State(100.0, 50.0)
    cloud = ParticleFilter(region, state, 4000, (0.1, 0.3, 0.4), np.random.default_rng(0))
    cloud.predict(np.array([3.0, -2.0, 0.1, 0.2]), 2.0)
    np.testing.assert_allclose(cloud.samples.mean(axis=0), [103.0, 48.0, 0.1, 0.2], atol=0.1)
    np.testing.assert_allclose(cloud.samples.std(axis=0), [4.0, 4.0, 0.6, 0.8], rtol=0.05)
    cloud.predict(np.array([0.0, 0.0, 0.0, 1e3]))
    assert set(cloud.samples[:, 3]) == {LARGEST_LOG}


def test_systematic_resampling_agrees_with_numpy_whatever_the_weights_sum_to():
    for first in (0.0, 0.3, 1 - 1e-16):
        weights = RNG.dirichlet(np.full(40, 0.3)) * RNG.uniform(0.1, 7)
        positions = (first + np.arange(40)) / 40 * weights.sum()
        expected = np.minimum(np.searchsorted(weights.cumsum(), positions, side="right"), 39)
        np.testing.assert_array_equal(particle_loops.systematic(weights, first), expected)


@pytest.mark.parametrize("seed", range(10))
def test_systematic_resampling_draws_floor_or_ceil_of_the_expected_number(seed):
    rng = np.random.default_rng(seed)
    weights = rng.dirichlet(np.full(40, 0.3))
    counts = np.bincount(particle_loops.systematic(weights, rng.random()), minlength=40)
    assert counts.sum() == 40
    assert np.all(counts >= np.floor(40 * weights - 1e-9))
    assert np.all(counts <= np.ceil(40 * weights + 1e-9))


def test_systematic_resampling_is_unbiased():
    weights = np.array([0.05, 0.15, 0.3, 0.5])
    drawn = np.mean(
        [
            np.bincount(particle_loops.systematic(weights, RNG.random()), minlength=4)
            for _ in range(4000)
        ],
        axis=0,
    )
    # Each count has a standard deviation below 0.5, so its mean one below 0.008: four of them.
    np.testing.assert_allclose(drawn, 4 * weights, atol=0.032)


def make(noise=(0.1, 0.05, 0.02), count=4000):
    return ParticleFilter(
        Region(40.0, 10.0), State(50.0, 60.0), count, noise, np.random.default_rng(1)
    )


def test_prediction_moves_by_the_velocity_and_spreads_by_the_noise():
    cloud = make()
    cloud.predict(np.array([3.0, -2.0, 0.1, 0.0]))
    spread = cloud.samples.std(axis=0)
    # The target's size is sqrt(40 * 10) = 20 px; 4000 samples give 1.1 % of error per sigma.
    np.testing.assert_allclose(spread, [2.0, 2.0, 0.05, 0.02], rtol=0.05)
    np.testing.assert_allclose(cloud.samples.mean(axis=0), [53.0, 58.0, 0.1, 0.0], atol=0.15)


def test_a_gaussian_likelihood_gives_the_kalman_posterior():
    cloud = make(count=20000)
    cloud.predict(np.zeros(4))
    prior, measured, sigma = 2.0, 52.0, 1.0
    cloud.weigh(-((cloud.samples[:, 0] - measured) ** 2) / (2 * sigma**2))
    gain = prior**2 / (prior**2 + sigma**2)
    # 20000 samples, about half of them effective: 0.01 px of standard error.
    assert cloud.mean().x == pytest.approx(50 + gain * 2, abs=0.04)
    assert cloud.covariance()[0, 0] == pytest.approx((1 - gain) * prior**2, rel=0.05)
    cloud.resample()
    assert cloud.samples[:, 0].mean() == pytest.approx(50 + gain * 2, abs=0.04)
    assert particle_loops.effective_size(cloud.weights) == pytest.approx(20000)
