"""The distortion of a lens: OpenCV's formulas, their inverse, and what lies beyond their reach."""

import cv2
import mujoco
import numpy as np
import pytest

from sim.camera.camera import CameraConfig, camera_of
from sim.camera.distortion import COEFFICIENTS, Distortion
from sim.types import Camera

LENSES = {
    "barrel": Distortion("plumb_bob", (-0.3, 0.1, 0.002, -0.003, -0.01)),
    "pincushion": Distortion("plumb_bob", (0.4, 0.1, 0.01, -0.02, 0.0)),
    "decentred": Distortion("plumb_bob", (-0.3, 0.0, 0.05, 0.05, 0.0)),
    "rational": Distortion("rational", (0.5, 0.2, 1e-3, -2e-3, 0.02, 0.8, 0.3, 0.05)),
    "equidistant": Distortion("fisheye", (0.0, 0.0, 0.0, 0.0)),
    "fisheye": Distortion("fisheye", (-0.05, 0.02, -0.01, 0.002)),
}
BARREL = Distortion("plumb_bob", (-0.3, 0.0, 0.0, 0.0, 0.0))
"""Its radius r - 0.3 r^3 is largest at r = 1 / sqrt(0.9)."""


REFUSED = (
    "folds back inside the picture",
    "is more than 85 deg",
    "cannot be inverted in the picture",
)


def camera_model():
    return mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><camera name="eye" fovy="45"/></worldbody></mujoco>'
    )


def rays_within(lens, share, count=500):
    half = share * min(lens.reach, 2.0) / np.sqrt(2)
    return np.random.default_rng(0).uniform(-half, half, (count, 2))


@pytest.mark.parametrize("name", LENSES)
def test_it_bends_as_opencv_does(name):
    lens = LENSES[name]
    rays = rays_within(lens, 0.99)
    points = np.column_stack([rays, np.ones(len(rays))])[:, None]
    project = cv2.fisheye.projectPoints if lens.model == "fisheye" else cv2.projectPoints
    there = project(points, np.zeros(3), np.zeros(3), np.eye(3), np.array(lens.coefficients))[0]
    np.testing.assert_allclose(lens.bend(rays), there.reshape(-1, 2), atol=1e-12)


@pytest.mark.parametrize("name", LENSES)
@pytest.mark.parametrize("share", [0.99, 8.0])
def test_straightening_undoes_bending_also_far_outside(name, share):
    lens = LENSES[name]
    rays = rays_within(lens, share)
    np.testing.assert_allclose(lens.straighten(lens.bend(rays)), rays, rtol=1e-9, atol=1e-10)
    grid = rays.reshape(5, 100, 2)
    np.testing.assert_array_equal(lens.straighten(lens.bend(grid)).shape, grid.shape)


def test_the_middle_stays_where_it_is():
    for lens in LENSES.values():
        np.testing.assert_array_equal(lens.bend(np.zeros(2)), [0, 0])
        np.testing.assert_array_equal(lens.straighten(np.zeros((1, 2))), [[0, 0]])


def test_a_polynomial_folds_and_goes_on_in_proportion():
    assert BARREL.folds
    # 0.97 of the last of 2048 radii, at equal angles up to 85 deg, before the fold.
    radii = np.tan(np.radians(np.linspace(0, 85, 2048)))
    assert BARREL.reach == pytest.approx(0.97 * radii[radii < 1 / np.sqrt(0.9)][-1], rel=1e-12)
    end = BARREL.bend(np.array([BARREL.reach, 0.0]))
    far = BARREL.bend(np.array([[3 * BARREL.reach, 0.0], [1 / np.sqrt(0.3), 0.0]]))
    np.testing.assert_allclose(far[0], 3 * end)
    assert far[1][0] > end[0]  # by its formula this ray would land in the middle of the image


@pytest.mark.parametrize(
    ("lens", "degrees"),
    [
        (Distortion("plumb_bob", (0.3, 0.0, 0.0, 0.0, 0.0)), 85.0),
        (Distortion("fisheye", (0.0,) * 4), 85.0),
        (
            Distortion("rational", (0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0)),
            44.1,
        ),  # a pole at 45 deg
        (Distortion("fisheye", (-0.2, 0.0, 0.0, 0.0)), 73.5),  # largest at 74.0 deg
    ],
)
def test_where_a_model_ends(lens, degrees):
    assert np.degrees(np.arctan(lens.reach)) == pytest.approx(degrees, abs=0.3)


def test_a_camera_goes_through_its_lens():
    plain = Camera(250.0, 260.0, 170.0, 110.0, 320, 240)
    camera = Camera(250.0, 260.0, 170.0, 110.0, 320, 240, LENSES["barrel"])
    points = np.array([[0.2, -0.1, 0.9], [-0.3, 0.25, 1.2]])
    bent = LENSES["barrel"].bend(points[:, :2] / points[:, 2:])
    np.testing.assert_allclose(camera.project(points), plain.to_pixels(bent))
    np.testing.assert_allclose(
        camera.normalise(camera.project(points)), points[:, :2] / points[:, 2:], atol=1e-11
    )
    assert hash(camera) == hash(Camera(250.0, 260.0, 170.0, 110.0, 320, 240, LENSES["barrel"]))


@pytest.mark.parametrize("size", [1.0, 30.0, 10_000.0])
@pytest.mark.parametrize("model", COEFFICIENTS)
def test_any_coefficients_are_a_camera_or_a_sentence(model, size):
    """One at a time, and random ones: nothing warns, and what is taken can be undone."""
    count, rng, model_of = COEFFICIENTS[model], np.random.default_rng(0), camera_model()
    some = [*np.eye(count), *-np.eye(count), *rng.uniform(-1, 1, (4, count))]
    taken, refusals = 0, set()
    for c in some:
        config = CameraConfig(32, 24, distortion=model, coefficients=tuple((size * c).tolist()))
        try:
            camera = camera_of(config, model_of, "eye")
        except ValueError as refused:
            refusals.add(str(refused))
            continue
        taken += 1
        pixels = np.random.default_rng(1).uniform((0, 0), (32, 24), (200, 2))
        rays = camera.normalise(pixels)
        np.testing.assert_allclose(camera.to_pixels(rays), pixels, atol=1e-5)
    assert taken >= 3
    assert all(any(reason in sentence for reason in REFUSED) for sentence in refusals), refusals


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        (("plumb_bob", (0.1,) * 4), "the distortion plumb_bob has 5 coefficients, not 4"),
        (("rational", (0.1,) * 5), "the distortion rational has 8 coefficients, not 5"),
        (("fisheye", (0.1,) * 5), "the distortion fisheye has 4 coefficients, not 5"),
        (
            ("fisheye", (0.1, 0.1, 0.1, np.inf)),
            "the distortion fisheye has a coefficient that is not finite: correct it",
        ),
        (("fish", ()), "there is no distortion 'fish'; there is plumb_bob, rational, fisheye"),
    ],
)
def test_what_is_no_distortion_is_a_sentence(given, sentence):
    with pytest.raises(ValueError) as refused:
        Distortion(*given)
    assert str(refused.value) == sentence
