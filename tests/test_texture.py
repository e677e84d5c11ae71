import numpy as np
import pytest

from tracking.appearance.bins import ColourBins, Window
from tracking.appearance.local_patterns import TextureBins, ones_of, texture_or_colour
from tracking.types import Region, State

EVERYWHERE = Window(0, 0, 40, 30)


def patch(*rows):
    return np.array(rows, np.float32)


@pytest.mark.parametrize(
    ("grey", "ones"),
    [
        (patch([9, 9, 9], [9, 9, 9], [9, 9, 9]), 0),
        (patch([90, 90, 90], [90, 9, 90], [90, 90, 90]), 8),
        (patch([90, 90, 90], [9, 9, 9], [9, 9, 9]), 3),
        (patch([9, 90, 9], [9, 9, 9], [9, 90, 9]), -1),
        (patch([9, 9, 9], [9, 9, 90], [9, 9, 9]), 1),
    ],
)
def test_ones_of_uniform_patterns(grey, ones):
    # Diagonal neighbours lie at radius 1: half of them is the corner pixel, the rest the sides.
    assert ones_of(grey, threshold=45.0 if ones == 1 else 8.0)[0, 0] == ones


def test_a_turned_edge_keeps_its_number_of_ones():
    rows, columns = np.mgrid[0:21, 0:21] - 10
    for angle in np.linspace(0, 2 * np.pi, 12, endpoint=False):
        edge = np.where(columns * np.cos(angle) + rows * np.sin(angle) > 0.2, 200, 20)
        assert 2 <= ones_of(edge.astype(np.float32))[9, 9] <= 5


def test_flat_and_noisy_areas_are_in_no_bin():
    rng = np.random.default_rng(0)
    noisy = np.clip(rng.normal(128, 2, (30, 40, 3)), 0, 255).astype(np.uint8)
    assert np.mean(TextureBins().label(noisy, EVERYWHERE) >= 0) < 0.01
    rough = np.clip(rng.normal(128, 30, (30, 40, 3)), 0, 255).astype(np.uint8)
    assert np.mean(TextureBins().label(rough, EVERYWHERE) >= 0) > 0.15


def test_labels_join_colour_and_texture():
    rng = np.random.default_rng(1)
    image = rng.integers(0, 256, (30, 40, 3)).astype(np.uint8)
    labels, colours = (b.label(image, EVERYWHERE) for b in (TextureBins(), ColourBins()))
    assert labels.max() < TextureBins().count == 8**3 * 5
    kept = labels >= 0
    np.testing.assert_array_equal(labels[kept] // 5, colours[kept])


def test_a_window_sees_what_the_whole_image_sees():
    image = np.random.default_rng(2).integers(0, 256, (30, 40, 3)).astype(np.uint8)
    window = Window(7, 5, 22, 30)
    whole = TextureBins().label(image, EVERYWHERE)
    np.testing.assert_array_equal(TextureBins().label(image, window), whole[5:30, 7:22])


def test_a_smooth_target_is_counted_by_colour_alone():
    where = (Region(40.0, 30.0), State(20.0, 15.0))
    smooth = np.full((30, 40, 3), 90, np.uint8)
    assert texture_or_colour(smooth, *where, TextureBins(), 0.05) == ColourBins(8)
    rough = np.random.default_rng(3).integers(0, 256, (30, 40, 3)).astype(np.uint8)
    assert texture_or_colour(rough, *where, TextureBins(8, 8.0), 0.05) == TextureBins(8, 8.0)
    assert texture_or_colour(rough, *where, TextureBins(), 0.99) == ColourBins(8)
