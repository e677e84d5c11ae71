"""A target that leaves or is hidden is LOST within a second, and found where it comes back."""

import cv2
import numpy as np
import pytest

from sim.types import Frame
from tracking import create
from tracking.appearance.views import APART, SIDE, SIZES, Views
from tracking.evaluation.track import follow
from tracking.sequences.painted.similarity import HIDDEN_AT, Config
from tracking.types import Region, State, Status


@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_the_whole_picture_is_searched_for_a_view(smooth_image, turn):
    """The target of the first picture is found in one that is moved by (31, -17) px."""
    region, state = Region(32.0, 24.0), State(50.0, 60.0, turn)
    views = Views(smooth_image, region, state, 3)
    moved = np.roll(smooth_image, (-17, 31), (0, 1))
    places = views.search(views.blurred(moved), state, 3)
    assert np.hypot(*(places[0, :2] - (81.0, 43.0))) < 3
    assert places[0, 2:].tolist() == [turn, 0.0]


def test_the_first_view_and_the_newest_are_kept(smooth_image):
    first, later = State(50.0, 60.0), [State(50.0 + 22 * i, 30.0) for i in range(4)]
    views = Views(smooth_image, Region(24.0, 24.0), first, 3)
    blurred = views.blurred(smooth_image)
    for state in later:
        views.learn(blurred, state)
    alike = views.likeness(blurred, np.stack([s.vector for s in (first, *later)]))
    np.testing.assert_allclose(alike[[0, 3, 4]], 1.0, atol=1e-9)
    assert alike[1:3].max() < 0.9


@pytest.mark.wide
@pytest.mark.parametrize("kind", ["annealed", "pf_ssd"])
def test_a_target_out_of_the_picture_is_lost_within_a_second_and_found_again(kind):
    sequence = Config(frames=100, away=40, hidden=0, turn_deg=0.0, zoom=1.0).build(
        np.random.default_rng(5)
    )
    gone = ~np.isfinite(sequence.truth).all(axis=(1, 2))
    first, last = np.flatnonzero(gone)[[0, -1]]
    tracker = create(kind, seed=0, preset="video", particles=100)
    shots = list(follow(tracker, sequence.source, sequence.region, sequence.start))
    lost = [shot.estimate.status is Status.LOST for shot in shots]
    assert not any(lost[:first])
    assert lost.index(True) - first <= 30
    assert all(lost[lost.index(True) : last + 1])
    end = shots[-1].estimate
    assert end.status is Status.LOCKED
    assert np.hypot(end.state.x - sequence.states[-1, 0], end.state.y - sequence.states[-1, 1]) < 4


@pytest.mark.wide
def test_what_hides_the_target_is_not_learned_while_the_doubt_is_still_rising():
    """The smoothed doubt lags: by it alone the bar became a view, and the target was never LOST."""
    settings = Config(frames=100, away=0, hidden=35, turn_deg=10.0, zoom=1.2)
    sequence = settings.build(np.random.default_rng(3))
    first = round(HIDDEN_AT * 100) - 17
    tracker = create("annealed", seed=0, views=6, scatter=0.5, particles=100)
    shots = list(follow(tracker, sequence.source, sequence.region, sequence.start))
    lost = [shot.estimate.status is Status.LOST for shot in shots]
    assert lost.index(True) - first == 17
    assert not lost[-1]


def test_a_picture_too_small_for_the_search_has_no_candidates():
    state = State(10.0, 6.0)
    views = Views(np.zeros((12, 20, 3), np.uint8), Region(8.0, 8.0), state, 2)
    assert views.search(np.zeros((5, 20, 3), np.uint8), state, 5).shape == (0, 4)


@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_of_a_picture_too_large_for_the_search_the_part_around_the_last_place_is_searched(turn):
    noise = np.random.default_rng(8).integers(0, 255, (40, 2600, 3), np.uint8)
    picture = np.asarray(cv2.GaussianBlur(noise, (0, 0), 1.5))
    state = State(1900.0, 20.0, turn)
    views = Views(picture, Region(8.0, 8.0), state, 1)
    places = views.search(views.blurred(np.roll(picture, 300, 1)), state, 3)
    np.testing.assert_allclose(places[0], [2200.0, 20.0, turn, 0.0], atol=1.0)
    far = views.search(views.blurred(np.roll(picture, -700, 1)), state, 3)
    assert np.abs(far[:, 0] - 1900).max() < 800


@pytest.mark.parametrize("axis", [0, 1])
def test_a_peak_of_the_search_is_not_found_again_beside_itself(axis):
    """In a plain picture all places are alike: each is half a view beyond the one before."""
    state = State(20.0, 20.0)
    views = Views(np.zeros((60, 80, 3), np.uint8), Region(SIDE, SIDE), state, 2)
    sides = [100, 100]
    sides[1 - axis] = SIDE  # one view wide
    plain = views.blurred(np.full((*sides, 3), 90, np.uint8))
    places = views.search(plain, state, 3)[:, [1, 0]]
    found = places[:, axis] - places[0, axis]
    np.testing.assert_allclose(found, SIZES[0] * (APART + 1) * np.arange(3))
    assert np.ptp(places[:, 1 - axis]) == 0


def test_plain_pictures_are_like_nothing():
    plain = np.full((60, 80, 3), 90, np.uint8)
    tracker = create("annealed", views=6, particles=10)
    tracker.start(Frame(plain, 0.0, 0), Region(20.0, 20.0), State(40.0, 30.0))
    found = tracker.update(Frame(plain, 0.03, 1))
    assert 0.5 < found.distance <= 1.0
