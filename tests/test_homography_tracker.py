"""The homography tracker on a rendered plate in six degrees of freedom, and its loops."""

import cv2
import numpy as np
import pytest
from tilted import Scene, placed, rms, tilted

from sim.targets import plate
from sim.types import Frame
from tracking import create
from tracking.loops import plane_alignment
from tracking.trackers._plane import SQUARE, homography, through
from tracking.types import Region, State, Status


@pytest.fixture(scope="module")
def scene():
    made = Scene(plate.Config())
    yield made
    made.close()


def swing(time):
    """0.1 to 0.2 m/s across, +-30 deg at 0.2 Hz about an axis that turns, 25 deg/s in the plane."""
    place = [0.12 * np.sin(1.25 * time), 0.08 * np.sin(1.6 * time), 0.8 + 0.1 * np.sin(0.9 * time)]
    return tilted(30 * np.sin(0.4 * np.pi * time), 60 + 20 * time, 25 * time, place)


def follow(scene, count, changed=lambda image, k, corners: image, begin=0.0):
    """Corner rms [px] and estimates of a swing at 30 Hz, in pictures that are changed."""
    tracker, errors, estimates = create("homography"), [], []
    for k in range(count + 1):
        frame, corners = scene.show(swing(begin + k / 30) if k else tilted(0, 0, 0, (0, 0, 0.8)))
        frame = Frame(changed(frame.image.copy(), k, corners), k / 30, k)
        if k == 0:
            tracker.start(frame, *placed(corners))
            continue
        estimates.append(tracker.update(frame))
        errors.append(rms(estimates[-1].corners, corners))
    return np.array(errors), estimates


def test_corners_follow_six_degrees_of_freedom(scene):
    errors, estimates = follow(scene, 75)
    assert all(e.status is Status.LOCKED for e in estimates)
    assert np.sqrt(np.mean(errors**2)) < 0.2
    assert errors.max() < 0.4
    truth = scene.world.truth()
    state = estimates[-1].state
    np.testing.assert_allclose([state.x, state.y], truth.centre, atol=0.3)
    assert abs(np.exp(1j * state.theta) - np.exp(1j * truth.theta)) < 0.01


def test_light_and_a_hidden_part_do_not_move_it(scene):
    def spoiled(image, k, corners):
        image = (image * (0.6 + 0.4 * np.cos(k / 8)) + 10).astype(np.uint8)
        if k > 5:
            (left, top), (right, bottom) = corners.min(axis=0), corners.max(axis=0)
            width = 0.25 * (right - left)
            image[int(top) : int(bottom), int(left) : int(left + width)] = (30, 160, 40)
        return image

    errors, estimates = follow(scene, 40, spoiled)
    assert all(e.status is Status.LOCKED for e in estimates)
    assert errors.max() < 0.8


@pytest.mark.wide
@pytest.mark.parametrize(
    ("hidden", "paint"),
    [((0, 0, 1, 0.3), 110), ((0, 0, 0.3, 1), 30), ((0, 0, 0.55, 0.55), 90), ((0.7, 0, 1, 1), None)],
)
def test_with_three_tenths_hidden_corners_are_right_while_it_is_locked(scene, hidden, paint):
    """Corners were up to 11 px off: points that are alike by chance pulled them away."""
    left, top, right, bottom = hidden
    part = np.array([[left, top], [right, top], [right, bottom], [left, bottom]]) - 0.5
    cover = np.random.default_rng(0).integers(0, 256, (60, 80, 3)).astype(np.uint8)
    cover = cv2.resize(cover, (640, 480)) if paint is None else np.full((480, 640, 3), paint)

    def covered(image, k, corners):
        if k > 5:
            mask = np.zeros((480, 640), np.uint8)
            found = through(homography(SQUARE, corners), part)
            cv2.fillPoly(mask, [np.round(16 * found - 8).astype(np.int32)], 255, shift=4)
            image[mask > 0] = cover[mask > 0]
        return image

    errors, estimates = follow(scene, 45, covered)
    locked = [e.status is Status.LOCKED for e in estimates]
    assert np.mean(locked) > 0.8
    assert errors[locked].max() < 2.0


def test_a_target_that_is_gone_is_lost_and_found_again_where_it_was(scene):
    rng = np.random.default_rng(3)
    ground = cv2.GaussianBlur(rng.integers(60, 140, (480, 640, 3)).astype(np.uint8), (0, 0), 2)
    errors, estimates = follow(scene, 45, lambda image, k, _: ground if 5 < k < 25 else image)
    statuses = [e.status for e in estimates]
    assert Status.LOCKED not in statuses[5:24]
    assert Status.LOCKED in statuses[24:35]
    found = statuses.index(Status.LOCKED, 24)
    assert all(s is Status.LOCKED for s in statuses[found:])
    assert errors[found:].max() < 0.5


@pytest.mark.parametrize(("contrast", "status"), [(2, Status.LOST), (40, Status.LOCKED)])
def test_a_target_without_texture_is_never_locked(contrast, status):
    """It was LOCKED on the plate's rim, with corners 8 px off."""
    grey = np.random.default_rng(0).normal(120, contrast, (24, 32, 1))
    image = cv2.resize(np.repeat(grey, 3, axis=2), (320, 240)).clip(0, 255).astype(np.uint8)
    image[:72, :] = image[:, :102] = 0
    tracker = create("homography")
    tracker.start(Frame(image, 0.0, 0), Region(120, 100), State(160, 120, 0.0))
    assert [tracker.update(Frame(image, k * 1.0, k)).status for k in (1, 2, 3)][-1] is status


def test_told_how_the_camera_turned_it_follows_a_jump(scene):
    tracker = create("homography")
    frame, corners = scene.show(tilted(0, 0, 0, (0, 0, 0.8)))
    tracker.start(frame, *placed(corners))
    centre = corners.mean(axis=0)
    frame, corners = scene.show(tilted(5, 0, 40, (0.1, 0, 0.7)))
    change = np.array([*(corners.mean(axis=0) - centre), np.radians(40), np.log(0.8 / 0.7)])
    found = tracker.update(frame, change)
    assert found.status is Status.LOCKED
    assert rms(found.corners, corners) < 0.4


RNG = np.random.default_rng(0)


def sample_twin(image, H, points):
    seen = np.column_stack([points, np.ones(len(points))]) @ H.T
    u, v = (seen[:, :2] / seen[:, 2:] - 0.5).T
    inside = (u >= 0) & (v >= 0) & (u < image.shape[1] - 1) & (v < image.shape[0] - 1)
    j, k = np.where(inside, u, 0).astype(int), np.where(inside, v, 0).astype(int)
    a, b = u - j, v - k
    top = (1 - a) * image[k, j] + a * image[k, j + 1]
    bottom = (1 - a) * image[k + 1, j] + a * image[k + 1, j + 1]
    return np.where(inside, (1 - b) * top + b * bottom, np.nan)


def test_samples_lie_between_pixels_and_outside_are_none():
    image = RNG.uniform(0, 255, (20, 30)).astype(np.float32)
    H = np.array([[25.0, 3.0, 15.0], [-2.0, 22.0, 10.0], [0.1, -0.2, 1.0]])
    points = RNG.uniform(-0.7, 0.7, (200, 2))
    found = plane_alignment.sample(image, H, points)
    assert 20 < np.isnan(found).sum() < 180
    np.testing.assert_allclose(found, sample_twin(image, H, points), rtol=1e-6)


@pytest.mark.parametrize("count", [2, 3, 12, 901])
def test_the_deviation_is_of_the_quantile_of_numpy(count):
    for decimals in (0, 12):  # many errors of the same size, or none
        for _ in range(30):
            error = np.append(np.round(RNG.normal(0, 9, count), decimals), np.nan)
            RNG.shuffle(error)
            quantile = np.nanquantile(np.abs(error), 0.35)
            expected = max(quantile / 0.4538, 1.0)
            assert plane_alignment.sigma_of(error) == pytest.approx(expected, rel=1e-14)


def test_weights_and_equations_are_those_of_plain_numpy():
    rows, template = RNG.normal(size=(50, 8)), RNG.uniform(0, 255, 50)
    error = np.append(RNG.normal(0, 5, 48), [400.0, np.nan])
    sigma = plane_alignment.sigma_of(error)
    assert sigma == pytest.approx(np.nanquantile(np.abs(error), 0.35) / 0.4538)
    limit = 4.685 * sigma
    bounded = np.nan_to_num(np.minimum(np.abs(error) / limit, 1), nan=1.0)
    weights = plane_alignment.tukey(error, sigma)
    np.testing.assert_allclose(weights, (1 - bounded**2) ** 2, rtol=1e-12)
    cells = np.arange(50) // 10
    mean = weights.reshape(5, 10).mean(axis=1)
    trusted = np.clip((mean - 0.3) / 0.3, 0, 1)[cells]
    np.testing.assert_allclose(plane_alignment.agreed(weights, cells), weights * trusted)
    A, g = plane_alignment.normal_equations(error, weights, rows, template, 1.3)
    J = np.column_stack([1.3 * rows, template, np.ones(50)])
    expected = J.T @ (weights[:, None] * J)
    np.testing.assert_allclose(A, expected + 1e-6 * np.eye(10), rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(g, J.T @ (weights * np.nan_to_num(error)), rtol=1e-9)
    seen = 1.5 * template + RNG.normal(0, 30, 50)
    cov = np.cov(seen, template, aweights=weights, ddof=0)
    share = min(1.0, weights.sum() / (0.8 * 50))
    expected = cov[0, 1] / np.sqrt(cov[0, 0] * cov[1, 1]) * share
    assert plane_alignment.correlation(seen, template, weights) == pytest.approx(expected, rel=1e-9)


def test_a_step_moves_the_picture_back():
    rng = np.random.default_rng(0)
    H = np.diag([50.0, 40.0, 1.0]) + rng.normal(size=(3, 3))
    d = rng.normal(0.0, 0.1, 10)
    step = np.array([[1 + d[0], d[1], d[2]], [d[3], 1 + d[4], d[5]], [d[6], d[7], 1.0]])
    wanted = H @ np.linalg.inv(step)
    found = plane_alignment.moved_back(H, d)
    np.testing.assert_allclose(found, wanted / wanted[2, 2], rtol=1e-12, atol=1e-12)
