"""The combined tracker on painted frames, where the truth is exact."""

import numpy as np
import pytest

from sim.types import Frame
from tracking.trackers.frozen import Config as FrozenConfig
from tracking.trackers.pf_ssd import Config
from tracking.types import Region, State, Status

REGION = Region(60.0, 30.0)
FIRST = State(100.0, 80.0, 0.2, 1.0)


def paint(state, hidden=False, index=0):
    """A rectangle of three colours on a striped ground; hidden: behind a grey board."""
    rows, columns = np.mgrid[0:160, 0:240]
    image = np.empty((160, 240, 3), float)
    image[...] = 120 + 25 * np.sin(columns / 9.0)[..., None] * [1.0, 0.7, 0.4]
    c, s = np.cos(state.theta), np.sin(state.theta)
    dx, dy = columns + 0.5 - state.x, rows + 0.5 - state.y
    u, v = (c * dx + s * dy) / state.scale, (-s * dx + c * dy) / state.scale
    for low, high, colour in (
        (-30, 0, (20, 40, 200)),
        (0, 18, (200, 200, 40)),
        (18, 30, (230, 60, 40)),
    ):
        inside = (u >= low) & (u < high) & (np.abs(v) < 15)
        image[inside] = colour
    if hidden:
        image[30:140, 40:220] = 105
    return Frame(image.astype(np.uint8), index / 30, index)


def path(k):
    return State(100 + 1.2 * k, 80 - 0.3 * k, 0.2 + 0.01 * k, 1.0 + 0.004 * k)


def track(config, frames, seed=0):
    tracker = config.build(np.random.default_rng(seed))
    tracker.start(frames[0], REGION, FIRST)
    return [tracker.update(frame) for frame in frames[1:]]


@pytest.mark.parametrize("seed", range(3))
def test_follows_position_angle_and_size(seed):
    frames = [paint(path(k), index=k) for k in range(40)]
    for k, estimate in enumerate(track(Config(), frames, seed), 1):
        error = np.abs(estimate.state.vector - path(k).vector)
        assert estimate.status is Status.LOCKED
        assert np.hypot(*error[:2]) < 1.0, k
        assert error[2] < np.radians(1.5), k
        assert error[3] < 0.03, k


def test_a_hidden_target_is_unsure_then_lost_and_found_again():
    still = [FIRST] * 70
    hidden = [20 <= k < 55 for k in range(70)]
    frames = [paint(s, h, k) for k, (s, h) in enumerate(zip(still, hidden, strict=True))]
    estimates = track(Config(), frames)
    status = [e.status for e in estimates]
    assert set(status[:19]) == {Status.LOCKED}
    assert status[19] is Status.UNSURE
    assert status[52] is Status.LOST  # 33 frames hidden are more than the patience of a second
    assert status[-1] is Status.LOCKED
    assert np.hypot(estimates[-1].state.x - FIRST.x, estimates[-1].state.y - FIRST.y) < 1.0


def test_a_hidden_target_is_not_replaced_by_what_hides_it():
    frames = [paint(FIRST, 10 <= k < 25, k) for k in range(30)]
    for estimate in track(Config(), frames)[9:24]:
        # No descent onto the board: the scale stays near where the filter left it.
        assert abs(np.log(estimate.state.scale)) < 0.3
        assert estimate.distance > 0.6


def test_beats_doing_nothing():
    frames = [paint(path(k), index=k) for k in range(30)]
    ours, nothing = (track(c, frames)[-1].state for c in (Config(), FrozenConfig()))
    truth = path(29)
    assert REGION.iou(ours, truth) > 0.9
    assert REGION.iou(nothing, truth) < 0.3


def test_reports_its_work_and_its_cloud():
    estimate = track(Config(particles=50), [paint(FIRST, index=k) for k in range(2)])[0]
    assert estimate.particles.shape == (50, 5)
    assert estimate.particles[:, 4].sum() == pytest.approx(1.0)
    assert 51 <= estimate.evaluations <= 50 + Config().steps
    assert 1 <= estimate.ess <= 50
    assert np.all(np.linalg.eigvalsh(estimate.covariance) >= -1e-12)
