"""The renderer without OpenGL: near OpenGL's pictures, and the same bits wherever it runs."""

import hashlib
import multiprocessing
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from pathlib import Path

import mujoco
import numpy as np
import pytest

from servo.loop.episode import Episode
from servo.output.versions import versions
from servo.scenario.load import load
from sim.camera import gl
from sim.camera.camera import CameraConfig
from sim.camera.choice import renderer_of
from sim.camera.exact import raster
from sim.camera.exact.raster import is_outside
from sim.camera.exact.renderer import ExactRenderer
from sim.camera.lens import Lens
from sim.camera.renderer import OpenGLRenderer
from sim.mounting import CAMERA
from sim.types import Camera

NEAR = 8
"""Levels by which a pixel may differ from OpenGL's."""
FIRST = """
import sys
sys.path.insert(0, sys.argv[1])
from test_exact import digest
print(digest(), digest(fine=True))
"""
APPROVED = "91ce67744ae98c3f0ce84344aadf96b5af5ff7400a04a1dc266098adeb6f7ec8"
"""SHA-256 of the first picture of `BODIES`."""
FINE = "153b6d4acbb8832dc55244fef3900bd87e63e072c8f282ea3865129f5b2d6f18"
"""The same with fine textures."""
SHADED = "808f587b755167eeaab6cbb62c0409dad6148f1aa77ecc9d03aa95df627a389f"
"""That of the first picture of `clutter` with shadows."""

BODIES = """
<mujoco>
  <asset>
    <texture name="sky" type="skybox" builtin="gradient" rgb1=".3 .5 .7" rgb2=".9 .9 1" width="64"
     height="64" mark="cross" markrgb="1 0 0"/>
    <texture name="checks" type="2d" builtin="checker" rgb1=".2 .3 .4" rgb2=".8 .7 .6" width="64"
     height="64"/>
    <material name="checks" texture="checks" texrepeat="3 2" specular="0"/>
    <material name="gloss" rgba=".2 .6 .3 1" specular="1" shininess=".3"/>
    <material name="clear" rgba="1 0 0 0"/>
    <mesh name="wedge" vertex="0 0 0  .3 0 0  0 .3 0  0 0 .3"/>
  </asset>
  <visual><headlight ambient=".2 .2 .2" diffuse=".3 .3 .3" specular=".2 .2 .2"/>
    <map znear=".01"/><quality offsamples="0"/><global offwidth="160" offheight="120"/></visual>
  <worldbody>
    <light type="directional" dir="-1 1 -2" diffuse=".4 .4 .3" specular=".3 .3 .3"
     castshadow="false"/>
    <geom type="plane" size="2 1.5 .1" material="checks"/>
    <geom type="sphere" size=".2" pos="-.6 .3 .2" material="gloss"/>
    <geom type="ellipsoid" size=".3 .15 .1" pos=".5 .4 .2" rgba=".8 .2 .1 1"/>
    <geom type="capsule" size=".1 .2" pos="0 .5 .3" euler="60 20 0" rgba=".1 .2 .9 1"/>
    <geom type="cylinder" size=".15 .1" pos="-.2 -.2 .1" rgba=".9 .9 .1 1"/>
    <geom type="box" size=".1 .2 .1" pos=".5 -.3 .1" euler="0 0 30" rgba=".4 .2 .5 1"/>
    <geom type="mesh" mesh="wedge" pos="-.7 -.5 0" rgba=".6 .6 .6 1"/>
    <geom type="box" size=".1 .1 .1" pos="0 -.9 .6" rgba="1 0 1 0"/>
    <geom type="box" size=".1 .1 .1" pos="0 .9 .6" material="clear"/>
    <camera name="eye" pos="0 -1.6 1.1" xyaxes="1 0 0 0 .6 .8" fovy="60"/>
    <camera name="up" pos="0 -1.6 .4" xyaxes="1 .2 0 0 -.3 1" fovy="80"/>
    <camera name="close" pos=".4 -.3 .25" xyaxes="1 0 0 0 .5 1" fovy="80"/>
  </worldbody>
</mujoco>
"""


def share_near(a, b):
    """Share of the pixels that are near each other in all channels."""
    return float((np.abs(a.astype(int) - b).max(axis=2) <= NEAR).mean())


def both(episode):
    world = episode.world
    view = Lens(world.camera).view
    return [make(world.model, CAMERA, view) for make in (OpenGLRenderer, ExactRenderer)]


@pytest.mark.opengl
@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("line", []),
        ("mesh_circle", []),
        ("fisheye", []),
        ("arm_line", ["camera.width=161", "camera.height=119"]),
        ("plate_line", ["disturbances=[{kind='spot', start=0.0}]"]),
    ],
)
def test_pictures_and_silhouettes_are_near_those_of_opengl(name, changes):
    with Episode(load(name, changes)) as episode:
        data = episode.world.data
        model = episode.world.model
        opengl, exact = both(episode)
        assert share_near(opengl.begin(data)(), exact.begin(data)()) > 0.99
        own = model.body_rootid[model.geom_bodyid] == model.body("target").id
        for alone in (True, False):
            wanted, found = (r.silhouette(data, own, alone=alone) for r in (opengl, exact))
            assert wanted.sum() > 300
            assert (wanted != found).sum() <= 3
        opengl.close()


@pytest.mark.opengl
@pytest.mark.newest  # before MuJoCo 4 a plane's repeated texture begins elsewhere
@pytest.mark.parametrize(("name", "least"), [("eye", 0.97), ("up", 0.97), ("close", 0.95)])
def test_every_shape_light_and_texture_is_near_that_of_opengl(name, least):
    """Gloss, repeated textures, the sky, and cuts at the near plane; a clear body is not drawn."""
    model, data, view = scene(name)
    opengl, exact = (make(model, name, view) for make in (OpenGLRenderer, ExactRenderer))
    assert share_near(opengl.begin(data)(), exact.begin(data)()) > least
    seen = np.arange(model.ngeom) == 5
    wanted, found = (r.silhouette(data, seen, alone=False) for r in (opengl, exact))
    assert (wanted != found).sum() <= 3
    opengl.close()


def test_what_cannot_be_drawn_is_refused():
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><asset><hfield name="h" nrow="2" ncol="2" size="1 1 1 1"/></asset><worldbody>'
        '<geom type="hfield" hfield="h"/><camera name="eye"/></worldbody></mujoco>'
    )
    with pytest.raises(
        ValueError, match=r'^the model has height fields, which the renderer "exact"'
    ):
        ExactRenderer(model, "eye", Camera(50.0, 50.0, 50.0, 50.0, 100, 100))


def scene(name):
    model = mujoco.MjModel.from_xml_string(BODIES)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    focal = 60 / np.tan(np.radians(model.cam_fovy[model.camera(name).id]) / 2)
    return model, data, Camera(focal, focal, 80.0, 60.0, 160, 120)


def digest(fine=False):
    model, data, view = scene("eye")
    renderer = ExactRenderer(model, "eye", view, fine=fine)
    return hashlib.sha256(renderer.begin(data)().tobytes()).hexdigest()


TABLE = """<mujoco>
 <visual><headlight ambient="1 1 1" diffuse="0 0 0" specular="0 0 0"/></visual>
 <worldbody>
  <geom name="table" type="box" size="1 1 .02" pos="0 0 -.02" rgba="1 1 1 1"/>
  {}
  <camera name="eye" pos="{}" xyaxes="{}"/>
 </worldbody></mujoco>"""


def darkness(things, place, eye=((0, 0, 1.0), (1, 0, 0, 0, 1, 0))):
    """The share of the table's light that is missing at a place (x, y) [m], by the picture."""
    text = TABLE.format(things, *(" ".join(map(str, part)) for part in eye))
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    view = Camera(400.0, 400.0, 200.0, 200.0, 400, 400)
    plain, shaded = (
        ExactRenderer(model, "eye", view, shaded=shaded).begin(data)() for shaded in (False, True)
    )
    seen = (np.array([*place, 0.0]) - data.cam_xpos[0]) @ data.cam_xmat[0].reshape(3, 3)
    u, v = (200 + 400 * seen[:2] * (1, -1) / -seen[2]).astype(int)
    assert (plain[v, u] == 255).all()
    return 1 - shaded[v, u, 0] / 255


BALL = '<geom type="sphere" size=".05" pos="{} {} {}"/>'
LEANING = ((0, -0.8, 0.8), (1, 0, 0, 0, 0.7071, 0.7071))


@pytest.mark.parametrize(
    ("things", "place", "eye", "expected"),
    [
        (BALL.format(0.1, 0, 0.05), (0.16, 0), None, 0.6 * (1 - (0.06 / 0.09) ** 2) ** 2),
        (BALL.format(0.1, 0, 0.05), (0.16, 0.0), LEANING, 0.6 * (1 - (0.06 / 0.09) ** 2) ** 2),
        (BALL.format(0.1, 0, 0.05), (0.2, 0), None, 0),
        # Half its width above the table the shadow is gone, and half as dark at half of that.
        (BALL.format(0.1, 0, 0.075), (0.1, 0.08), None, 0.3 * (1 - (0.08 / 0.09) ** 2) ** 2),
        (BALL.format(0.1, 0, 0.11), (0.1, 0.08), None, 0),
        # Below the table, and a thing so flat that it has 0.2 / 0.3 of the height.
        (BALL.format(0.1, 0, -0.1), (0.1, 0.0), None, 0),
        ('<geom type="box" size=".05 .05 .005" pos="0 0 .005"/>', (0.06, 0), None, 0.4 * (1 - (0.06 / 0.09) ** 2) ** 2),
        # A long box, turned by 90 deg and by 45; two geoms of a body, 0.2 m apart, have one shadow.
        ('<geom type="box" size=".1 .04 .05" pos="0 0 .05" euler="0 0 90"/>', (0, 0.12), None, 0.6 * (1 - (0.12 / 0.18) ** 2) ** 2),
        ('<geom type="box" size=".1 .04 .05" pos="0 0 .05" euler="0 0 45"/>', (0.085, 0.085), None, 0.6 * (1 - 2 * (0.085 / 0.18) ** 2) ** 2),
        ('<body pos="0 0 .05"><geom size=".02" pos="0 .08 0"/><geom size=".02" pos="0 -.08 0"/><geom size=".05" pos="0 0 0"/></body>', (0, 0.12), None, 0.6 * (1 - (0.12 / 0.18) ** 2) ** 2),
    ],
)  # fmt: skip
def test_a_thing_has_a_soft_shadow_on_the_table(things, place, eye, expected):
    found = darkness(things, place, eye or ((0, 0, 1.0), (1, 0, 0, 0, 1, 0)))
    assert found == pytest.approx(expected, abs=0.02)


def test_shadows_have_the_same_bits_everywhere():
    changes = ["camera.renderer=exact", "camera.shadows=true"]
    with Episode(load("clutter", changes), seen=False) as run:
        image = next(iter(run)).frame.image
    assert hashlib.sha256(image.tobytes()).hexdigest() == SHADED


@pytest.mark.parametrize("side", range(4))
def test_a_triangle_may_cover_the_outermost_pixels_alone(side):
    """It reaches from outside over the middles of one column or row of 8 x 6 pixels, and no further."""
    size = np.array([8.0, 6.0])
    along = side % 2
    corners = np.zeros((3, 11))
    places = np.array([[-2.0, 3.0], [0.6, 1.0], [0.6, 5.0]])[:, [along, 1 - along]]
    if side > 1:
        places = size - places
    corners[:, [raster.U, raster.V]] = places
    assert raster.may_cover(corners, 6, 8)
    places[:, along] += 0.2 if side > 1 else -0.2
    corners[:, [raster.U, raster.V]] = places
    assert not raster.may_cover(corners, 6, 8)


def test_a_texture_from_far_away_is_its_mean():
    """Its coarsest level, one pixel: half of the picture is black, and half is white."""
    text = """<mujoco>
     <asset><texture name="halves" type="2d" builtin="checker" rgb1="0 0 0" rgb2="1 1 1" width="8"
      height="8"/><material name="halves" texture="halves" texrepeat="400 400"/></asset>
     <visual><headlight ambient="1 1 1" diffuse="0 0 0" specular="0 0 0"/></visual>
     <worldbody><geom type="plane" size="1 1 .1" material="halves"/>
      <camera name="eye" pos="0 0 1"/></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    view = Camera(40.0, 40.0, 20.0, 20.0, 40, 40)
    for fine in (False, True):
        image = ExactRenderer(model, "eye", view, fine=fine).begin(data)()
        assert image.min() >= 127
        assert image.max() <= 128


def drawn_by(kind):
    model, _, view = scene("eye")
    return type(renderer_of(CameraConfig(renderer=kind))(model, "eye", view))


def forked(results):
    results.put(digest())


def test_bits_are_the_same_in_threads_and_after_a_fork():
    with ThreadPoolExecutor(2) as pool:
        assert {f.result() for f in [pool.submit(digest) for _ in range(4)]} == {APPROVED}
    context = multiprocessing.get_context("fork")
    results = context.SimpleQueue()
    child = context.Process(target=forked, args=(results,))
    child.start()
    assert results.get() == APPROVED
    child.join()


@pytest.mark.processes
def test_bits_are_the_same_with_a_plain_processor_and_without_opengl(tmp_path):
    plain = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "MUJOCO_GL": "off"}
    environment = {**os.environ, **plain, "NUMBA_CACHE_DIR": str(tmp_path)}
    answer = subprocess.run(
        [sys.executable, "-c", FIRST, str(Path(__file__).parent)],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert (answer.stdout.split(), answer.stderr) == ([APPROVED, FINE], "")


def test_without_opengl_a_line_says_so_and_the_exact_renderer_is_used(monkeypatch, capsys):
    from machines import machine_with  # this file is imported by other processes too

    machine_with(monkeypatch)
    monkeypatch.setenv(gl.WITHOUT, "")
    monkeypatch.delenv(gl.WITHOUT)
    assert versions()["pictures"] == "as set"
    gl.is_there.cache_clear()
    assert drawn_by("exact") is ExactRenderer
    assert capsys.readouterr().err == ""
    assert drawn_by("opengl") is ExactRenderer
    assert gl.is_there() is False
    gl.is_there.cache_clear()
    assert drawn_by("opengl") is ExactRenderer
    gl.is_there.cache_clear()
    assert capsys.readouterr().err == (
        "servobench: The OpenGL library libEGL.so.1 is missing on this machine: run "
        f'{gl.INSTALL}. camera.renderer = "exact" is used.\n'
    )
    assert versions()["pictures"] == "exact, without OpenGL"


@pytest.mark.parametrize(("textures", "least", "most"), [("fast", 0.06, 0.2), ("fine", 0.0, 0.03)])
def test_fine_textures_show_a_tags_corners_where_they_are(textures, least, most):
    """The deviation in px: 0.005 in OpenGL's pictures, which also mix two levels of detail."""
    with Episode(load("hand_tag", ["camera.renderer=exact", f"camera.textures={textures}"])) as run:
        step = list(islice(run, 3))[-1]
    assert least < np.abs(step.estimate.corners - step.truth_estimated.corners).max() < most


def test_lens_shutter_and_visible_share_work_with_it():
    changes = ["camera.renderer=exact", "camera.readout_ms=20", "world.visibility=true"]
    with Episode(load("fisheye", changes)) as episode:
        steps = [step for step, _ in zip(episode, range(3), strict=False)]
    assert all(0.9 < step.truth.visible <= 1.0 for step in steps)


AWAY = 1.2**0.5
"""Distance of the lamp from the corners of the face [m]; it is 1 m above them."""


@pytest.mark.parametrize(
    ("light", "facing", "strength"),
    [
        ('type="point" exponent="0"', 1 / AWAY, 1.0),
        ('type="point" exponent="0" attenuation="1 0.5 0.25"', 1 / AWAY, 1 / (1 + AWAY / 2 + 0.3)),
        ('type="spot" cutoff="30" exponent="3"', 1 / AWAY, 1 / AWAY**3),
        ('type="spot" cutoff="20" exponent="3"', 0.0, 0.0),
        ('type="directional"', 1.0, 1.0),
        ('type="directional" dir="-2 0 -1"', 5**-0.5, 1.0),
    ],
)
def test_a_lamp_lights_a_face_by_its_distance_angle_and_cone(light, facing, strength):
    """All four corners of the face are equally far from the lamp, which stands above its middle."""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><visual><headlight active="0"/></visual><worldbody>
        <light pos="0.2 0 1" {light} ambient="0.1 0.1 0.1" diffuse="0.6 0.4 0.2" specular="0 0 0"/>
        <geom type="box" size="{0.1**0.5} {0.1**0.5} 0.1" pos="0.2 0 -0.1" rgba="1 1 0.5 1"/>
        <camera name="eye" pos="0.3 0.1 2"/></worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    view = Camera(fx=160.0, fy=160.0, cx=60.0, cy=40.0, width=100, height=80)
    image = ExactRenderer(model, "eye", view).begin(data)()
    shown = 255 * strength * (0.1 + facing * np.array([0.6, 0.4, 0.2])) * (1, 1, 0.5)
    np.testing.assert_allclose(image[45:50, 50:55], np.tile(shown, (5, 5, 1)), atol=1)


@pytest.mark.parametrize(
    ("middle", "outside"),
    [
        ((0.0, 0.0, 1.0), False),
        ((0.0, 0.0, -0.09), False),  # the ball reaches through the camera
        ((0.0, 0.0, -0.11), True),
        # Each side is at 45 degrees to the optical axis: 0.1 from it is 0.1414 beside the corner.
        ((1.14, 0.0, 1.0), False),
        ((1.15, 0.0, 1.0), True),
        ((-1.14, 0.0, 1.0), False),
        ((-1.15, 0.0, 1.0), True),
        ((0.0, 1.14, 1.0), False),
        ((0.0, 1.15, 1.0), True),
        ((0.0, -1.14, 1.0), False),
        ((0.0, -1.15, 1.0), True),
    ],
)
def test_a_ball_beyond_a_side_of_the_picture_is_not_drawn(middle, outside):
    view = np.array([100.0, 100.0, 100.0, 100.0])
    assert is_outside(np.array(middle), 0.1, view, 200, 200) == outside


@pytest.mark.opengl
def test_a_spot_is_on_the_table_as_with_opengl():
    """Lit at its four corners alone, the table would be dark: they are outside of the cone."""
    spot = "disturbances=[{kind='spot', start=0.0, ramp=0.01, duration=5.0}]"
    with Episode(load("line", [spot, "controller.kind=hold"])) as episode:
        for _ in range(3):
            episode.world.step(np.zeros(6))
        pictures = [each.begin(episode.world.data)() for each in both(episode)]
    assert share_near(*pictures) > 0.98


def test_walls_and_clutter_with_a_picture_do_not_darken_the_whole_table():
    def brightness(*changes):
        exact = ["camera.renderer=exact", "clutter.toys=false", "controller.kind=hold", *changes]
        with Episode(load("line", exact), seen=False) as episode:
            return episode.look().frame.image.mean()

    walls = "walls.picture=brick"
    assert brightness(walls, "camera.shadows=true") == pytest.approx(brightness(walls), rel=0.02)
