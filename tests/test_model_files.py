"""Models of others: read with their meshes, or refused with what is wrong and in which file."""

import os
import re
import struct

import numpy as np
import pytest

from sim.models import model_files
from sim.models.model_files import read_spec

BODY = '<body><joint/><geom type="mesh" mesh="part"/></body>'
MESH = '<asset><mesh name="part" file="{}"/></asset>'
PNG = b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sII", 13, b"IHDR", 30_000, 30_000)


def stl(path, faces=12):
    corners = np.random.default_rng(0).normal(size=(faces, 9)).astype("<f4")
    blank = np.zeros((faces, 12), np.uint8), np.zeros((faces, 2), np.uint8)
    rows = np.hstack([blank[0], corners.view(np.uint8).reshape(faces, 36), blank[1]])
    path.write_bytes(b"\0" * 80 + struct.pack("<I", faces) + rows.tobytes())


@pytest.fixture
def model(tmp_path):
    """Writes a model into a folder with a mesh, and reads it."""
    folder = tmp_path / "robot"
    (folder / "meshes").mkdir(parents=True)
    stl(folder / "meshes" / "part.stl")
    stl(tmp_path / "outside.stl")

    def read(text, name="mine.xml"):
        text = text.replace("FOLDER", str(folder))
        (folder / name).write_bytes(text.encode() if isinstance(text, str) else text)
        return read_spec(folder / name, "robot")

    read.folder = folder
    return read


def mjcf(assets="", bodies="", before=""):
    return f"<mujoco>{before}{assets}<worldbody>{bodies}</worldbody></mujoco>"


@pytest.mark.parametrize("compiler", ['meshdir="meshes"', 'assetdir="meshes"', 'strippath="true"'])
def test_meshes_are_found_where_the_compiler_element_says(model, compiler):
    name = "meshes/part.stl" if "strip" in compiler else "part.stl"
    more = ' meshdir="meshes"' if "strip" in compiler else ""
    spec = model(mjcf(MESH.format(name), BODY, f"<compiler {compiler}{more}/>"))
    assert spec.meshes[0].file == str(model.folder / "meshes" / "part.stl")
    assert spec.compile().nmeshface == 12


def test_includes_are_expanded_and_their_names_start_at_the_model(model):
    (model.folder / "parts").mkdir()
    (model.folder / "parts" / "a.xml").write_text('<a><include file="parts/b.xml"/></a>')
    (model.folder / "parts" / "b.xml").write_text(f"<b>{BODY}</b>")
    spec = model(mjcf(MESH.format("meshes/part.stl"), '<include file="parts/a.xml"/>'))
    assert spec.compile().njnt == 1


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
        ("meshes/part.stl", ""),
        ("file://meshes/part.stl", ""),
        ("FOLDER/meshes/part.stl", ""),
        ("package://mine/meshes/part.stl", ""),
        ("part.stl", '<mujoco><compiler meshdir="meshes"/></mujoco>'),
    ],
)
def test_a_urdf_shows_its_visual_meshes_and_keeps_its_limits(model, mesh, extension):
    compiled = model(URDF.format(mesh=mesh, extension=extension), "mine.urdf").compile()
    assert (compiled.ngeom, compiled.nmesh) == (1, 1)
    assert compiled.jnt_range.tolist() == [[-1.0, 2.0]]


def test_a_urdf_without_readable_visuals_shows_its_collision_shapes(model):
    compiled = model(URDF.format(mesh="meshes/part.dae", extension=""), "mine.urdf").compile()
    assert (compiled.ngeom, compiled.nmesh, compiled.geom_size[0, 0]) == (1, 0, 0.1)


def test_a_urdf_of_a_ros_package_finds_the_meshes_beside_its_folder(model):
    (model.folder / "package.xml").write_text("<package/>")
    (model.folder / "urdf").mkdir()
    for mesh in ("package://mine/meshes/part.stl", "../meshes/part.stl"):
        assert model(URDF.format(mesh=mesh, extension=""), "urdf/a.urdf").compile().nmesh == 1
    with pytest.raises(ValueError, match=r"outside\.stl' is outside the model's own"):
        model(URDF.format(mesh="../../outside.stl", extension=""), "urdf/a.urdf")


LAUGHS = '<!ENTITY a "ha">' + "".join(
    f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)
WRONG = {
    "<mujoco>": "'mine.xml' is no XML: no element found: line 1, column 8",
    "": "'mine.xml' is no XML: no element found: line 1, column 0",
    "<sdf/>": "its root is <sdf>; it should be <mujoco> (MJCF) or <robot> (URDF)",
    '<?xml version="1.0" encoding="utf-99"?><mujoco/>': (
        "'mine.xml' is no XML: unknown encoding: utf-99"
    ),
    "<a>" * 300: "'mine.xml' has elements that lie too deep in each other; the limit is 200",
    '<!DOCTYPE m [<!ENTITY x SYSTEM "file:///etc/passwd">]><mujoco model="&x;"/>': (
        "'mine.xml' has a document type (DTD); its entities are not expanded"
    ),
    f'<!DOCTYPE m [{LAUGHS}]><mujoco model="&i;"/>': (
        "'mine.xml' has a document type (DTD); its entities are not expanded"
    ),
    '<mujoco><include file="mine2.xml"/></mujoco>': "its file 'mine2.xml' is missing in FOLDER",
    '<mujoco><include file="a.xml"/><include file="a.xml"/></mujoco>': (
        "'a.xml' is included twice, or includes itself"
    ),
    '<mujoco><include file="loop.xml"/></mujoco>': (
        "'loop.xml' is included twice, or includes itself"
    ),
    '<mujoco><include file="../secret.xml"/></mujoco>': (
        "its file '../secret.xml' is outside the model's own folder FOLDER; copy it there"
    ),
    '<mujoco><include file="entity.xml"/></mujoco>': (
        "'entity.xml' has a document type (DTD); its entities are not expanded"
    ),
    mjcf(MESH.format("../outside.stl")): (
        "its file '../outside.stl' is outside the model's own folder FOLDER; copy it there"
    ),
    mjcf(MESH.format("/etc/passwd")): (
        "its file '/etc/passwd' is outside the model's own folder FOLDER; copy it there"
    ),
    mjcf(MESH.format("link.stl")): (
        "its file 'link.stl' is outside the model's own folder FOLDER; copy it there"
    ),
    mjcf(MESH.format("part.stl"), before='<compiler meshdir=".."/>'): (
        "its file 'part.stl' is outside the model's own folder FOLDER; copy it there"
    ),
    mjcf(MESH.format("round.stl")): "no file can have the name 'round.stl'",
    mjcf(MESH.format("none.stl")): "its file 'none.stl' is missing in FOLDER",
    mjcf(MESH.format("meshes")): "its file 'meshes' is not a regular file",
    mjcf(MESH.format("pipe.stl")): "its file 'pipe.stl' is not a regular file",
    mjcf(MESH.format("a.xml")): "its mesh 'a.xml' is not one of .stl, .obj, .msh",
    mjcf(MESH.format("ascii.stl")): "its mesh 'ascii.stl' is no binary STL, or is cut off",
    mjcf(MESH.format("huge.stl")): (
        "with 'huge.stl' its files have 10,000,000,000,090 bytes; the limit is 100,000,000"
    ),
    mjcf(MESH.format("many.stl")): (
        "with 'many.stl' its meshes have 1,900,000 faces; the limit is 1,000,000"
    ),
    mjcf(MESH.format("many.obj")): (
        "with 'many.obj' its meshes have 1,200,000 faces; the limit is 1,000,000"
    ),
    mjcf('<asset><texture type="2d" file="bomb.png"/></asset>'): (
        "with 'bomb.png' its pictures have 900,000,000 pixels; the limit is 50,000,000"
    ),
    mjcf('<asset><texture type="2d" file="ascii.stl"/></asset>'): (
        "its picture 'ascii.stl' is no PNG"
    ),
    mjcf('<asset><texture name="t" builtin="flat" width="100000" height="100000"/></asset>'): (
        "with 't' its pictures have 60,000,000,000 pixels; the limit is 50,000,000"
    ),
    mjcf(bodies='<replicate count="1000000000"><geom size="1"/></replicate>'): (
        "it has a <replicate>, which is not read from models of others"
    ),
    mjcf('<asset><model name="m" file="../x.xml"/></asset>'): (
        "it has a <model>, which is not read from models of others"
    ),
    mjcf(bodies='<body><joint/><geom size="1" foo="2"/></body>'): (
        "Schema violation: unrecognized attribute: 'foo' Element 'geom'"
    ),
    mjcf(bodies='<body name="arm"><joint/></body>'): (
        "mass and inertia of moving bodies must be larger than mjMINVAL ('arm')"
    ),
    mjcf(
        bodies='<geom size="1" pos="nan 0 0"/>'
    ): "its <geom> has pos = 'nan 0 0', which is no number",
    mjcf(bodies='<geom type="mesh" mesh="none"/>'): "mesh 'none' not found in geom 0",
    '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arm/></robot>': (
        "it has elements of a namespace; expand xacro files first (xacro IN > OUT)"
    ),
}


def hostile(folder):
    """Files that a model should not reach, or not load."""
    (folder / "link.stl").symlink_to(folder.parent / "outside.stl")
    (folder / "round.stl").symlink_to("round.stl")
    (folder / "a.xml").write_text("<a/>")
    (folder / "loop.xml").write_text('<a><include file="loop.xml"/></a>')
    (folder / "entity.xml").write_text('<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>')
    (folder / "ascii.stl").write_bytes(b"solid part\n" + b"facet normal 0 0 1\n" * 20)
    (folder / "bomb.png").write_bytes(PNG)
    (folder / "many.obj").write_bytes(b"f 1 2 3 4 5\n" * 400_000)
    for name, size, faces in (("huge", 10**13, 5), ("many", 84 + 50 * 1_900_000, 1_900_000)):
        with (folder / f"{name}.stl").open("wb") as file:
            file.write(b"\0" * 80 + struct.pack("<I", faces))
            file.truncate(size)
    os.mkfifo(folder / "pipe.stl")


@pytest.mark.parametrize("text", WRONG, ids=range(len(WRONG)))
def test_a_broken_or_hostile_model_is_a_sentence(model, text):
    hostile(model.folder)
    wanted = WRONG[text].replace("FOLDER", str(model.folder))
    with pytest.raises(ValueError, match="cannot read") as refused:
        model(text)
    assert str(refused.value) == f"{model.folder / 'mine.xml'}: cannot read this robot: {wanted}"


def test_xml_is_refused_by_its_size(model, monkeypatch):
    monkeypatch.setattr(model_files, "MOST_TEXT", 100)
    with pytest.raises(
        ValueError, match=re.escape("'mine.xml' is too large for XML; the limit is")
    ):
        model("<mujoco>" + " " * 100 + "</mujoco>")


@pytest.mark.parametrize(
    ("name", "reason"),
    [("none.xml", "No such file or directory"), (".", "it is a folder")],
)
def test_a_model_that_is_no_file_is_a_sentence(tmp_path, name, reason):
    with pytest.raises(ValueError, match=re.escape(f"cannot read this robot: {reason}")):
        read_spec(tmp_path / name, "robot")
