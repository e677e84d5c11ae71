import numpy as np
import pytest

from tracking.appearance.cells import CellModel, grid, histograms, ring
from tracking.appearance.colour import ColourBins, Window
from tracking.types import Region, State

REGION, TRUE = Region(42.0, 24.0), State(80.0, 60.0, 0.3, 1.0)


def model(image, **changes):
    settings = {"per_side": 3, "density": 5, "contrast": 0.0, "ring_width": 0.4} | changes
    return CellModel(image, REGION, TRUE, ColourBins(), **settings)


def test_bins_are_the_leading_bits_of_red_green_blue():
    image = np.array([[[0, 0, 0], [255, 0, 0], [0, 64, 31], [33, 255, 255]]], np.uint8)
    labels = ColourBins(8).label(image, Window(0, 0, 4, 1))
    np.testing.assert_array_equal(labels, [[0, 7 * 64, 2 * 8 + 0, 64 + 7 * 8 + 7]])


def test_a_number_of_bins_that_is_no_power_of_two_is_refused():
    with pytest.raises(ValueError, match="levels must be 2, 4, 8, 16 or 32, not 7"):
        ColourBins(7)


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
    parts = histograms(smooth_image, ColourBins(), grid(REGION, 3, 5), TRUE)
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
    distances, _ = cells.distances(smooth_image, states)
    assert distances.argmin() == 0
    assert distances[0] < 0.3  # 25 points a cell against 400 in the reference: not 0


def test_distance_is_the_root_mean_over_the_parts(smooth_image):
    cells, state = model(smooth_image), State(83.0, 61.0, 0.3, 1.0)
    reference = histograms(smooth_image, ColourBins(), grid(REGION, 3, 20), TRUE)
    seen = histograms(smooth_image, ColourBins(), grid(REGION, 3, 5), state)
    rho = np.sqrt(reference * seen).sum(axis=1)
    distances, _ = cells.distances(smooth_image, state.vector[None])
    assert distances[0] == pytest.approx(np.sqrt(1 - rho.mean()), rel=1e-12)


def test_what_lies_off_the_image_does_not_look_like_the_target(smooth_image):
    distances, _ = model(smooth_image).distances(smooth_image, np.array([[-80.0, -80.0, 0.0, 0.0]]))
    assert distances[0] == 1.0


def test_contrast_makes_a_shrunken_box_worse():
    image = np.full((120, 160, 3), 200, np.uint8)
    image[40:80, 50:110] = (20, 40, 200)
    region, true = Region(60.0, 40.0), State(80.0, 60.0)
    small = np.array([true.vector, true.vector + [0, 0, 0, -0.2]])
    energies = [
        CellModel(
            image, region, true, ColourBins(), per_side=3, density=5, contrast=c, ring_width=0.4
        ).energy(image, small)
        for c in (0.0, 0.5)
    ]
    # A uniform target's histogram does not see that the box shrank into it; its ring does.
    assert energies[0][1] - energies[0][0] == pytest.approx(0.0, abs=1e-3)
    assert energies[1][1] - energies[1][0] > 0.2


def test_every_state_counts_as_an_evaluation(smooth_image):
    cells = model(smooth_image)
    cells.distances(smooth_image, np.tile(TRUE.vector, (7, 1)))
    assert cells.evaluations == 7
