"""The painted sequences: the truth is where the paint is, and the numbers are the paper's."""

import numpy as np
import pytest

from tracking.drawing.colours import ESTIMATE, TRUTH
from tracking.drawing.contact_sheet import TILE, outline, sheet
from tracking.sequences.painted import KINDS as FOLDER
from tracking.sequences.painted import similarity
from tracking.sequences.painted.clutter import LEVELS, RADIUS
from tracking.sequences.sources import PaintedSource
from tracking.types import State


def build(kind, seed=0, **settings):
    return FOLDER.config_of(kind)(**settings).build(np.random.default_rng(seed))


def picture(sequence, index):
    return sequence.source.paint(index)


@pytest.mark.parametrize("kind", FOLDER.names())
def test_the_same_seed_paints_the_same_pictures(kind):
    once, again, other = build(kind, 3), build(kind, 3), build(kind, 4)
    np.testing.assert_array_equal(once.truth, again.truth)
    np.testing.assert_array_equal(picture(once, 7), picture(again, 7))
    assert not np.array_equal(picture(once, 7), picture(other, 7))


@pytest.mark.parametrize("kind", FOLDER.names())
def test_the_truth_is_where_the_target_is_painted(kind):
    """The pixels that differ between two pictures lie in the targets' two places."""
    still = {"noise": 0.0} if kind != "clutter" else {}
    sequence = build(kind, 1, **still)
    first, later = 0, 40
    changed = np.abs(picture(sequence, first).astype(int) - picture(sequence, later)).max(axis=2)
    v, u = np.nonzero(changed > 40)
    corners = sequence.truth[[first, later]]
    low, high = corners.min(axis=1) - 3, corners.max(axis=1) + 3  # blur reaches a little farther
    points = np.stack([u, v], axis=1)[:, None] + 0.5
    assert len(u) > 200
    assert np.all(np.any(np.all((points >= low) & (points <= high), axis=2), axis=1))


def test_a_clutter_disc_has_its_centre_where_the_truth_says():
    ground = build("clutter", 5, level="a")
    x, y = ground.states[9, :2]
    image = picture(ground, 9).astype(int)
    v, u = np.mgrid[:240, :320]
    inside = np.hypot(u + 0.5 - x, v + 0.5 - y) < RADIUS - 2
    colours = np.unique(image[inside], axis=0, return_counts=True)
    assert np.sort(colours[1])[-4:].sum() > 0.75 * inside.sum()  # four flat colours, smooth seams
    quadrants = [(u > x) & (v > y), (u < x) & (v > y), (u < x) & (v < y), (u > x) & (v < y)]
    means = [np.median(image[inside & q], axis=0) for q in quadrants]
    apart = np.linalg.norm(np.array(means)[:, None] - means, axis=2)
    assert apart[np.triu_indices(4, 1)].min() > 90


@pytest.mark.parametrize(("level", "sigma"), [(k, s) for k, (s, *_) in LEVELS.items()])
def test_clutter_noise_has_the_papers_sigma(level, sigma):
    """Second differences of smooth path plus white noise have sqrt(6) sigma."""
    xy = np.concatenate([build("clutter", s, level=level).states[:, :2] for s in range(3)])
    second = np.diff(xy, 2, axis=0)
    robust = 1.4826 * np.median(np.abs(second), axis=0)
    # 420 frames: the estimate's own error is about 6 %; clipping at the border takes a little.
    np.testing.assert_allclose(robust / np.sqrt(6), sigma, rtol=0.2)


def test_clutter_is_wholly_inside_and_as_long_as_the_papers():
    sequence = build("clutter", 0, level="d")
    assert sequence.source.count == len(sequence.truth) == 140
    assert picture(sequence, 0).shape == (240, 320, 3)
    assert sequence.truth.min() >= 0
    assert (sequence.truth.max(axis=(0, 1)) <= (320, 240)).all()
    covered = [np.mean(picture(build("clutter", 0, level=k), 0) != 255) for k in "ad"]
    assert covered[0] < 0.5 < 0.9 < covered[1]


def test_discs_of_harder_levels_share_three_of_the_targets_colours():
    """Level f has 3/2 of the level b's pixels in the target's colours; a third lies on seams."""
    shares = []
    for level in "bf":
        image = picture(build("clutter", 4, level=level), 0).reshape(-1, 3)
        x, y = build("clutter", 4, level=level).states[0, :2]
        own = picture(build("clutter", 4, level=level), 0)[int(y) - 9 : int(y) + 9, int(x) - 9 :]
        colours, counts = np.unique(own[:, :18].reshape(-1, 3), axis=0, return_counts=True)
        colours = colours[np.argsort(counts)[-4:]].astype(int)
        painted = image[(image != 255).any(axis=1)].astype(int)
        near = np.abs(painted[:, None] - colours).max(axis=2).min(axis=1) < 3
        shares.append(near.mean())
    assert shares == pytest.approx([0.33, 0.49], abs=0.03)


def test_similarity_hides_turns_scales_and_doubles_its_speed():
    sequence = build("similarity", 2)
    x, y, theta, scale = sequence.states.T
    assert theta[0] == pytest.approx(0.0, abs=0.05)
    assert np.degrees(np.ptp(theta)) > 20
    assert scale.max() / scale.min() > 1.15
    hidden = picture(sequence, 150)
    inside = hidden[int(y[150]), int(x[150])]
    np.testing.assert_allclose(inside, 90, atol=15)  # the bar's grey, with its noise
    turned = sequence.region.corners(State(x[9], y[9], theta[9], scale[9]))
    np.testing.assert_allclose(sequence.truth[9], turned)


def test_texture_changes_size_and_speed_over_its_own_colour():
    sequence = build("texture", 2)
    speed = np.hypot(*np.diff(sequence.states[:, :2], axis=0).T)
    assert speed.min() < 0.5 < 4.0 < speed.max()
    assert sequence.states[:, 3].max() / sequence.states[:, 3].min() > 1.3
    image = picture(sequence, 0).astype(float)
    x, y = sequence.states[0, :2].astype(int)
    patch = image[y - 14 : y + 14, x - 24 : x + 24]
    assert np.abs(patch.mean(axis=(0, 1)) - image.mean(axis=(0, 1))).max() < 20
    assert patch.std() > 1.5 * image.std()


def test_a_camouflaged_car_has_the_colours_of_its_ground_and_finer_paint():
    sequence = build("camouflage", 2, colours="spread", gravel=0, noise=0.0)
    image = picture(sequence, 0).astype(float)
    x, y = sequence.states[0, :2].astype(int)
    car = image[y - 14 : y + 14, x - 24 : x + 24]
    assert np.abs(car.mean(axis=(0, 1)) - image.mean(axis=(0, 1))).max() < 6
    np.testing.assert_allclose(car.std(axis=(0, 1)), image.std(axis=(0, 1)), rtol=0.2)
    rough, smooth = (np.abs(np.diff(part, axis=1)).mean() for part in (car, image))
    assert rough > 2.5 * smooth


def test_a_camouflaged_car_in_one_colour_has_the_histogram_of_any_other_place():
    sequence = build("camouflage", 2, gravel=0, noise=0.0)
    image = picture(sequence, 0)
    assert len(np.unique(image.reshape(-1, 3) // 32, axis=0)) == 1
    x, y = sequence.states[0, :2].astype(int)
    car = image[y - 14 : y + 14, x - 24 : x + 24].astype(float)
    steps = (np.abs(np.diff(part.astype(float), axis=1)) for part in (car, image))
    rough, smooth = (np.mean(step > 8) for step in steps)
    assert rough > 0.15
    assert smooth < 0.02
    gravel = build("camouflage", 2, gravel=1, noise=0.0)
    assert len(np.unique(picture(gravel, 0).reshape(-1, 3) // 32, axis=0)) == 2


def test_a_contact_sheet_shows_truth_white_and_estimate_green():
    grey = PaintedSource(lambda _: np.full((120, 160, 3), 90, np.uint8), 9)
    truth = np.tile(np.array([[40, 30], [90, 30], [90, 70], [40, 70]], float), (9, 1, 1))
    sheets = [sheet(grey, truth, found, count=4) for found in (None, truth + 20)]
    assert sheets[0].shape == (TILE * 3 // 4 + 8, 4 * (TILE + 4) + 4, 3)
    for colour, counts in ((TRUTH, (True, True)), (ESTIMATE, (False, True))):
        seen = [(np.abs(s.astype(int) - colour).max(axis=2) < 90).sum() > 60 for s in sheets]
        assert tuple(seen) == counts


def test_the_ground_of_one_colour_has_all_shades_between_the_cars_two_tones():
    sequence = build("camouflage", 2, gravel=0, noise=0.0)
    image = picture(sequence, 0)
    x, y = sequence.states[0, :2].astype(int)
    car = image[y - 10 : y + 10, x - 20 : x + 20].reshape(-1, 3).astype(int)
    middle = 32 * (car[0] // 32) + 16
    ground = image[:40].reshape(-1, 3).astype(int) - middle
    assert (ground.min(axis=0) <= -8).all()
    assert (ground.max(axis=0) >= 7).all()
    assert len(np.unique(ground[:, 0])) >= 16
    every = build("camouflage", 2, gravel=0, noise=0.0)
    whole = picture(every, 0).reshape(-1, 3).astype(int) - middle
    counts = np.unique(whole[:, 0], return_counts=True)[1][1:-1] / len(whole)
    np.testing.assert_allclose(counts, 1 / 18, atol=0.02)  # each as often


def test_gravel_has_a_colour_70_levels_from_the_cars():
    """A thousand patches cover the whole ground."""
    gravel = build("camouflage", 2, colours="spread", gravel=1000, noise=0.0)
    image = picture(gravel, 0).astype(float)
    x, y = gravel.states[0, :2].astype(int)
    car = image[y - 14 : y + 14, x - 24 : x + 24].mean(axis=(0, 1))
    ground = image[:60].mean(axis=(0, 1))
    assert np.linalg.norm(ground - car) == pytest.approx(70, abs=3)


@pytest.mark.wide
@pytest.mark.parametrize("hidden", [0, 3, 4])
def test_the_target_is_hidden_in_as_many_frames_as_asked_for(hidden):
    clear, barred = (
        similarity.Config(frames=20, hidden=n).build(np.random.default_rng(0)).source
        for n in (0, hidden)
    )
    pairs = zip(clear, barred, strict=True)
    assert sum((a.image != b.image).any() for a, b in pairs) == hidden


def test_an_outline_has_a_black_border():
    square = np.array([[15.5, 15.5], [45.5, 15.5], [45.5, 45.5], [15.5, 45.5]])
    light = np.full((60, 60, 3), 200, np.uint8)
    outline(light, square, (250, 120, 60), width=5)
    np.testing.assert_array_equal(light[15, 30], (250, 120, 60))
    assert light[:30, 30].min() < 60  # darker than the line and the ground
    dark = np.zeros((60, 60, 3), np.uint8)
    outline(dark, square, (0, 0, 0))
    assert not dark.any()
