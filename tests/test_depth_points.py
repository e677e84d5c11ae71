"""What a law believes of distance and plane where they come from a depth picture."""

import numpy as np
import pytest

from servo import Episode, Mistake, load
from servo.loop.step import Step
from servo.sight.depth_points import FEWEST, DepthPoints
from sim.types import Camera

CAMERA = Camera(300.0, 300.0, 160.0, 120.0, 320, 240)
CORNERS = np.array([[120.0, 90.0], [200.0, 90.0], [200.0, 150.0], [120.0, 150.0]])
PLANE = np.array([0.3, -0.2, 1.25])
"""A x + B y + C = 1/Z; 0.8 m away."""
PICTURE = ("camera.depth=true", "camera.depth_noise=0.0014", "camera.depth_holes=2")
PLATE = ("target.kind=plate", "features.kind=hybrid", "camera.rate=15")
SMALL = ("camera.width=160", "camera.height=120", "start.x=30")
"""Pictures of a quarter of the pixels, for runs whose tracker does not look at them."""
TILTED = ("start.tilt_deg=20",)
SURFACE = 0.002
"""Height of the plate's surface, whose distance is held, over its origin [m]."""


def depths(noise: float = 0.0) -> np.ndarray:
    """The depth picture (H, W) of PLANE, whose inverse depths have a noise [1/m]."""
    v, u = np.mgrid[:240, :320] + 0.5
    rays = np.stack([(u - 160) / 300, (v - 120) / 300, np.ones_like(u)], axis=-1)
    drawn = np.random.default_rng(0).normal(0.0, noise, u.shape)
    return (1 / (rays @ PLANE + drawn)).astype(np.float32)


def test_the_plane_of_points_is_found() -> None:
    points = DepthPoints.inside(CORNERS, depths(), CAMERA)
    assert points is not None
    assert points.normal == pytest.approx(PLANE, abs=1e-5)
    assert points.plane(PLANE).vector == pytest.approx(PLANE, abs=1e-5)


def test_neither_holes_nor_what_is_behind_change_the_plane() -> None:
    depth = depths(0.0014)
    depth[100:110, 130:150] = np.nan
    depth[90:150, 185:200] = 1.5  # a fifth of the region shows the room behind
    points = DepthPoints.inside(CORNERS, depth, CAMERA)
    assert points is not None
    assert len(points.near) < 61 * 81
    # 4,000 points of 0.0014 over 0.08: 0.0003 in the slopes.
    assert points.normal == pytest.approx(PLANE, abs=2e-3)


def test_a_region_at_the_border_has_the_depth_of_its_visible_part() -> None:
    """The plane goes through the middle of what is seen, wherever the region's own middle is."""
    points = DepthPoints.inside(CORNERS + (150.0, 0.0), depths(), CAMERA)
    assert points is not None
    assert points.plane(PLANE).vector == pytest.approx(PLANE, abs=1e-5)


def test_zero_is_no_depth() -> None:
    """As many cameras say that they have none."""
    depth = depths()
    depth[:, 150:] = 0.0
    points = DepthPoints.inside(CORNERS, depth, CAMERA)
    assert points is not None
    assert points.plane(PLANE).vector == pytest.approx(PLANE, abs=1e-5)


def test_a_few_pixels_say_nothing() -> None:
    depth = np.full((240, 320), np.nan, np.float32)
    depth[100, 130 : 130 + FEWEST - 1] = 1.0
    assert DepthPoints.inside(CORNERS, depth, CAMERA) is None
    depth[101, 130] = 1.0
    assert DepthPoints.inside(CORNERS, depth, CAMERA) is not None


def last(*settings: str) -> Step:
    """The last step of a run with a plate."""
    with Episode(load("still", [*PLATE, *settings]), seen=False) as episode:
        return list(episode)[-1]


@pytest.mark.parametrize(
    ("tracker", "features"), [("truth", "moments"), ("truth", "points"), ("homography", "hybrid")]
)
def test_a_wrong_size_does_no_harm_where_the_depth_is_measured(tracker: str, features: str) -> None:
    wrong = ("believed.size_factor=1.2", f"tracker.kind={tracker}", f"features.kind={features}")
    wrong += ("run.duration=4",)
    wrong += SMALL if tracker == "truth" else ()
    by_size = last(*wrong).truth.depth - SURFACE
    by_picture = last(*wrong, *PICTURE, "sight.depth=picture").truth.depth - SURFACE
    assert by_size == pytest.approx(1 / 1.2, abs=2e-3)
    assert by_picture == pytest.approx(1.0, abs=2e-3)


@pytest.mark.wide
def test_a_depth_picture_stands_in_for_a_tracker_that_follows_no_size() -> None:
    near = ("tracker.kind=kams", "start.scale=1.2", "run.duration=4")
    assert last(*near).truth.depth - SURFACE == pytest.approx(1 / 1.2, abs=2e-3)
    found = last(*near, *PICTURE, "sight.depth=picture")
    assert found.truth.depth - SURFACE == pytest.approx(1.0, abs=2e-3)


@pytest.mark.wide
@pytest.mark.parametrize("features", ["hybrid", "points"])
def test_a_plane_of_the_picture_levels_a_camera_whose_tracker_sees_no_tilt(features: str) -> None:
    kinds = ("robot.kind=free", "tracker.kind=truth", f"features.kind={features}")
    tilted = (*kinds, *SMALL, *TILTED, *PICTURE, "sight.depth=picture")
    assert np.degrees(last(*tilted, "run.duration=1").tilt) == pytest.approx(20.0, abs=0.1)
    assert np.degrees(last(*tilted, "run.duration=3", "sight.plane=picture").tilt) < 0.5


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            ("sight.depth=picture",),
            'still: sight: plane or depth = "picture" needs a depth picture, and there is none: set '
            "camera.depth = true, or give Frame.depth with a camera of your own",
        ),
        (
            ("believed.size_factor=1.2", "believed.goal=shown"),
            'size_factor has no effect with goal = "shown": leave size_factor out',
        ),
    ],
)
def test_settings_that_do_not_go_together_are_refused(
    settings: tuple[str, ...], message: str
) -> None:
    with pytest.raises(Mistake) as refused, Episode(load("still", settings)):
        pass
    assert message in str(refused.value)
