"""The scene as shapes: where they lie, their colours, and the pictures on them."""

import mujoco
import numpy as np
import pytest
from seen_targets import build

from servo.output.recording.solids import entities, shapes_of, solids
from sim.targets import mesh, plate

SCENE = """<mujoco>
<asset>
  <texture name="two" type="2d" builtin="checker" rgb1="1 0 0" rgb2="0 0 1" width="4" height="2"/>
  <texture name="cube" type="cube" builtin="flat" rgb1="0 1 0" rgb2="0 1 0" width="8" height="48"/>
  <material name="two" texture="two" texrepeat="2 1"/>
  <material name="cube" texture="cube" rgba=".5 .5 .5 .4"/>
  <material name="plain" rgba=".1 .2 .3 1"/>
</asset>
<worldbody>
  <geom name="box" type="box" size="1 2 3" material="two"/>
  <geom name="can" type="cylinder" size="1 2" material="two"/>
  <geom name="ball" size="1" material="cube"/>
  <geom name="bar" type="capsule" size="1 2" material="plain"/>
  <geom name="own" type="box" size="1 1 1" material="plain" rgba="1 0 0 1"/>
  <geom name="hidden" size="1" group="3"/>
  <body name="a"><geom size="1"/></body>
</worldbody></mujoco>"""


@pytest.fixture(scope="module")
def shapes():
    return {s.name: s for s in shapes_of(mujoco.MjModel.from_xml_string(SCENE))}


def test_what_is_not_drawn_is_no_shape(shapes):
    assert shapes.keys() == {"box", "can", "ball", "bar", "own", ""}
    assert [shapes[""].body, shapes["box"].body] == [1, 0]


@pytest.mark.parametrize(
    ("name", "rgba"),
    [
        ("box", (1, 1, 1, 1)),
        ("can", (0.5, 0, 0.5, 1)),
        ("ball", (0, 0.5, 0, 0.4)),
        ("bar", (0.1, 0.2, 0.3, 1)),
        ("own", (1, 0, 0, 1)),
        ("", (0.5, 0.5, 0.5, 1)),
    ],
)
def test_a_colour_is_that_of_the_geom_the_material_or_the_pictures_mean(shapes, name, rgba):
    np.testing.assert_allclose(shapes[name].rgba, rgba, atol=0.01)


def test_a_box_with_a_picture_has_it_on_six_sides(shapes):
    surface = shapes["box"].surface
    assert shapes["box"].kind == "mesh"
    assert surface.picture.shape == (2, 4, 3)
    assert surface.vertices.shape == surface.normals.shape == (36, 3)
    np.testing.assert_array_equal(np.abs(surface.vertices).max(axis=0), [1, 2, 3])
    # Outwards, counter-clockwise or not: each normal is that of a side on which its vertex lies.
    np.testing.assert_array_equal((surface.vertices / (1, 2, 3) * surface.normals).sum(axis=1), 1)
    top = surface.normals[:, 2] == 1
    corners = {
        tuple(v[:2].tolist()): tuple(uv.tolist())
        for v, uv in zip(surface.vertices[top], surface.uv[top], strict=True)
    }
    assert corners == {(-1, 2): (0, 0), (1, 2): (2, 0), (1, -2): (2, 1), (-1, -2): (0, 1)}


def test_a_mesh_lies_where_the_target_has_it_with_its_picture():
    (duck,) = shapes_of(build(mesh.Config(texture="duck")).spec.copy().compile())
    points = duck.pose.apply(duck.surface.vertices)
    low, high = points.min(axis=0), points.max(axis=0)
    np.testing.assert_allclose([low[0], high[0], low[2]], [-0.1, 0.1, 0.0], atol=1e-6)
    u, v = duck.surface.uv[points[:, 0].argmax()]  # the beak's tip
    assert duck.surface.picture[int(v * 16), int(u * 16)].tolist() == [222, 96, 24]
    out = (duck.surface.normals * (duck.surface.vertices)).sum(axis=1)
    assert (out > 0).mean() > 0.7


def test_a_large_picture_is_thinned_out(monkeypatch):
    monkeypatch.setattr("servo.output.recording.solids.LARGEST_SIDE", 100)
    (shape,) = shapes_of(build(plate.Config()).spec.copy().compile())
    assert shape.surface.picture.shape == (60, 80, 3)


def test_meshes_are_entities_of_their_own_and_what_is_clear_is_none(shapes):
    paths = [path for path, _ in solids(list(shapes.values()), ["world/fixed", "world/a"])]
    assert sorted(paths) == [
        "world/a/ellipsoid",
        "world/fixed/box",
        "world/fixed/capsule",
        "world/fixed/cylinder",
        "world/fixed/ellipsoid",
        "world/fixed/mesh/box",
    ]


def test_no_body_lies_below_another_in_a_recording():
    names = ["board", "target", "target/door", "robot/a", "robot/a/b", "", "sp ace"]
    assert entities(names) == [
        "/world/board",
        "/world/target",
        r"/world/target\/door",
        "/world/robot/a",
        r"/world/robot/a\/b",
        "/world/body_5",
        r"/world/sp\ ace",
    ]
