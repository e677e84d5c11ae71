import numpy as np
import pytest

from tracking.appearance.bins import ColourBins, LabelledImage, Window
from tracking.appearance.layout import Sampling, disc, grid, histograms, ring
from tracking.appearance.model import AppearanceSettings
from tracking.settings import PLAIN
from tracking.trackers import KINDS as TRACKERS
from tracking.types import Region, State

REGION, TRUE = Region(42.0, 24.0), State(80.0, 60.0, 0.3, 1.0)


def model_of(image, sampling, region=REGION, state=TRUE, **changes):
    class Sampled(AppearanceSettings):
        pass

    Sampled.sampling = sampling
    return Sampled(**PLAIN | changes).model(image, region, state)


def model(image, **changes):
    return model_of(image, Sampling(5, cells=3), **changes)


def test_bins_are_the_leading_bits_of_red_green_blue():
    image = np.array([[[0, 0, 0], [255, 0, 0], [0, 64, 31], [33, 255, 255]]], np.uint8)
    labels = ColourBins(8).label(image, Window(0, 0, 4, 1))
    np.testing.assert_array_equal(labels, [[0, 7 * 64, 2 * 8 + 0, 64 + 7 * 8 + 7]])


def test_grid_has_equal_parts_that_fill_the_template():
    layout = grid(REGION, 3, 5)
    assert np.bincount(layout.parts).tolist() == [25] * 9
    np.testing.assert_allclose(layout.points.mean(axis=0), [0, 0], atol=1e-12)
    assert np.abs(layout.points).max(axis=0) == pytest.approx([42 / 2 - 1.4, 24 / 2 - 0.8])
    assert layout.parts[0] == 0
    assert np.all(layout.points[layout.parts == 5, 0] > 7)  # row 1, column 2: right of the middle


def test_ring_lies_around_the_template():
    layout = ring(REGION, 0.4, 20)
    inside = (np.abs(layout.points[:, 0]) <= 21) & (np.abs(layout.points[:, 1]) <= 12)
    assert not inside.any()
    assert np.abs(layout.points[:, 0]).max() < 21 * 1.4


def test_histograms_sum_to_one(smooth_image):
    parts = histograms(LabelledImage(smooth_image, ColourBins()), grid(REGION, 3, 5), TRUE)
    np.testing.assert_allclose(parts.sum(axis=1), np.ones(9), rtol=1e-12)


def test_distance_is_least_at_the_true_state(smooth_image):
    cells = model(smooth_image)
    away = [
        (0, 0, 0, 0),
        (3, 0, 0, 0),
        (0, -3, 0, 0),
        (0, 0, 0.2, 0),
        (0, 0, 0, 0.15),
        (0, 0, 0, -0.15),
    ]
    states = TRUE.vector + np.array(away)
    distances = cells.distances(cells.label(smooth_image), states)
    assert distances.argmin() == 0
    assert distances[0] < 0.3  # 25 points a cell against 400 in the reference: not 0


def test_distance_is_the_root_mean_over_the_parts(smooth_image):
    cells, state = model(smooth_image), State(83.0, 61.0, 0.3, 1.0)
    reference = histograms(LabelledImage(smooth_image, ColourBins()), grid(REGION, 3, 20), TRUE)
    seen = histograms(LabelledImage(smooth_image, ColourBins()), grid(REGION, 3, 5), state)
    rho = np.sqrt(reference * seen).sum(axis=1)
    distances = cells.distances(cells.label(smooth_image), state.vector[None])
    assert distances[0] == pytest.approx(np.sqrt(1 - rho.mean()), rel=1e-12)


def test_what_lies_off_the_image_does_not_look_like_the_target(smooth_image):
    cells = model(smooth_image)
    distances = cells.distances(cells.label(smooth_image), np.array([[-80.0, -80.0, 0.0, 0.0]]))
    assert distances[0] == 1.0


def test_contrast_makes_a_shrunken_box_worse():
    image = np.full((120, 160, 3), 200, np.uint8)
    image[40:80, 50:110] = (20, 40, 200)
    region, true = Region(60.0, 40.0), State(80.0, 60.0)
    small = np.array([true.vector, true.vector + [0, 0, 0, -0.2]])
    models = [model_of(image, Sampling(5, cells=3), region, true, contrast=c) for c in (0.0, 0.5)]
    energies = [cells.energy(cells.label(image), small) for cells in models]
    # A uniform target's histogram does not see that the box shrank into it; its ring does.
    assert energies[0][1] - energies[0][0] == pytest.approx(0.0, abs=1e-3)
    assert energies[1][1] - energies[1][0] > 0.2


def test_disc_has_an_epanechnikov_kernel_that_sums_to_one():
    layout = disc(REGION, 30)
    r2 = (layout.points[:, 0] / 21) ** 2 + (layout.points[:, 1] / 12) ** 2
    assert layout.weights.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(layout.weights / layout.weights.max(), (1 - r2) / (1 - r2).max())


def test_mean_shift_climbs_to_the_target_and_never_down(smooth_image):
    model = model_of(smooth_image, Sampling(24))
    starts = TRUE.vector + np.array([(4, 0, 0, 0), (-3, 3, 0, 0), (0, -4, 0, 0)])
    image = model.label(smooth_image)
    ends, distances, evaluations = model.climb(image, starts, most=30, tolerance=0.05, reach=20.0)
    assert np.all(distances <= model.distances(image, starts))
    # The likeness of hard bins is flat to about a pixel around its mode.
    np.testing.assert_allclose(ends[:, :2], [[80, 60]] * 3, atol=1.5)
    np.testing.assert_array_equal(ends[:, 2:], starts[:, 2:])
    assert 3 * 2 <= evaluations <= 3 * 30


@pytest.mark.parametrize("kernel", ["epanechnikov", "linear"])
def test_a_mean_shift_step_points_up_the_coefficient_of_its_kernel(kernel):
    """Under a cone with the pull of a cone; with all points pulling alike it is 16 degrees off."""
    rng = np.random.default_rng(4)
    labels = np.clip(rng.normal(128, 60, (40, 40, 3)), 0, 255).astype(np.uint8)
    image = np.kron(labels, np.ones((6, 6, 1), np.uint8))
    region, true = Region(80.0, 60.0), State(120.0, 110.0)
    model = model_of(image, Sampling(160, kernel=kernel), region, true, levels=2)
    picture, state = model.label(image), true.vector + [7.0, -5.0, 0, 0]
    ends, _, _ = model.climb(picture, state[None], most=2, tolerance=0.0, reach=40.0)
    h = 1.5
    sides = state + h * np.array([(1, 0, 0, 0), (-1, 0, 0, 0), (0, 1, 0, 0), (0, -1, 0, 0)])
    squared = model.distances(picture, sides) ** 2
    slope = np.array([squared[1] - squared[0], squared[3] - squared[2]]) / (2 * h)
    scaled = slope * np.array([region.width, region.height]) ** 2  # a step in template units
    step = (ends[0] - state)[:2]
    assert step @ scaled / np.linalg.norm(step) / np.linalg.norm(scaled) > 0.98


def test_summed_parts_are_the_mean_with_so_many_times_gamma(smooth_image):
    states = TRUE.vector + np.array([(0, 0, 0, 0), (4, 2, 0.1, 0)])
    mean, total = (
        model_of(smooth_image, Sampling(5, 3, combine=combine), levels=10, contrast=0.5)
        for combine in ("mean", "sum")
    )
    image = mean.label(smooth_image)
    np.testing.assert_allclose(total.energy(image, states), 9 * mean.energy(image, states))
    np.testing.assert_array_equal(total.distances(image, states), mean.distances(image, states))


def test_one_mean_shift_step_is_the_weighted_mean(smooth_image):
    layout, state = disc(REGION, 24), State(83.0, 61.0, 0.3, 1.0)
    q = histograms(LabelledImage(smooth_image, ColourBins()), disc(REGION, 96), TRUE)[0]
    p = histograms(LabelledImage(smooth_image, ColourBins()), layout, state)[0]
    c, s = np.cos(0.3), np.sin(0.3)
    at = layout.points @ np.array([[c, s], [-s, c]]) + (83.0, 61.0)
    labels = ColourBins().label(smooth_image, Window(0, 0, 160, 120))
    seen = labels[at[:, 1].astype(int), at[:, 0].astype(int)]
    w = np.sqrt(q[seen] / p[seen])
    model = model_of(smooth_image, Sampling(24))
    image = model.label(smooth_image)
    ends, _, _ = model.climb(image, state.vector[None], most=2, tolerance=0.0, reach=20.0)
    np.testing.assert_allclose(ends[0, :2], w @ at / w.sum(), atol=1e-9)


def test_weighting_target_and_candidate_alike_leaves_the_step_as_it_is():
    """Background weights on both histograms cancel in sqrt(q/p) (Ning, Zhang, Zhang, Wu 2012)."""
    rng = np.random.default_rng(0)
    q, p, v = rng.dirichlet(np.ones(20)), rng.dirichlet(np.ones(20)), rng.random(20)
    plain = np.sqrt(q / p)
    weighted = np.sqrt((v * q / (v * q).sum()) / (v * p / (v * p).sum()))
    np.testing.assert_allclose(weighted / plain, (weighted / plain)[0])


class Counting:
    """Colour bins that remember what they were asked to label."""

    def __init__(self):
        self.windows = []

    @property
    def count(self):
        return ColourBins().count

    def label(self, image, window):
        self.windows.append(window)
        return ColourBins().label(image, window)


def test_a_picture_is_labelled_once_and_only_where_needed(smooth_image):
    bins = Counting()
    picture = LabelledImage(smooth_image, bins, farthest=30.0)
    near, far = TRUE.vector[None], TRUE.vector[None] + [40.0, 0, 0, 0]
    labels, left, top = picture.around(near, 20.0)
    assert len(bins.windows) == 1
    assert labels.shape[1] >= 60  # as far as was said to be needed later
    again, _, _ = picture.around(near, 30.0)
    assert again is labels
    picture.around(far, 20.0)
    assert len(bins.windows) == 2
    whole = ColourBins().label(smooth_image, Window(0, 0, 160, 120))
    height, width = labels.shape
    np.testing.assert_array_equal(labels, whole[top : top + height, left : left + width])


@pytest.mark.parametrize("kind", ["mk_pf", "kernel_pf", "kams", "mean_shift", "texture_pf"])
def test_what_the_inset_leaves_out_changes_nothing(kind):
    """A rim of 4 px is the background, which turns from black to white."""
    state, (dark, bright) = State(80.0, 60.0, 0.0, 1.0), np.zeros((2, 120, 160, 3), np.uint8)
    bright[:] = 255
    for picture in (dark, bright):
        picture[52:68, 63:97] = np.random.default_rng(0).integers(30, 220, (16, 34, 3))
    config = TRACKERS.config_of(kind)
    for inset in (0.0, 0.4):
        seen = config(inset=inset, learn=False).model(dark, REGION, state)
        before, after = (
            seen.distances(seen.label(p), state.vector[None])[0] for p in (dark, bright)
        )
        assert after == before if inset else after > before + 0.03
