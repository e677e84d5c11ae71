"""The intrinsics of a model's camera: what is rendered lies where the truth says."""

import mujoco
import numpy as np
import pytest

from sim.render import Renderer, camera_pose, pinhole

SIZE = WIDTH, HEIGHT = 320, 240
MARGIN = 14
"""A blob nearer to the border than this is not wholly in the picture [px]."""
WITHIN = 0.2
"""A blob's centroid is known to this from hard-edged pixels [px]."""
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


@pytest.mark.parametrize("camera", CAMERAS)
def test_a_rendered_blob_lies_where_the_truth_says(camera):
    model = model_with(CAMERAS[camera])
    data, found = mujoco.MjData(model), []
    renderer, intrinsics = Renderer(model, "eye", *SIZE), pinhole(model, "eye", *SIZE)
    v, u = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    for x, y in np.random.default_rng(0).uniform(-0.5, 0.5, (60, 2)):
        data.mocap_pos[0] = x, y, 0.0
        mujoco.mj_forward(model, data)
        point = camera_pose(data, 0).inverse().apply(data.mocap_pos[0])
        true = intrinsics.project(point)
        if not np.all((true > MARGIN) & (true < np.subtract(SIZE, MARGIN))):
            continue
        light = renderer.render(data).astype(float).sum(axis=2)
        seen = np.array([(u * light).sum(), (v * light).sum()]) / light.sum()
        found.append(np.abs(seen - true).max())
    renderer.close()
    assert len(found) >= 10
    assert max(found) < WITHIN


def test_the_focal_length_for_sizes_is_the_geometric_mean():
    camera = pinhole(model_with(f'{SENSOR} focalpixel="320 180"'), "eye", *SIZE)
    assert camera.focal == pytest.approx(240.0, rel=1e-6)


def test_a_camera_that_is_not_perspective_is_refused():
    model = model_with('projection="orthographic" fovy="1"')
    with pytest.raises(ValueError, match="camera 'eye' of the robot's model has to be a perspec"):
        pinhole(model, "eye", *SIZE)
