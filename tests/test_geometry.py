import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform

from sim import geometry as g
from sim.types import Pose

RNG = np.random.default_rng(3)
TWISTS = [RNG.normal(size=6) * size for size in (1e-9, 1e-4, 0.3, 1.0)] + [np.zeros(6)]


@pytest.mark.parametrize("xi", TWISTS)
def test_log_undoes_exp(xi):
    np.testing.assert_allclose(g.log_se3(g.exp_se3(xi)), xi, rtol=1e-9, atol=1e-12)


def test_rotation_vector_close_to_a_half_turn_is_found():
    w = np.array([0.0, 0.0, np.pi - 1e-5])
    np.testing.assert_allclose(g.log_so3(g.exp_so3(w)), w, atol=1e-9)


@pytest.mark.parametrize("xi", TWISTS)
def test_the_left_jacobian_gives_the_angular_velocity(xi):
    w, rate = xi[3:], np.array([0.3, -0.5, 0.4])
    after, before = (g.exp_so3(w + sign * 1e-5 * rate) for sign in (1, -1))
    moved = g.log_so3(after @ before.T) / 2e-5
    np.testing.assert_allclose(g.left_jacobian(w) @ rate, moved, atol=1e-6)


@pytest.mark.parametrize("xi", TWISTS)
def test_exp_is_a_rigid_motion(xi):
    R = g.exp_se3(xi).rotation
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)


@pytest.mark.parametrize("xi", [*TWISTS, np.array([0.4, -1.0, 2.0, 1.2, -1.9, 1.5])])
def test_exp_and_log_are_those_of_scipy(xi):
    """SciPy has the rotation first. The numbers are of order one, and some ten operations round."""
    theirs = RigidTransform.from_exp_coords(np.roll(xi, 3))
    ours = g.exp_se3(xi)
    np.testing.assert_allclose(ours.rotation, theirs.rotation.as_matrix(), atol=1e-14)
    np.testing.assert_allclose(ours.translation, theirs.translation, atol=1e-14)
    # Near no rotation both logarithms divide small differences: a relative 1e-9 is left.
    np.testing.assert_allclose(
        g.log_se3(ours), np.roll(theirs.as_exp_coords(), 3), rtol=1e-9, atol=1e-13
    )


def test_two_half_motions_make_a_whole_one():
    xi = TWISTS[3]
    half = g.exp_se3(xi / 2)
    whole = half @ half
    np.testing.assert_allclose(whole.translation, g.exp_se3(xi).translation, atol=1e-12)
    np.testing.assert_allclose(whole.rotation, g.exp_se3(xi).rotation, atol=1e-12)


def test_exp_has_the_twist_as_its_derivative():
    xi, h = TWISTS[2], 1e-6
    point = np.array([0.2, -0.1, 0.7])
    moved = (g.exp_se3(h * xi).apply(point) - g.exp_se3(-h * xi).apply(point)) / (2 * h)
    np.testing.assert_allclose(moved, xi[:3] + np.cross(xi[3:], point), atol=1e-9)


def test_tilt_is_the_angle_from_straight_down():
    level = np.diag([1.0, -1.0, -1.0])
    assert g.tilt(level) == 0.0
    assert g.tilt(g.exp_so3(np.array([0.1, 0.0, 0.0])) @ level) == pytest.approx(0.1)


def test_pose_and_inverse_cancel():
    T = Pose.planar(0.3, -0.2, 1.1)
    unit = T @ T.inverse()
    np.testing.assert_allclose(unit.rotation, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(unit.translation, np.zeros(3), atol=1e-15)


def test_the_inverse_is_numpys_and_a_singular_matrix_has_none():
    A = np.random.default_rng(2).normal(size=(6, 6))
    np.testing.assert_allclose(g.inverse(A), np.linalg.inv(A), rtol=1e-9, atol=1e-12)
    with pytest.raises(np.linalg.LinAlgError, match="Singular matrix"):
        g.inverse(np.ones((3, 3)))


def test_a_matrix_weaker_than_allowed_counts_as_having_no_inverse():
    A = np.diag([2.0, 1.0, 0.1])  # |A^-1| is 10.06, so it proves 0.0994 at best
    np.testing.assert_allclose(g.inverse_if_strong(A, 0.099), np.diag([0.5, 1.0, 10.0]))
    assert g.inverse_if_strong(A, 0.1) is None


def test_poses_are_equal_where_their_numbers_are():
    one, other = Pose.planar(0.1, 0.2, 0.3), Pose.planar(0.1, 0.2, 0.4)
    assert one == Pose.planar(0.1, 0.2, 0.3)
    assert one != other
    assert one != "pose"
    with pytest.raises(TypeError, match="unhashable"):
        hash(one)


@pytest.mark.parametrize(
    ("given", "shapes"),
    [(("x", "y"), "((), ())"), ((np.zeros(3), np.eye(3)), "((3,), (3, 3))")],
)
def test_what_is_no_rotation_and_translation_is_refused(given, shapes):
    with pytest.raises(ValueError) as refused:
        Pose(*given)
    assert str(refused.value) == (
        f"a pose needs a rotation (3, 3) and a translation (3,), got {shapes}"
    )
