import numpy as np
import pytest

from tracking.appearance.bins import ColourBins, Window
from tracking.appearance.layout import Sampling
from tracking.appearance.local_patterns import TextureBins, TextureSettings, ones_of, riu2
from tracking.settings import PLAIN
from tracking.types import Region, State


class Dense(TextureSettings):
    sampling = Sampling(40)


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


def test_the_papers_pattern_241_has_the_label_5():
    """Figure 1 of the PFJCTH paper; 241 is 0b11110001, a run of five around the circle."""
    codes = [np.array([code >> p & 1 for p in range(8)], bool) for code in (241, 240, 255, 5, 0)]
    assert [int(riu2(bits)) for bits in codes] == [5, 4, 8, -1, 0]
    assert ones_of(patch([90, 90, 90], [90, 9, 90], [9, 9, 9]), threshold=45.0)[0, 0] == 5


def test_any_circle_is_read_bilinearly():
    """On a plane that rises to the right, the neighbours right of the centre are brighter."""
    columns = np.tile(10 * np.arange(15, dtype=np.float32), (15, 1))
    for neighbours, radius, margin in ((16, 2.0, 2), (12, 2.5, 3), (24, 3.0, 3)):
        turns = 2 * np.pi * np.arange(neighbours) / neighbours
        for over in (3.0, 8.0, 17.0):
            found = ones_of(columns, over, neighbours, radius)
            assert found.shape == (15 - 2 * margin,) * 2
            assert (found == np.sum(10 * radius * np.cos(turns) >= over)).all()


def test_points_without_texture_are_left_out_of_the_normaliser():
    """Most points of a target have no major texture, yet at the truth it is like itself."""
    rng = np.random.default_rng(5)
    image = np.full((60, 80, 3), 90, np.uint8)
    image[20:40, 20:60] = rng.integers(40, 200, (20, 40, 3))
    image[20:40, 37:43] = 90
    where = Region(40.0, 20.0), State(40.0, 30.0)
    for rest in ("discard", "colour", "bin"):
        settings = Dense(**PLAIN, levels=2, rest=rest, least_texture=0.0)
        model = settings.model(image, *where)
        assert model.distances(model.label(image), where[1].vector[None])[0] < 0.12
    labels = [
        TextureBins(2, rest=r).label(image, Window(20, 20, 60, 40)) for r in ("bin", "colour")
    ]
    plain = TextureBins(2).label(image, Window(20, 20, 60, 40)) < 0
    assert 0.5 < plain.mean() < 0.9
    assert set(labels[0][plain]) == {2**3 * 5}
    assert labels[1][plain].min() >= 2**3 * 5
    assert labels[1].max() < 2**3 * 6


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
    assert TextureSettings(rest="discard", least_texture=0.05).bins(smooth, *where) == ColourBins(8)
    rough = np.random.default_rng(3).integers(0, 256, (30, 40, 3)).astype(np.uint8)
    joint = TextureBins(8)
    assert TextureSettings(rest="discard", least_texture=0.05).bins(rough, *where) == joint
    assert TextureSettings(rest="discard", least_texture=0.99).bins(rough, *where) == ColourBins(8)
    assert TextureSettings(levels=1).bins(smooth, *where) == TextureBins(1, rest="colour")
