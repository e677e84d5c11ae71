"""The combined tracker on painted frames, where the truth is exact."""

import cv2
import numpy as np
import pytest

from sim.types import Frame
from tracking.evaluation.track_measures import turned_overlaps
from tracking.trackers import KINDS as TRACKERS
from tracking.trackers.frozen import Config as FrozenConfig
from tracking.trackers.pf_ssd import STEPS, Config
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


def config_of(kind):
    return TRACKERS.config_of(kind)


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
    ends = [track(c, frames)[-1].state for c in (Config(), FrozenConfig())]
    corners = np.stack([REGION.corners(state) for state in ends])
    ours, nothing = turned_overlaps(corners, np.stack([REGION.corners(path(29))] * 2))
    assert ours > 0.9
    assert nothing < 0.3
    assert track(FrozenConfig(), frames)[-1].status is Status.UNSURE  # nobody looked


def test_reports_its_work_and_its_cloud():
    estimate = track(Config(particles=50), [paint(FIRST, index=k) for k in range(2)])[0]
    assert estimate.particles.shape == (50, 5)
    assert estimate.particles[:, 4].sum() == pytest.approx(1.0)
    assert 51 <= estimate.evaluations <= 50 + STEPS
    assert 1 <= estimate.ess <= 50
    assert np.all(np.linalg.eigvalsh(estimate.covariance) >= -1e-12)


def hidden_drive(config):
    """A target that drives at 3 px a frame and is hidden from frame 15 on; the last estimates."""
    frames = [paint(State(60 + 3 * k, 80, 0.2), k >= 15, k) for k in range(21)]
    tracker = config.build(np.random.default_rng(0))
    tracker.start(frames[0], REGION, State(60, 80, 0.2))
    return [tracker.update(frame) for frame in frames[1:]]


def test_a_hidden_target_is_expected_to_drive_on():
    on, stays = (hidden_drive(Config(velocity_memory=m))[-1].state.x for m in (0.5, 1.0))
    assert on == pytest.approx(60 + 3 * 20, abs=8)
    assert stays < on - 8


def test_a_descent_is_trusted_only_near_the_filter():
    jump = [paint(State(100, 80, 0.2), index=0), paint(State(112, 80, 0.2), index=1)]
    bold, timid = (track(Config(trust=t, noise=0.01), jump)[0] for t in (1.0, 0.1))
    assert bold.state.x == pytest.approx(112, abs=1)
    assert timid.state.x < 105
    assert timid.distance == 1.0


def test_a_lost_target_is_looked_for_more_widely():
    frames = [paint(FIRST, k >= 10, k) for k in range(60)]
    estimates = track(Config(scatter=0.0), frames)
    assert estimates[38].status is Status.UNSURE
    narrow, wide = (np.std(estimates[k].particles[:, 0]) for k in (38, 58))
    assert wide > 1.5 * narrow


def test_a_lost_target_is_found_wherever_it_comes_out():
    """Hidden at one place for longer than the patience, then seen 75 px away."""
    away = State(175.0, 110.0, 0.2, 1.0)
    frames = [paint(FIRST, 10 <= k < 45, k) for k in range(45)]
    frames += [paint(away, index=k) for k in range(45, 65)]
    estimates = track(Config(), frames)
    for estimate in estimates[50:]:  # once found it stays found
        assert estimate.status is Status.LOCKED
        assert np.hypot(estimate.state.x - away.x, estimate.state.y - away.y) < 1.0
    x = estimates[43].particles[:, 0]
    assert np.std(x) > 0.7 * 240 / np.sqrt(12)  # strewn evenly over the picture, most of them
    assert np.std(estimates[50].particles[:, 0]) < 15


def test_the_cloud_moves_with_the_descent():
    frames = [paint(path(3 * k), index=k) for k in range(12)]
    estimate = track(Config(gamma=1e-3), frames)[-1]  # a filter that hardly looks
    truth = path(33)
    assert np.hypot(estimate.particles[:, 0].mean() - truth.x, estimate.state.y - truth.y) < 4.0


def test_kernels_leave_the_regions_rim_out():
    """A rim of background that changes its colour pulls at the descent, unless it is left out."""

    def with_rim(colour, k):
        image = paint(FIRST, index=k).image.copy()
        box = np.round(Region(64.0, 34.0).corners(FIRST)).astype(int)
        cv2.polylines(image, [box.reshape(-1, 1, 2)], True, colour, 3)
        return Frame(image, k / 30, k)

    frames = [with_rim((200, 200, 200), 0), *(with_rim((10, 90, 10), k) for k in range(1, 6))]
    inside, rim = (abs(np.log(track(Config(inset=i), frames)[-1].state.scale)) for i in (0.15, 0.0))
    assert inside < 0.02
    assert inside < rim


def test_what_is_not_believed_is_not_the_estimate():
    """Never LOCKED, the estimate is the filter's mean, wherever the descent ended."""
    frames = [paint(path(k), k > 0, k) for k in range(16)]
    for estimate in track(Config(occluded=1.0), frames):
        mean = estimate.particles[:, 4] @ estimate.particles[:, :2]
        np.testing.assert_allclose((estimate.state.x, estimate.state.y), mean, atol=1e-9)
        assert estimate.status is not Status.LOCKED


@pytest.mark.parametrize("kind", ["condensation", "mk_pf"])
def test_every_filter_strews_its_particles_while_the_target_is_lost(kind):
    frames = [paint(FIRST, k >= 10, k) for k in range(46)]
    near = {"noise": 0.02, "gamma": 1e-6, "contrast": 0.0}
    ends = [track(config_of(kind)(scatter=s, **near), frames) for s in (0.7, 0.0)]
    wide, narrow = (np.std(end[-1].particles[:, 0]) for end in ends)
    assert ends[0][-1].status is Status.LOST
    assert wide > 0.7 * 240 / np.sqrt(12)
    assert narrow < 30


@pytest.mark.parametrize("kind", ["condensation", "kams", "mean_shift", "mk_pf", "mk_ssd"])
def test_every_tracker_of_colours_may_see_them_evenly_lit(kind):
    """The light falls to 60 %: every bin changes, except where colours are compared evenly lit."""
    frames = [paint(FIRST, index=k) for k in range(4)]
    dim = [Frame((f.image * 0.6).astype(np.uint8), 0.2, 4) for f in frames[:1]]
    config = config_of(kind)
    even, plain = (track(config(even=e), frames + dim)[-1].distance for e in (True, False))
    assert even < 0.5
    assert plain > even + 0.2


@pytest.mark.parametrize("settings", [{}, {"turn_noise": 0.0}])
def test_the_angle_of_a_disc_stays(settings):
    def disc(x):
        rows, columns = np.mgrid[0:160, 0:240] + 0.5
        image = np.full((160, 240, 3), 120.0)
        image[np.hypot(columns - x, rows - 80) < 20] = (200, 40, 30)
        return image.astype(np.uint8)

    tracker = Config(**settings).build(np.random.default_rng(0))
    tracker.start(Frame(disc(100.0), 0.0, 0), Region(44.0, 44.0), State(100.0, 80.0))
    angles = [tracker.update(Frame(disc(100 + i / 2), i / 30, i)).state.theta for i in range(1, 40)]
    assert np.abs(angles).max() < 1e-12
