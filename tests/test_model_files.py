"""Models of others: read by MuJoCo in the layouts that are usual, or refused in one sentence."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from robot_files import write_obj, write_stl

from sim.camera.camera import CameraConfig
from sim.models.assembly import build_model
from sim.models.model_files import compiled, files_of
from sim.models.model_reader import read_spec
from sim.robots import arm
from sim.targets import mjcf

BODY = '<body name="link"><joint/><geom type="mesh" mesh="part"/></body>'
MESH = '<asset><mesh name="part" file="{}"/></asset>'


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A folder of models beside a folder of meshes, and another one to work in."""
    for name in ("models", "meshes", "textures", "work"):
        (tmp_path / name).mkdir()
    write_stl(tmp_path / "meshes" / "part.stl")
    write_obj(tmp_path / "meshes" / "part.obj")
    cv2.imwrite(str(tmp_path / "textures" / "wood.png"), np.full((8, 8, 3), 99, np.uint8))
    cv2.imwrite(str(tmp_path / "textures" / "hills.png"), np.eye(8, dtype=np.uint8) * 255)
    monkeypatch.chdir(tmp_path / "work")
    return tmp_path


def written(package, text, name="mine.xml"):
    path = package / "models" / name
    path.write_text(text)
    return path


def mjcf_text(assets="", bodies="", before=""):
    return f"<mujoco>{before}{assets}<worldbody>{bodies}</worldbody></mujoco>"


LAYOUTS = {
    "a path to a folder beside": mjcf_text(MESH.format("../meshes/part.stl"), BODY),
    "meshdir, as in robosuite and gymnasium-robotics": mjcf_text(
        MESH.format("part.obj"), BODY, '<compiler meshdir="../meshes" texturedir="../textures"/>'
    ),
    "assetdir": mjcf_text(MESH.format("part.stl"), BODY, '<compiler assetdir="../meshes"/>'),
    "an absolute path": mjcf_text(MESH.format("FOLDER/meshes/part.stl"), BODY),
    "an include, as in Menagerie": (
        f'<mujoco>{MESH.format("../meshes/part.stl")}<include file="link.xml"/></mujoco>'
    ),
    "an attached model": mjcf_text(
        '<asset><model name="other" file="other.xml"/></asset>',
        '<attach model="other" body="link" prefix="a_"/>',
    ),
    "replicas": mjcf_text(
        MESH.format("../meshes/part.stl"),
        f'{BODY}<replicate count="3" offset=".1 0 0"><geom size=".01"/></replicate>',
    ),
    "a height field": mjcf_text(
        '<asset><hfield name="h" file="../textures/hills.png" size=".1 .1 .05 .01"/></asset>'
        + MESH.format("../meshes/part.stl"),
        f'{BODY}<geom type="hfield" hfield="h"/>',
    ),
    "a flexible grid": mjcf_text(
        MESH.format("../meshes/part.stl"),
        f'{BODY}<body name="cloth" pos="0 0 .1"><flexcomp name="f" type="grid" count="3 3 1" '
        'spacing=".02 .02 .02" radius=".005" dim="2" mass="1"/></body>',
    ),
    "options, sensors and contacts": mjcf_text(
        MESH.format("../meshes/part.stl"),
        f'<light/>{BODY}<body name="b"><joint name="j"/><geom size=".01"/></body>',
        '<option timestep=".001" gravity="0 0 -1"/><visual><map znear=".5"/></visual>'
        '<contact><exclude body1="link" body2="b"/></contact><sensor><jointpos joint="j"/></sensor>',
    ),
    "a texture": mjcf_text(
        '<asset><texture name="t" type="2d" file="wood.png"/><material name="m" texture="t"/>'
        '<mesh name="part" file="../meshes/part.stl"/></asset>',
        BODY.replace("mesh=", 'material="m" mesh='),
        '<compiler texturedir="../textures"/>',
    ),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_model_of_any_layout_is_put_into_the_room(package, layout):
    written(package, f"<mujoco><worldbody>{BODY}</worldbody></mujoco>", "link.xml")
    other = mjcf_text(MESH.format("part.stl"), BODY, '<compiler meshdir="../meshes"/>')
    written(package, other, "other.xml")
    path = written(package, LAYOUTS[layout].replace("FOLDER", str(package)))
    assert compiled(read_spec(path, "robot")).nmeshface == 12
    rng = np.random.default_rng(0)
    target = mjcf.Config(model=str(path)).build(rng)
    room = build_model(480.0, CameraConfig(), arm.Config().build(rng), target)
    assert room.nmeshface == 12
    assert (room.nsensor, room.nexclude, room.opt.gravity[2]) == (0, 0, -9.81)
    assert list(Path().iterdir()) == []  # no log of MuJoCo's


def test_the_files_of_a_model_are_those_that_it_and_its_parts_name(package):
    written(package, '<mujoco><include file="deeper.xml"/></mujoco>', "part.xml")
    written(package, "<mujoco/>", "deeper.xml")
    path = written(
        package,
        mjcf_text(
            '<asset><mesh file="part.stl"/><texture name="t" type="2d" file="wood.png"/>'
            '<mesh file="gone.stl"/></asset>',
            '<include file="part.xml"/>',
            '<compiler meshdir="../meshes" texturedir="../textures"/>',
        ),
    )
    found = {str(file.relative_to(package)) for file in files_of(path)}
    assert found == {
        "models/mine.xml",
        "models/part.xml",
        "models/deeper.xml",
        "meshes/part.stl",
        "textures/wood.png",
    }


def test_the_files_of_what_is_no_model_are_itself(package):
    path = written(package, "<mujoco")
    assert files_of(path) == {path}


URDF = """<robot name="r">{extension}
  <link name="base"/>
  <link name="part">
    <visual><geometry><mesh filename="{mesh}"/></geometry></visual>
    <collision><geometry><sphere radius="0.1"/></geometry></collision>
  </link>
  <joint name="j" type="revolute"><parent link="base"/><child link="part"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="2" effort="10" velocity="3"/></joint>
  <gazebo><plugin filename="libx.so"/></gazebo>
</robot>"""


@pytest.mark.parametrize(
    ("mesh", "extension"),
    [
        ("../meshes/part.stl", ""),
        ("file://../meshes/part.stl", ""),
        ("FOLDER/meshes/part.stl", ""),
        ("file://FOLDER/meshes/part.stl", ""),
        ("package://mine/meshes/part.stl", ""),
        ("part.stl", '<mujoco><compiler meshdir="../meshes"/></mujoco>'),
    ],
)
def test_a_urdf_shows_its_visual_meshes_and_keeps_its_limits(package, mesh, extension):
    (package / "package.xml").write_text("<package/>")
    text = URDF.format(mesh=mesh, extension=extension).replace("FOLDER", str(package))
    path = written(package, text, "mine.urdf")
    model = compiled(read_spec(path, "robot"))
    assert (model.ngeom, model.nmesh) == (1, 1)
    assert model.jnt_range.tolist() == [[-1.0, 2.0]]
    assert package / "meshes" / "part.stl" in files_of(path)


def test_a_urdf_without_readable_visuals_shows_its_collision_shapes(package):
    path = written(package, URDF.format(mesh="meshes/part.dae", extension=""), "mine.urdf")
    model = compiled(read_spec(path, "robot"))
    assert (model.ngeom, model.nmesh, model.geom_size[0, 0]) == (1, 0, 0.1)


XACRO = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arm/></robot>'
WRONG = {
    ("mine.xml", "<mujoco>"): "XML parse error 14",
    ("mine.xml", ""): "ParseXML: empty file",
    ("mine.xml", "<sdf/>"): "Unrecognized XML model type: 'sdf'",
    ("mine.xml", '<mujoco><include file="gone.xml"/></mujoco>'): "Error opening file",
    ("mine.xml", mjcf_text(MESH.format("gone.stl"))): "Error opening file",
    ("mine.xml", mjcf_text(bodies='<geom size="1" foo="2"/>')): (
        "Schema violation: unrecognized attribute: 'foo', Element 'geom', line 1"
    ),
    ("mine.xml", mjcf_text(bodies='<body name="arm"><joint/></body>')): (
        "mass and inertia of moving bodies must be larger than mjMINVAL, Element name 'arm'"
    ),
    ("mine.xml", mjcf_text(bodies='<geom type="mesh" mesh="none"/>')): "mesh 'none' not found",
    ("mine.urdf", "<robot>"): "no element found: line 1, column 7",
    (
        "mine.urdf",
        XACRO,
    ): "it has elements of a namespace; expand xacro files first (xacro IN > OUT)",
    ("mine.urdf", URDF.format(mesh="gone.stl", extension="")): "Error opening file",
}


@pytest.mark.parametrize(("name", "text"), WRONG, ids=range(len(WRONG)))
def test_a_broken_model_is_a_sentence(package, name, text):
    path = written(package, text, name)
    with pytest.raises(ValueError) as refused:
        read_spec(path, "robot")
    sentence = str(refused.value)
    assert sentence.startswith(f"{path}: cannot read this robot: {WRONG[name, text]}"), sentence
    assert "\n" not in sentence


@pytest.mark.parametrize(
    ("name", "reason"),
    [("none.xml", "No such file or directory"), (".", "it is a folder")],
)
def test_a_model_that_is_no_file_is_a_sentence(tmp_path, name, reason):
    with pytest.raises(ValueError, match=re.escape(f"cannot read this robot: {reason}")):
        read_spec(tmp_path / name, "robot")
