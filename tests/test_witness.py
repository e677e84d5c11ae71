"""A tracker with a witness beside its colours does not take something of the same colours for its
target, finds the target again, and knows how sure it may be.
"""

import functools

import cv2
import numpy as np
import pytest

from tracking import create
from tracking.appearance.witness import BY_TEMPLATE, Witness
from tracking.evaluation.track import follow
from tracking.sequences.sequence import Sequence
from tracking.types import Region, State, Status
from tracking.verdict import Signs, Verdict

SIZE = 32
GONE, BACK, FRAMES = 15, 40, 55
BESIDE = State(84.0, 60.0)
"""Where something of the target's colours stands."""


def painted():
    """A target that vanishes beside a thing with its colours in another layout, and comes back."""
    rng = np.random.default_rng(3)
    ground = rng.integers(90, 120, (120, 200, 3), dtype=np.uint8)
    spots = cv2.GaussianBlur(rng.normal(size=(SIZE, SIZE)), (0, 0), 4.0)
    target = np.where((spots > np.median(spots))[..., None], (230, 60, 40), (30, 40, 150))
    target = target.astype(np.uint8)
    other = np.rot90(target).copy()
    at = [State(30.0 + 2 * min(n, GONE), 60.0) for n in range(FRAMES)]

    def paint(number):
        image = ground.copy()
        here = (at[number], target) if number < GONE or number >= BACK else None
        for state, picture in filter(None, ((BESIDE, other), here)):
            top, left = int(state.y) - SIZE // 2, int(state.x) - SIZE // 2
            image[top : top + SIZE, left : left + SIZE] = picture
        return image

    states = np.array([(s.x, s.y, s.theta, s.scale) for s in at])
    return Sequence.painted("lookalike", paint, Region(SIZE, SIZE), states)


@pytest.fixture(scope="module")
def lookalike():
    sequence = painted()

    @functools.cache
    def track(seed, kind="annealed", **settings):
        tracker = create(kind, seed=seed, particles=60, **settings)
        return [
            shot.estimate
            for shot in follow(tracker, sequence.source, sequence.region, sequence.start)
        ]

    return track


def near(estimate, state):
    return np.hypot(estimate.state.x - state.x, estimate.state.y - state.y) < SIZE / 4


def test_something_of_the_same_colours_is_not_the_target(lookalike):
    """The tracker without a witness is LOCKED on it in each draw; with one in 1 of 10, here in 1
    of 3. There the thing is learned before it is doubted.
    """
    gone = slice(GONE + 10, BACK)
    plain = [lookalike(seed)[gone] for seed in range(3)]
    heard = [lookalike(seed, witness=True)[gone] for seed in range(3)]
    assert all(e.status is Status.LOCKED and near(e, BESIDE) for track in plain for e in track)
    wrong = [any(e.status is Status.LOCKED for e in track) for track in heard]
    assert sum(wrong) <= 1


def test_the_target_is_found_again_where_it_is(lookalike):
    end = lookalike(0, witness=True)[-1]
    assert end.status is Status.LOCKED
    assert near(end, State(60.0, 60.0))


@pytest.mark.parametrize("kind", ["condensation", "kernel_pf", "texture_pf"])
def test_a_jump_to_the_target_is_no_velocity(lookalike, kind):
    """These trackers predict by the velocity, by which a jump would take them out of the picture."""
    track = lookalike(0, kind, witness=True)
    off = [np.hypot(e.state.x - 60.0, e.state.y - 60.0) for e in track]
    assert max(off) < 100
    assert all(
        d < SIZE for d, e in zip(off[BACK:], track[BACK:], strict=True) if e.status is Status.LOCKED
    )


def test_a_seed_gives_the_same_track_again(lookalike):
    first, again, other = (lookalike.__wrapped__(seed, witness=True) for seed in (1, 1, 2))
    assert [e.state for e in first] == [e.state for e in again]
    assert [e.distance for e in first] == [e.distance for e in again]
    assert [e.state for e in first] != [e.state for e in other]
    assert [e.state for e in lookalike(1)] != [e.state for e in first]


def test_the_confidence_is_high_on_the_target_and_low_off_it(lookalike):
    """The median of three draws, in all pictures with the target, and from half a second on after
    it has gone.
    """
    tracks = [[1 - e.distance for e in lookalike(seed, witness=True)] for seed in range(3)]
    confidence = np.median(tracks, axis=0)
    here = np.r_[0:GONE, BACK + 3 : FRAMES]
    assert confidence[here].min() > 0.8
    assert confidence[GONE + 15 : BACK].max() < 0.5


def test_a_filter_that_fails_to_follow_counts_nothing():
    sequence = painted()
    image = next(iter(sequence.source)).image
    witness = Witness(image, sequence.region, sequence.start)
    off = State(150.0, 60.0)  # outside the filter's window its output is negative
    witness.look(image, sequence.start)
    for _ in range(200):
        witness.fare(off)
    states = np.stack([sequence.start.vector, BESIDE.vector, off.vector])
    alike = [witness.signs(state)[1] for state in (sequence.start, BESIDE, off)]
    expected = BY_TEMPLATE * (1 - np.array(alike))
    np.testing.assert_allclose(witness.energy(states), expected, atol=1e-12)


def test_one_good_frame_does_not_lock_a_doubted_target_again():
    """What it takes to stay LOCKED does not suffice to become it again."""
    verdict = Verdict()
    good, doubted = Signs(0.3, 0.8, 0.35), Signs(0.2, 0.7, 0.42)
    poor = Signs(0.05, 0.1, 0.6)
    assert verdict.judge(good, 0.0) > 0.8
    verdict.judge(doubted, 1.0)
    assert verdict.status is Status.LOCKED
    assert not verdict.searches(1.0)
    assert verdict.judge(poor, 2.0) < 0.2
    assert verdict.status is Status.LOST
    assert not verdict.trusted
    verdict.judge(doubted, 3.0)
    assert verdict.status is Status.UNSURE
    assert verdict.searches(3.0)
    verdict.judge(good, 4.0)
    assert verdict.status is Status.LOCKED


def test_a_jump_needs_certainty_and_a_lead():
    verdict = Verdict()
    good, fair, poor = Signs(0.3, 0.8, 0.35), Signs(0.2, 0.75, 0.4), Signs(0.05, 0.1, 0.6)
    verdict.judge(good, 0.0)
    assert verdict.convinces(good, poor)
    assert not verdict.convinces(poor, poor)
    assert not verdict.convinces(good, good)
    assert verdict.logit(poor) < verdict.logit(fair) < verdict.logit(good)


@pytest.mark.parametrize("degrees", [0, 30, 90])
def test_a_lost_target_is_searched_with_its_angle(degrees):
    """The region need not lie along the picture's sides."""
    sequence = painted()
    image = next(iter(sequence.source)).image
    place, theta = sequence.start, np.radians(degrees)
    witness = Witness(image, sequence.region, State(place.x, place.y, theta))
    found = witness.places(image, State(20.0, 30.0, theta))
    assert np.hypot(found[0].x - place.x, found[0].y - place.y) < 2.5
    assert found[0].theta == theta


def test_a_small_target_is_searched_in_a_large_picture_with_fewer_points():
    sequence = painted()
    image = next(iter(sequence.source)).image
    large = np.tile(np.full_like(image, 90), (9, 12, 1))
    height, width = image.shape[:2]
    large[3 * height : 4 * height, 5 * width : 6 * width] = image
    place = sequence.start
    small = Region(16.0, 16.0)
    there = State(5 * width + place.x, 3 * height + place.y)
    witness = Witness(large, small, there)
    found = witness.places(large, State(20.0, 30.0))
    assert min(np.hypot(each.x - there.x, each.y - there.y) for each in found) < 6
