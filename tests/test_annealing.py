from itertools import pairwise

import numpy as np
import pytest

from tracking.loops import particle_loops
from tracking.search.annealing import ONE_LAYER, Annealing, Schedule, anneal
from tracking.search.particles import ParticleFilter
from tracking.types import Region, State

RNG = np.random.default_rng(0)


@pytest.mark.parametrize("survival", [0.2, 0.5, 0.9])
def test_the_exponent_lets_the_asked_share_survive(survival):
    w = -RNG.gamma(2.0, 3.0, 200)
    weights = particle_loops.normalised(particle_loops.exponent(w, survival * 200) * w)
    assert particle_loops.effective_size(weights) == pytest.approx(survival * 200, rel=1e-3)


def test_equal_likelihoods_cannot_be_sharpened():
    assert np.isfinite(particle_loops.exponent(np.zeros(10), 5.0))


def cloud(count=300):
    return ParticleFilter(Region(40.0, 40.0), State(0.0, 0.0), count, (0.5, 0.0, 0.0), RNG)


def far_peak(found):
    """A narrow peak 30 px away, on a broad slope that leads to it."""
    distance = np.hypot(found.samples[:, 0] - 30, found.samples[:, 1])
    return -0.05 * distance**2


@pytest.mark.parametrize("schedule", Schedule)
def test_layers_reach_a_peak_that_one_step_does_not(schedule):
    layered, plain = cloud(), cloud()
    anneal(layered, np.zeros(4), far_peak, Annealing(6, schedule), 1.0)
    anneal(plain, np.zeros(4), far_peak, ONE_LAYER, 1.0)
    assert layered.mean().x == pytest.approx(30.0, abs=3.0)
    sizes = [particle_loops.effective_size(found.weights) for found in (plain, layered)]
    assert sizes[0] < sizes[1]


def test_the_cloud_narrows_from_layer_to_layer():
    spreads = []

    def likelihood(found):
        spreads.append(found.samples[:, 0].std())
        return -0.01 * (found.samples[:, 0] ** 2 + found.samples[:, 1] ** 2)

    anneal(cloud(2000), np.zeros(4), likelihood, Annealing(5, Schedule.SURVIVAL), 1.0)
    assert len(spreads) == 5
    assert all(b < a for a, b in pairwise(spreads))
