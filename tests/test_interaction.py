"""Interaction matrices against finite differences of exact polygons, and reference vectors."""

import numpy as np
import pytest
from servoing import parallel

from servo.features._interaction import interaction, oriented, row_theta
from servo.features.moments import of_moments
from servo.sight import shape_moments
from servo.types import Plane
from sim.geometry import exp_se3, exp_so3, half_turn

SHAPES = {
    "rectangle": [[-0.1, -0.05], [0.1, -0.05], [0.1, 0.05], [-0.1, 0.05]],
    "triangle": [[-0.1, -0.05], [0.12, -0.02], [-0.02, 0.09]],
    "arrow": [
        [-0.1, -0.02],
        [0.02, -0.02],
        [0.02, -0.06],
        [0.12, 0],
        [0.02, 0.06],
        [0.02, 0.02],
        [-0.1, 0.02],
    ],
    "L": [[0, 0], [0.15, 0], [0.15, 0.04], [0.05, 0.04], [0.05, 0.12], [0, 0.12]],
}
POSES = {
    "in front": ([0, 0, 0], [0, 0, 1.0]),
    "aside and turned": ([0, 0, 0.7], [0.2, -0.15, 0.9]),
    "tilted": ([0.4, -0.3, 0.5], [0.1, 0.12, 1.2]),
    "strongly tilted": ([-0.7, 0.5, -1.0], [-0.2, 0.05, 0.8]),
}


def points_of(shape, pose):
    w, t = POSES[pose]
    flat = np.column_stack([SHAPES[shape], np.zeros(len(SHAPES[shape]))])
    return flat @ exp_so3(np.array(w, float)).T + t


def plane_of(points):
    normal = np.cross(points[1] - points[0], points[2] - points[0])
    return Plane(*(normal / (normal @ points[0])))


def features_of(points, scale):
    return of_moments(shape_moments.of_polygon(points[:, :2] / points[:, 2:]), scale)


def by_differences(points, scale, h=1e-5):
    columns = []
    for unit in np.eye(6):
        # The camera moves by the twist, so the points move by its inverse.
        ahead, behind = (exp_se3(s * h * unit).inverse().apply(points) for s in (1, -1))
        step = features_of(ahead, scale) - features_of(behind, scale)
        step[3] = half_turn(step[3])
        columns.append(step / (2 * h))
    return np.stack(columns, axis=1)


@pytest.mark.parametrize("scale", [1.0, 0.1414])
@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("shape", SHAPES)
def test_agrees_with_finite_differences(shape, pose, scale):
    points = points_of(shape, pose)
    m = shape_moments.of_polygon(points[:, :2] / points[:, 2:])
    L = interaction(m, plane_of(points), scale)
    # Central differences with h = 1e-5 are good to h^2 and to 1e-16 / h: about 1e-9, times |s|.
    np.testing.assert_allclose(L, by_differences(points, scale), rtol=0, atol=5e-8)


def test_translation_block_of_a_parallel_plane_is_minus_an_over_z():
    points = points_of("L", "aside and turned")
    m = shape_moments.of_polygon(points[:, :2] / points[:, 2:])
    L = interaction(m, parallel(0.9), 1.0)
    an = 1 / np.sqrt(m.area)
    np.testing.assert_allclose(L[:3, :3], -an / 0.9 * np.eye(3), atol=1e-12)
    np.testing.assert_allclose(L[3], [0, 0, 0, L[3, 3], L[3, 4], -1], atol=1e-12)


def test_parallel_rows_are_the_papers():
    """Rows of the second paper, plane parallel to the image, n_ij = mu_ij / a."""
    points = points_of("arrow", "aside and turned")
    m, Z = shape_moments.of_polygon(points[:, :2] / points[:, 2:]), 0.9
    a, x, y = 1 / np.sqrt(m.area), m.xg, m.yg
    n20, n11, n02 = m.mu20 / m.area, m.mu11 / m.area, m.mu02 / m.area
    rows = [
        [-a / Z, 0, 0, a * (4 * n11 - x * y / 2), -a * (1 + 4 * n20 - x**2 / 2), a * y],
        [0, -a / Z, 0, a * (1 + 4 * n02 - y**2 / 2), -a * (4 * n11 - x * y / 2), -a * x],
        [0, 0, -a / Z, -3 / 2 * a * y, 3 / 2 * a * x, 0],
    ]
    np.testing.assert_allclose(interaction(m, parallel(Z), 1.0)[:3], rows, atol=1e-12)


def test_a_square_has_no_orientation_to_servo_on():
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * 0.1
    with pytest.raises(ValueError, match="equal principal moments, so its angle"):
        row_theta(shape_moments.of_polygon(square), parallel(1.0))
    L = interaction(shape_moments.of_polygon(square), parallel(1.0), 1.0)
    np.testing.assert_array_equal(L[3], np.zeros(6))


@pytest.mark.parametrize(("ratio", "has"), [(1.0, False), (1.05, False), (1.15, True), (2.0, True)])
def test_a_shape_has_an_orientation_from_one_tenth_longer_than_wide(ratio, has):
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [0.1 * ratio, 0.1]
    assert oriented(shape_moments.of_polygon(corners)) is has


@pytest.mark.reference
@pytest.mark.parametrize("name", ["tahri", "seed"])
def test_reference_vectors(moment_case, name):
    points = np.array(moment_case["polygon_camera_xyz"])
    m, plane = (
        shape_moments.of_polygon(points[:, :2] / points[:, 2:]),
        Plane(*moment_case["plane_ABC"]),
    )
    expected = moment_case[name]
    scale = expected["Z_star"] * np.sqrt(expected["a_star"])
    L = interaction(m, plane, scale)
    np.testing.assert_allclose(L, expected["L"], rtol=0, atol=1e-12)
    np.testing.assert_allclose(L, expected["L_finite_difference"], rtol=0, atol=1e-8)
    np.testing.assert_allclose(of_moments(m, scale), expected["features"], atol=1e-12)
