"""How long trackers, law and loop take: `uv run --extra dev pytest tests/benchmarks -n 0`.

Nothing is asserted: machines differ. `speed.py` prints the short table.
"""

from functools import lru_cache
from itertools import cycle

import cv2
import numpy as np
import pytest
import speed

from servo.estimators import KINDS as ESTIMATORS
from servo.loop.episode import Episode
from servo.scenario.load import load
from tracking.trackers import KINDS as TRACKERS

film = lru_cache(speed.film)
FIXED = ["camshift", "cv_mean_shift", "cv_mil", "mean_shift", "mk_ssd", "sok"]
CLOUDS = [
    "condensation",
    "annealed",
    "hybrid",
    "kams",
    "kernel_pf",
    "mk_pf",
    "pf_ssd",
    "texture_pf",
]
PARTICLES = [75, 200, 500]
LENGTHS = [30.0, 60.0, 120.0]
WIDTHS = [320, 640]


@pytest.fixture(autouse=True)
def _one_thread():
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    yield
    cv2.setNumThreads(threads)


def update(benchmark, kind, length, width, **settings):
    shown = film(length, width)
    config = TRACKERS.config_of(kind)(**settings)
    tracker = config.build(np.random.default_rng(0))
    tracker.start(shown.frames[0], shown.region, shown.state)
    there_and_back = cycle([*shown.frames[1:], *shown.frames[-2:0:-1]])
    benchmark.group = f"{length:g} px in {width}"
    benchmark.pedantic(lambda: tracker.update(next(there_and_back)), rounds=60, warmup_rounds=5)


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize("kind", FIXED)
def test_tracker(benchmark, kind, length, width):
    update(benchmark, kind, length, width)


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize("particles", PARTICLES)
@pytest.mark.parametrize("kind", CLOUDS)
def test_particle_filter(benchmark, kind, particles, length, width):
    update(benchmark, kind, length, width, particles=particles)


@pytest.mark.parametrize("estimator", ESTIMATORS.names())
def test_features_law_and_estimator(benchmark, estimator):
    with Episode(load("line", ["run.duration=1.0", f"estimator.kind={estimator}"])) as episode:
        step = list(episode)[-1]
        benchmark(
            lambda: episode.controller.command(
                episode.eyes.see(step.estimate, step.truth, step.posture), step.posture, 1 / 30
            )
        )


@pytest.mark.parametrize("size", [(320, 240), (640, 480)])
def test_render(benchmark, size):
    width, height = size
    changes = [f"camera.width={width}", f"camera.height={height}"]
    with Episode(load("line", changes)) as episode:
        benchmark(episode.world.look)


def test_step_of_the_loop(benchmark):
    with Episode(load("line", ["run.duration=20.0"])) as episode:
        steps = iter(episode)
        benchmark.pedantic(lambda: next(steps), rounds=200, warmup_rounds=10)
