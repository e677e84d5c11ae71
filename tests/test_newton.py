import cv2
import numpy as np
import pytest

from sim.types import Frame
from tracking.loops import descent as loops
from tracking.search.newton import UNITS, KernelGrid, KernelModel
from tracking.types import Region, State

REGION, TRUE = Region(60.0, 40.0), State(80.0, 60.0, 0.3, 1.0)


def target_image(state=TRUE, seed=2, size=(160, 120), blur=5):
    """A smooth random texture, moved by a state: exact truth for every parameter."""
    rng = np.random.default_rng(seed)
    texture = cv2.GaussianBlur(rng.normal(0, 1, (200, 260, 3)), (0, 0), blur)
    texture = np.clip(128 + 60 * texture / texture.std(), 0, 255).astype(np.uint8)
    c, s = state.scale * np.cos(state.theta), state.scale * np.sin(state.theta)
    A = np.array([[c, -s], [s, c]])
    offset = np.array([state.x, state.y]) - A @ [130.0, 100.0] - 0.5 + A @ [0.5, 0.5]
    warp = np.column_stack([A, offset])
    image = cv2.warpAffine(texture, warp, size, flags=cv2.INTER_LINEAR)
    return Frame(image, 0.0, 0).image


def linearise(model, image, x):
    """The objective, half its gradient and half its curvature at x."""
    stride = loops.stride_for(x, model.kernels)
    return loops.linearise(image, x, model.kernels, model.root_reference, stride)


def histograms(image):
    kernels = KernelModel(image, REGION, TRUE, KernelGrid()).kernels
    return loops.histograms(image, TRUE.vector, kernels, 1)


@pytest.mark.parametrize("grown", [1.0, 4.0])
def test_gradient_is_half_the_derivative_of_the_objective(grown):
    """Of the larger target only every fourth pixel is read."""
    true = State(grown * TRUE.x, grown * TRUE.y, TRUE.theta, grown)
    image = target_image(true, size=(640, 480))
    model, x = KernelModel(image, REGION, true, KernelGrid()), true.vector + [2.0, -1.0, 0.05, 0.03]
    assert loops.stride_for(x, model.kernels) == (1 if grown == 1 else 4)
    gradient, h = linearise(model, image, x)[1], 1e-5
    for p in range(4):
        d = h * np.eye(4)[p]
        rise = (linearise(model, image, x + d)[0] - linearise(model, image, x - d)[0]) / (2 * h)
        assert 2 * gradient[p] == pytest.approx(rise, rel=1e-3, abs=1e-8)


def test_derivatives_of_a_normalised_histogram_sum_to_zero():
    image = target_image()
    sums, totals = histograms(image)
    q = sums[:, :, 0] / totals[:, :1]
    dq = (sums[:, :, 1:] - q[:, :, None] * totals[:, None, 1:]) / totals[:, :1, None]
    np.testing.assert_allclose(dq.sum(axis=1), 0.0, atol=1e-12)


def test_without_the_normalisers_derivative_the_scale_column_is_mostly_wrong():
    image = target_image()
    sums, totals = histograms(image)
    q = sums[:, :, 0] / totals[:, :1]
    full = (sums[:, :, 1:] - q[:, :, None] * totals[:, None, 1:]) / totals[:, :1, None]
    naive = sums[:, :, 1:] / totals[:, :1, None]
    error = np.linalg.norm(naive - full, axis=(0, 1)) / np.linalg.norm(full, axis=(0, 1))
    assert error[3] > 0.7
    assert error[2] < 0.1


def test_the_objective_is_zero_at_the_true_state():
    image = target_image()
    assert linearise(KernelModel(image, REGION, TRUE, KernelGrid()), image, TRUE.vector)[0] < 1e-20


@pytest.mark.parametrize("span", [1.0, 1.5])
@pytest.mark.parametrize(("offset", "least"), [(3.0, 12), (10.0, 12), (15.0, 11)])
def test_basin_of_attraction(span, offset, least):
    """Success: centre < 2 px, angle < 3 deg, scale < 5 %, of 12 directions of displacement."""
    image, rng = target_image(), np.random.default_rng(4)
    model, found = KernelModel(image, REGION, TRUE, KernelGrid(span=span)), 0
    for direction in rng.normal(size=(12, 4)):
        direction[:2] /= np.linalg.norm(direction[:2])
        start = TRUE.vector + direction.clip(-1, 1) * offset * [1, 1, 1 / 60, 1 / 80]
        end = model.descend(image, State.of(start), most=20).state.vector - TRUE.vector
        found += bool(np.hypot(*end[:2]) < 2 and abs(end[2]) < 0.05 and abs(end[3]) < 0.05)
    assert found >= least


def test_a_descent_ends_at_the_moved_target_to_a_tenth_of_a_pixel():
    moved = State(83.0, 57.5, 0.42, 1.06)
    model = KernelModel(target_image(), REGION, TRUE, KernelGrid())
    refined = model.descend(target_image(moved), TRUE, most=20, tolerance=0.01)
    error = np.abs(refined.state.vector - moved.vector)
    assert error[:2].max() < 0.1
    assert error[2] < np.radians(0.3)
    assert error[3] < 0.003
    assert refined.evaluations <= 8


@pytest.mark.parametrize(("grown", "blur"), [(3.0, 3.0), (4.0, 5.0), (6.0, 5.0)])
def test_a_descent_is_exact_for_large_targets_of_which_few_pixels_are_read(grown, blur):
    """The rim of the template is as wide as the distance of the pixels that are read."""
    true = State(320.0, 240.0, TRUE.theta, grown)
    pictures = {"size": (640, 480), "blur": blur}
    model = KernelModel(target_image(true, **pictures), REGION, true, KernelGrid())
    rng = np.random.default_rng(5)
    errors, evaluations = [], []
    for _ in range(20):
        moved = State.of(true.vector + rng.normal(size=4) * [3.0, 3.0, 0.05, 0.03])
        found = model.descend(target_image(moved, **pictures), true, most=20, tolerance=0.01)
        errors.append(np.hypot(*(found.state.vector - moved.vector)[:2]))
        evaluations.append(found.evaluations)
    assert np.percentile(errors, 90) < 0.1
    assert np.mean(evaluations) < 5


def test_one_round_kernel_cannot_see_rotation_and_nine_can():
    region = Region(40.0, 40.0)
    image = target_image()
    one = linearise(KernelModel(image, region, TRUE, KernelGrid(1, 0.5)), image, TRUE.vector)
    nine = linearise(KernelModel(image, region, TRUE, KernelGrid()), image, TRUE.vector)
    smallest = [np.linalg.eigvalsh(m[2] * np.outer(UNITS, UNITS))[0] for m in (one, nine)]
    assert smallest[1] > 1e-5
    assert smallest[0] < 1e-3 * smallest[1]


def test_a_hopeless_start_is_left_alone_after_one_look():
    image = target_image()
    far = State(30.0, 30.0, 2.0, 1.0)
    refined = KernelModel(image, REGION, TRUE, KernelGrid()).descend(
        image, far, most=8, hopeless=0.1
    )
    assert refined.state == far
    assert refined.evaluations == 1
    assert refined.distance > 0.1


def test_a_step_never_makes_the_objective_worse():
    image = target_image()
    model = KernelModel(image, REGION, TRUE, KernelGrid())
    for x in TRUE.vector + np.random.default_rng(1).normal(0, [12, 12, 0.3, 0.2], (20, 4)):
        before = np.sqrt(linearise(model, image, x)[0] / 2)
        assert model.descend(image, State.of(x), most=6).distance <= before


def test_a_large_target_is_read_at_fewer_pixels():
    """A template of 120 x 80 px has 9,600: with at most 2,000 every second row and column is read."""
    image, large = target_image(), Region(120.0, 80.0)
    model = KernelModel(image, large, TRUE, KernelGrid())
    every, some = (
        loops.kernel_histograms(
            image, TRUE.vector, (60.0, 40.0), np.zeros((1, 2)), (40.0, 80 / 3), 8, stride
        )[1]
        for stride in (1, 2)
    )
    assert some[0, 0] == pytest.approx(every[0, 0] / 4, rel=0.02)
    assert loops.stride_for(TRUE.vector, model.kernels) == 2
    _, totals = loops.histograms(image, TRUE.vector, model.kernels, 2)
    assert totals[4, 0] == pytest.approx(some[0, 0], rel=1e-12)
    assert loops.FLOOR == 1e-3
