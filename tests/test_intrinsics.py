"""The intrinsics and the lens of a camera: what is rendered lies where the truth says."""

import mujoco
import numpy as np
import pytest

from sim.camera.camera import CameraConfig, camera_of, pinhole
from sim.camera.exact.renderer import ExactRenderer
from sim.camera.lens import Lens
from sim.camera.renderer import OpenGLRenderer, camera_pose

SIZE = WIDTH, HEIGHT = 320, 240
MARGIN = 14
"""A blob nearer to the border than this is not wholly in the picture [px]."""
WITHIN = {OpenGLRenderer: 0.2, ExactRenderer: 0.45}
"""Each blob's centroid is known to this [px]: from four samples a pixel, and from one, as the exact
renderer takes. The centroid of a disc of 1.8 to 3.6 px radius then has an error of 0.12 to 0.09 px
rms (measured: 0.07 to 0.13), of which the largest of 60 is about three times that."""
MEAN_WITHIN = 0.05
"""The mean of these errors, which pixels that lie half a pixel off would move [px]."""
RENDERERS = [pytest.param(OpenGLRenderer, marks=pytest.mark.opengl), ExactRenderer]
SENSOR = 'resolution="320 240" sensorsize="0.004 0.003"'
CAMERAS = {
    "field of view": 'fovy="45"',
    "centred sensor": f'{SENSOR} focalpixel="300 300"',
    "off-centre to the right": f'{SENSOR} focalpixel="300 300" principalpixel="25 0"',
    "off-centre downwards": f'{SENSOR} focalpixel="300 300" principalpixel="0 25"',
    "pixels that are not square": f'{SENSOR} focalpixel="300 260" principalpixel="30 -20"',
    "sensor of another resolution": (
        'resolution="640 400" sensorsize="0.004 0.003" focal="0.004 0.004" '
        'principal="0.0003 -0.0002"'
    ),
}


def model_with(camera):
    return mujoco.MjModel.from_xml_string(f"""
    <mujoco>
      <visual><headlight ambient="1 1 1"/><quality offsamples="4"/></visual>
      <worldbody>
        <body name="blob" mocap="true"><geom type="sphere" size=".012" rgba="1 1 1 1"/></body>
        <camera name="eye" pos="0.1 0 1" euler="4 -7 30" {camera}/>
      </worldbody>
    </mujoco>""")


SETTINGS = {
    "centred": CameraConfig(fx=300.0),
    "off-centre": CameraConfig(fx=280.0, fy=310.0, cx=195.0, cy=95.0),
    "plumb_bob": CameraConfig(
        fx=290.0, distortion="plumb_bob", coefficients=(-0.3, 0.1, 0.002, -0.003, -0.01)
    ),
    "plumb_bob, off-centre": CameraConfig(
        fx=250.0, fy=260.0, cx=180.0, cy=110.0,
        distortion="plumb_bob", coefficients=(-0.3, 0.1, 0.002, -0.003, -0.01),
    ),
    "pincushion": CameraConfig(distortion="plumb_bob", coefficients=(0.3, 0.1, 0.0, 0.0, 0.0)),
    "rational": CameraConfig(
        fx=250.0, distortion="rational", coefficients=(0.5, 0.2, 1e-3, -2e-3, 0.02, 0.8, 0.3, 0.05)
    ),
    "fisheye": CameraConfig(
        fx=204.0, cx=150.0, distortion="fisheye", coefficients=(-0.02, 0.005, -0.003, 0.0005)
    ),
    "fisheye of 90 deg": CameraConfig(
        fovy_deg=90.0, cx=160.0, distortion="fisheye", coefficients=(0.0,) * 4
    ),
}  # fmt: skip


def check_blobs(make, model, camera, count=30):
    """Blobs all over the picture are where they should be."""
    data, lens, found = mujoco.MjData(model), Lens(camera), []
    renderer = make(model, "eye", lens.view)
    mujoco.mj_forward(model, data)
    eye = camera_pose(data, 0)
    v, u = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    for true in np.random.default_rng(0).uniform(MARGIN, np.subtract(SIZE, MARGIN), (count, 2)):
        ray = np.append(camera.normalise(true), 1.0)
        data.mocap_pos[0] = eye.apply(ray / np.linalg.norm(ray))
        mujoco.mj_forward(model, data)
        light = lens.bend(renderer.begin(data)()).astype(float).sum(axis=2)
        seen = np.array([(u * light).sum(), (v * light).sum()]) / light.sum()
        found.append(seen - true)
    renderer.close()
    assert np.abs(found).max() < WITHIN[make]
    assert np.abs(np.mean(found, axis=0)).max() < MEAN_WITHIN


@pytest.mark.parametrize("make", RENDERERS)
@pytest.mark.parametrize("camera", CAMERAS)
def test_a_rendered_blob_lies_where_the_models_camera_says(make, camera):
    model = model_with(CAMERAS[camera])
    check_blobs(make, model, pinhole(model, "eye", *SIZE))


@pytest.mark.parametrize("make", RENDERERS)
@pytest.mark.parametrize("settings", SETTINGS)
def test_a_rendered_blob_lies_where_the_settings_say(make, settings):
    config, model = SETTINGS[settings], model_with(CAMERAS["off-centre to the right"])
    check_blobs(make, model, camera_of(config, model, "eye"))


def test_settings_go_before_the_models_sensor():
    model = model_with(CAMERAS["off-centre to the right"])
    own = camera_of(CameraConfig(), model, "eye")
    assert own == pinhole(model, "eye", *SIZE)
    assert (own.fx, own.cx) == pytest.approx((300.0, 135.0))
    given = camera_of(CameraConfig(fovy_deg=60.0, cy=100.0), model, "eye")
    f = 120 / np.tan(np.radians(30))
    assert (given.fx, given.fy, given.cx, given.cy) == pytest.approx((f, f, 135.0, 100.0))
    assert camera_of(CameraConfig(fx=200.0), model, "eye").fy == 200.0


@pytest.mark.parametrize("settings", ["plumb_bob", "pincushion", "rational", "fisheye"])
def test_the_field_of_view_holds_with_the_distortion(settings):
    c, model = SETTINGS[settings], model_with('fovy="45"')
    lens = CameraConfig(fovy_deg=50.0, distortion=c.distortion, coefficients=c.coefficients)
    bottom = camera_of(lens, model, "eye").normalise(np.array([160.0, 240.0]))
    assert np.degrees(np.arctan(bottom[1])) == pytest.approx(25.0, abs=0.1)  # p2 bends it a little


def test_the_focal_length_for_sizes_is_the_geometric_mean():
    camera = pinhole(model_with(f'{SENSOR} focalpixel="320 180"'), "eye", *SIZE)
    assert camera.focal == pytest.approx(240.0, rel=1e-6)


def test_a_camera_that_is_not_perspective_is_refused():
    model = model_with('projection="orthographic" fovy="1"')
    with pytest.raises(ValueError, match="camera 'eye' of the robot's model is not a perspec"):
        pinhole(model, "eye", *SIZE)
