"""The trackers of the three papers on painted targets among distractors, against exact paths."""

import cv2
import numpy as np
import pytest

from sim.types import Frame
from tracking import create
from tracking.trackers import KINDS
from tracking.types import Region, State, Status

SECTORS = ((200, 40, 40), (40, 160, 60), (50, 70, 210), (230, 200, 50))
RADIUS = 14
REGION = Region(2 * RADIUS, 2 * RADIUS)


def path(k):
    return np.array([60 + 1.5 * k, 80 + 20 * np.sin(k / 8)])


def disc(image, centre, radius, colours):
    for s, colour in enumerate(colours):
        at = tuple(int(v) for v in np.round(np.asarray(centre) * 16 - 8))
        axes = (radius * 16, radius * 16)
        cv2.ellipse(image, at, axes, 0, 90 * s, 90 * s + 90, colour, -1, cv2.LINE_8, 4)


@pytest.fixture(scope="module")
def frames():
    """40 frames: a disc of four colours on white among 40 discs that share two of them."""
    rng = np.random.default_rng(5)
    ground = np.full((160, 240, 3), 255, np.uint8)
    for _ in range(40):
        colours = [
            SECTORS[0],
            SECTORS[2],
            *(tuple(int(v) for v in c) for c in rng.integers(0, 256, (2, 3))),
        ]
        disc(ground, rng.uniform(0, 1, 2) * (240, 160), int(rng.integers(6, 12)), colours)
    found = []
    for k in range(40):
        image = ground.copy()
        disc(image, path(k), RADIUS, SECTORS)
        found.append(Frame(image, k / 30, k))
    return found


def errors(kind, frames, **settings):
    tracker = create(kind, 1, **settings)
    x, y = path(0)
    tracker.start(frames[0], REGION, State(float(x), float(y)))
    estimates = [tracker.update(frame) for frame in frames[1:]]
    centres = np.array([(e.state.x, e.state.y) for e in estimates])
    truth = np.array([path(k) for k in range(1, len(frames))])
    return np.hypot(*(centres - truth).T), estimates


@pytest.mark.parametrize(
    ("kind", "bound"),
    [
        ("mean_shift", 2.0),
        ("condensation", 4.0),
        ("annealed", 3.0),
        ("hybrid", 4.0),
        ("sok", 2.0),
        ("kams", 2.0),
        ("kernel_pf", 5.0),
        ("mk_pf", 5.0),
        ("mk_ssd", 2.0),
        ("pf_ssd", 2.0),
    ],
)
def test_follows_the_disc_among_its_likes(kind, bound, frames):
    error, estimates = errors(kind, frames)
    assert error.max() < 2 * RADIUS
    assert np.sqrt(np.mean(error**2)) < bound
    assert estimates[-1].status is Status.LOCKED


@pytest.mark.parametrize(
    ("kind", "least", "most"),
    [
        ("mean_shift", 1, 20),
        ("sok", 1, 180),
        ("condensation", 201, 201),
        ("annealed", 501, 501),
        ("kams", 201, 5 * 6 * 40 + 1),
        ("hybrid", 101, 6 * 100 + 1),
        ("mk_pf", 501, 501),
        ("mk_ssd", 1, 12),
    ],
)
def test_histograms_are_counted(kind, least, most, frames):
    for estimate in errors(kind, frames[:4])[1]:
        assert least <= estimate.evaluations <= most


@pytest.mark.parametrize("kind", ["texture_pf", "texture_ms"])
def test_texture_tells_a_target_from_a_ground_of_its_colour(kind):
    rng = np.random.default_rng(7)
    ground = np.clip(rng.normal(120, 3, (160, 240, 3)), 0, 255)
    pattern = np.kron(rng.integers(60, 180, (10, 14, 1)), np.ones((3, 3, 3)))
    tracker, region = create(kind, 1), Region(42.0, 30.0)
    for k in range(30):
        image, x, y = ground.copy(), 40 + 3 * k, 60 + k
        image[y : y + 30, x : x + 42] = pattern
        frame = Frame(image.astype(np.uint8), k / 30, k)
        if k == 0:
            tracker.start(frame, region, State(x + 21.0, y + 15.0))
        else:
            found = tracker.update(frame)
    assert found.status is Status.LOCKED
    assert np.hypot(found.state.x - x - 21, found.state.y - y - 15) < 4.0


@pytest.mark.parametrize("angle", range(0, 360, 45))
def test_sok_finds_a_target_that_jumped_out_of_mean_shifts_reach(angle):
    blank = np.full((160, 240, 3), 255, np.uint8)
    before, after = blank.copy(), blank.copy()
    to = 120 + 34 * np.cos(np.radians(angle)), 80 + 34 * np.sin(np.radians(angle))
    disc(before, (120, 80), RADIUS, SECTORS)
    disc(after, to, RADIUS, SECTORS)
    away = {}
    for kind in ("mean_shift", "sok"):
        tracker = create(kind)
        tracker.start(Frame(before, 0.0, 0), REGION, State(120.0, 80.0))
        found = tracker.update(Frame(after, 0.1, 1)).state
        away[kind] = np.hypot(found.x - to[0], found.y - to[1])
    assert away["sok"] < 1.5
    assert away["mean_shift"] > 10


def test_of_equally_good_places_around_sok_takes_the_first_which_is_at_the_right():
    """A target of one colour, which then fills the picture at both sides of where it was."""
    image = np.full((160, 240, 3), 255, np.uint8)
    image[66:94, 106:134] = SECTORS[0]
    tracker = create("sok")
    tracker.start(Frame(image, 0.0, 0), REGION, State(120.0, 80.0))
    image = np.full((160, 240, 3), SECTORS[0], np.uint8)
    image[:, 106:134] = 255
    found = tracker.update(Frame(image, 0.1, 1)).state
    assert (found.x, found.y) == pytest.approx((120 + 2 * RADIUS, 80))


def test_mean_shift_follows_size_if_asked():
    images = []
    for radius in (14, 15, 16, 17, 18, 19, 20, 20, 20, 20):
        image = np.full((160, 240, 3), 255, np.uint8)
        disc(image, (100, 80), radius, SECTORS)
        images.append(Frame(image, len(images) / 30, len(images)))
    tracker = create("mean_shift", scale=True)
    tracker.start(images[0], REGION, State(100.0, 80.0))
    scales = [tracker.update(image).state.scale for image in images[1:]]
    assert scales[-1] > 1.03
    assert create("mean_shift", scale=False) is not tracker


def test_create_refuses_what_there_is_not():
    with pytest.raises(ValueError, match="there is no kind 'csrt'"):
        create("csrt")
    with pytest.raises(TypeError):
        create("kams", particels=3)


@pytest.mark.parametrize("kind", [kind for kind in KINDS.names() if kind != "truth"])
def test_an_update_before_the_start_is_refused(kind):
    with pytest.raises(ValueError) as refused:
        create(kind).update(Frame(np.zeros((60, 80, 3), np.uint8), 0.0, 0))
    owner, _, rest = str(refused.value).partition(": ")
    assert rest == "call start(frame, region, state) before update(frame)"
    assert owner in {one.__name__ for one in type(create(kind)).__mro__}


@pytest.mark.parametrize("seed", ["x", 1.5, -1])
def test_a_seed_that_is_none_is_refused(seed):
    with pytest.raises(ValueError) as refused:
        create("kams", seed=seed)
    assert str(refused.value) == f"seed = {seed!r}: expected a whole number of at least 0"
