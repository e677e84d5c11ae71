import numpy as np
import pytest
from servoing import CAMERA, METRIC, PAPER, facing

from servo.sight import shape_moments
from servo.sight.planes import level_plane
from servo.types import Sight
from sim.geometry import exp_se3, half_turn
from sim.types import Camera
from tracking.types import Region, State


def of(state, features, camera=CAMERA):
    m = shape_moments.of_state(state, Region(58.0, 29.0), camera)
    return features.values(Sight(m, facing(m))), m


def test_metric_scaling_makes_an_the_depth():
    values, m = of(State(160.0, 120.0, 0.0, 1.25), METRIC)
    np.testing.assert_allclose(values, [0, 0, 0.8, 0], atol=1e-12)
    assert pytest.approx(0.8) == 1 / facing(m).C


def test_paper_scaling_makes_an_one_over_the_root_of_the_area():
    values, _ = of(State(189.0, 91.0, 0.4, 1.0), PAPER)
    an = 1 / np.sqrt(0.2 * 0.1)
    np.testing.assert_allclose(values, [0.1 * an, -0.1 * an, an, 0.4], atol=1e-12)


def test_pixels_that_are_not_square_do_not_bias_the_area():
    wide = Camera(580.0, 290.0, 320.0, 120.0, 640, 240)
    corners = Region(58.0, 29.0).corners(State(160.0, 120.0, 0.3)) * [2.0, 1.0]
    m = shape_moments.of_corners(corners, wide)
    values = METRIC.values(Sight(m, facing(m)))
    np.testing.assert_allclose(values, of(State(160.0, 120.0, 0.3), METRIC)[0], atol=1e-12)


def test_moments_of_a_rectangle_are_the_closed_form():
    m = shape_moments.of_polygon(np.array([[0, 0], [4, 0], [4, 2], [0, 2]]) + [1.0, 3.0])
    assert (m.area, m.xg, m.yg) == pytest.approx((8.0, 3.0, 4.0))
    assert (m.mu20, m.mu11, m.mu02) == pytest.approx((8 * 16 / 12, 0.0, 8 * 4 / 12))
    assert (m.mu30, m.mu21, m.mu12, m.mu03) == pytest.approx((0, 0, 0, 0), abs=1e-12)


def test_moments_do_not_depend_on_the_sense_of_the_polygon():
    shape = np.random.default_rng(0).normal(size=(3, 2))
    there, back = shape_moments.of_polygon(shape), shape_moments.of_polygon(shape[::-1])
    for name in ("area", "xg", "mu20", "mu11", "mu30", "mu21", "mu12", "mu03"):
        assert getattr(there, name) == pytest.approx(getattr(back, name), rel=1e-10)


@pytest.mark.parametrize(
    ("angle", "wrapped"),
    [
        (0.0, 0.0),
        (np.pi / 2, np.pi / 2),
        (-np.pi / 2, np.pi / 2),
        (3.0, 3.0 - np.pi),
        (7.0, 7 - 2 * np.pi),
    ],
)
def test_angles_wrap_to_half_a_turn(angle, wrapped):
    assert half_turn(angle) == pytest.approx(wrapped)


def test_a_level_plane_seen_by_a_tilted_camera_holds_its_points():
    T_base_camera = exp_se3(np.array([0.1, -0.2, -1.1, 0.3, -0.2, 0.4]))
    plane = level_plane(T_base_camera, 0.04)
    flat = np.array([[0.1, 0.05, 0.04], [-0.1, 0.05, 0.04], [0.02, -0.3, 0.04]])
    for X, Y, Z in T_base_camera.inverse().apply(flat):
        assert pytest.approx(1 / Z) == plane.A * X / Z + plane.B * Y / Z + plane.C


def test_error_wraps_its_angle_and_nothing_else():
    e = METRIC.error(np.array([3.0, -3.0, 5.0, 1.5]), np.array([0.0, 0.0, 0.0, -1.5]))
    np.testing.assert_allclose(e, [3.0, -3.0, 5.0, 3.0 - np.pi])
