"""Models of others: read by MuJoCo in the layouts that are usual, or refused in one sentence."""

import re
from pathlib import Path

import cv2
import mujoco
import numpy as np
import pytest
from robot_files import write_obj, write_stl
from seen_targets import FACES, stl_of, stl_text

from sim.camera.camera import CameraConfig
from sim.files.behind import files_behind
from sim.files.notices import Notice
from sim.models.assembly import build_model
from sim.models.mesh_file import read_mesh
from sim.models.model_files import SIMULATION, compiled, leave_out
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
        ("file:FOLDER/meshes/part.stl", ""),
        ("package://mine/meshes/part.stl", ""),
        ("part.stl", '<mujoco><compiler meshdir="../meshes"/></mujoco>'),
    ],
)
def test_a_urdf_shows_its_visual_meshes_and_keeps_its_limits(package, mesh, extension):
    (package / "package.xml").write_text("<package><name>mine</name></package>")
    text = URDF.format(mesh=mesh, extension=extension).replace("FOLDER", str(package))
    path = written(package, text, "mine.urdf")
    model = compiled(read_spec(path, "robot"))
    assert (model.ngeom, model.nmesh) == (1, 1)
    assert model.jnt_range.tolist() == [[-1.0, 2.0]]
    assert package / "meshes" / "part.stl" in files_behind(path)


def test_a_urdf_without_readable_visuals_shows_its_collision_shapes(package):
    path = written(package, URDF.format(mesh="meshes/part.dae", extension=""), "mine.urdf")
    with pytest.warns(Notice, match=r"mine.urdf: not drawn: part.dae \(no such file\)$"):
        model = compiled(read_spec(path, "robot"))
    assert (model.ngeom, model.nmesh, model.geom_size[0, 0]) == (1, 0, 0.1)


PACKAGES = {
    "beside": ("src/cell/urdf", "src/arm_description", ""),
    "around": ("src/arm_description/urdf", "src/arm_description", ""),
    "around, of another folder's name": ("src/main/urdf", "src/main", "src/main"),
    "beside, of another folder's name": ("src/cell/urdf", "src/arm_repo", "src/arm_repo"),
    "in a repository beside": ("src/cell/urdf", "src/vendor/arm_description", ""),
    "in a repository, of another name": ("src/cell/urdf", "src/vendor/arm", "src/vendor/arm"),
    "installed": ("i/cell/share/cell/urdf", "i/arm_description/share/arm_description", ""),
    "installed beside src": ("src/cell", "install/arm_description/share/arm_description", ""),
}
FOREIGN = "another package's mesh of this name"


@pytest.mark.parametrize(
    "name",
    [
        "package://arm_description/meshes/my part.stl",
        "package://arm_description/meshes/my%20part.stl",
        "model://arm_description/meshes/my part.stl",
        "$(find arm_description)/meshes/my part.stl",
        r"package://arm_description\meshes\my part.stl",
    ],
)
@pytest.mark.parametrize("layout", PACKAGES)
def test_a_mesh_is_taken_from_its_own_package(tmp_path, layout, name):
    models, package, named = PACKAGES[layout]
    for folder in (models, f"{package}/meshes"):
        (tmp_path / folder).mkdir(parents=True, exist_ok=True)
    write_stl(tmp_path / package / "meshes" / "my part.stl")
    other = (tmp_path / models).parent / "meshes"
    if not other.exists():
        other.mkdir()
        (other / "my part.stl").write_text(FOREIGN)
        (other.parent / "package.xml").write_text("<package><name>cell</name></package>")
    if named:
        text = "<package>\n<name> arm_description </name></package>"
        (tmp_path / named / "package.xml").write_text(text)
    path = tmp_path / models / "mine.urdf"
    path.write_text(URDF.format(mesh=name, extension=""))
    assert compiled(read_spec(path, "robot")).nmeshface == 12
    behind = files_behind(path)
    assert tmp_path / package / "meshes" / "my part.stl" in behind
    assert not named or tmp_path / named / "package.xml" in behind


def test_a_linked_package_finds_those_beside_the_link(tmp_path):
    for folder in ("home/cell", "src/arm_description"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "src" / "cell").symlink_to(tmp_path / "home" / "cell")
    write_stl(tmp_path / "src" / "arm_description" / "part.stl")
    path = tmp_path / "src" / "cell" / "mine.urdf"
    path.write_text(URDF.format(mesh="package://arm_description/part.stl", extension=""))
    assert compiled(read_spec(path, "robot")).nmeshface == 12
    assert tmp_path / "src" / "arm_description" / "part.stl" in files_behind(path)


def test_it_is_said_that_a_mesh_is_of_no_package_of_its_name(package):
    text = URDF.format(mesh="package://arm_description/meshes/part.stl", extension="")
    path = written(package, text, "mine.urdf")
    sentence = f"{path}: there is no package 'arm_description' around it; its files are taken from "
    with pytest.warns(Notice, match=f"^{re.escape(f'{sentence}{package}')}$"):
        assert compiled(read_spec(path, "robot")).nmeshface == 12


def test_a_mesh_is_looked_for_in_the_folder_for_meshes_first(package):
    for folder in (package, package / "models"):
        (folder / "part.stl").write_text("another mesh of this name")
    extension = '<mujoco><compiler meshdir="../meshes"/></mujoco>'
    path = written(package, URDF.format(mesh="part.stl", extension=extension), "mine.urdf")
    assert compiled(read_spec(path, "robot")).nmeshface == 12


def test_a_package_may_be_the_folder_of_meshes_itself(tmp_path):
    (tmp_path / "meshes").mkdir()
    write_stl(tmp_path / "meshes" / "part.stl")
    path = tmp_path / "mine.urdf"
    path.write_text(URDF.format(mesh="package://meshes/part.stl", extension=""))
    assert compiled(read_spec(path, "robot")).nmeshface == 12


ODD_MESHES = {
    "text.stl": stl_text(FACES),
    "flat.stl": stl_of(FACES),
    "flat.ply": b"ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
    b"property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
    b"0 0 0\n40 0 0\n40 10 0\n0 10 0\n3 0 1 2\n3 0 2 3\n",
}


@pytest.mark.parametrize("name", ODD_MESHES)
@pytest.mark.parametrize("kind", ["xml", "urdf"])
def test_meshes_that_mujoco_refuses_are_read_all_the_same(package, name, kind):
    (package / "meshes" / name).write_bytes(ODD_MESHES[name])
    urdf = URDF.format(mesh=f"../meshes/{name}", extension="")
    both = f'<asset><mesh name="part" file="{name}"/></asset>'
    text = mjcf_text(both, BODY, '<compiler meshdir="../meshes"/>') if kind == "xml" else urdf
    model = compiled(read_spec(written(package, text, f"mine.{kind}"), "robot"))
    assert (model.nmesh, model.nmeshface) == (1, 2)
    np.testing.assert_allclose(sorted(2 * model.geom_aabb[0, 3:]), [0, 10, 40], atol=1e-4)


@pytest.mark.processes  # it takes seconds
def test_a_mesh_may_have_more_triangles_than_mujoco_reads(package):
    path = package / "meshes" / "large.stl"
    path.write_bytes(stl_of(np.tile(FACES, (100_001, 1, 1))))
    text = mjcf_text('<asset><mesh name="part" file="../meshes/large.stl"/></asset>', BODY)
    assert compiled(read_spec(written(package, text), "robot")).nmeshface == 200_002
    assert len(read_mesh(path).faces) == 200_002


INERTIAL = (
    '<inertial><mass value="{}"/><inertia ixx="{}" ixy="0" ixz="0" iyy="{}" iyz="0" izz="1"/>'
    "</inertial><visual>"
)
UNSOUND = {
    "inertia.urdf": (URDF.replace("<visual>", INERTIAL.format(1, -1, 1)), "part"),
    "moment.urdf": (
        URDF.replace("<visual>", INERTIAL.format(1, 1, 1).replace(' izz="1"', "")),
        "part",
    ),
    "weight.urdf": (
        URDF.replace("<visual>", INERTIAL.format(1, 1, 1).replace(' value="1"', "")),
        "part",
    ),
    "mass.urdf": (URDF.replace("<visual>", INERTIAL.format("inf", 1, 1)), "part"),
    "full.xml": (
        mjcf_text(
            bodies='<body name="arm"><joint/>'
            '<inertial pos="0 0 0" mass="1" fullinertia="-1 1 1 0 0 0"/></body>'
        ),
        "arm",
    ),
    "unequal.xml": (
        mjcf_text(
            bodies='<body name="arm"><joint/>'
            '<inertial pos="0 0 0" mass="1" diaginertia="1 1 3"/></body>'
        ),
        "arm",
    ),
    "none.xml": (mjcf_text(bodies='<body name="arm"><joint/></body>'), "arm"),
}


@pytest.mark.parametrize("name", UNSOUND)
def test_an_inertia_that_no_body_has_is_corrected(package, name):
    text, body = UNSOUND[name]
    text = text.replace("{mesh}", "../meshes/part.stl").replace("{extension}", "")
    path = written(package, text, name)
    with pytest.warns(Notice, match=f"{name}: mass or inertia corrected: {body}$"):
        model = compiled(read_spec(path, "robot"))
    assert np.isfinite(model.body_mass).all()
    assert (model.body_inertia[model.body(body).id] > 0).all()


GONE = {
    "a mesh": ('<mesh name="part" file="gone.stl"/>', BODY, r"gone.stl \(no such file\)"),
    "a damaged mesh": (
        '<mesh name="part" file="../meshes/damaged.stl"/>',
        BODY,
        r"damaged.stl \(it cannot be read\)",
    ),
    "a line": (
        '<mesh name="part" file="../meshes/line.obj"/>',
        BODY,
        r"line.obj \(it has no area\)",
    ),
    "Collada": ('<mesh name="part" file="../meshes/part.dae"/>', BODY, "part.dae"),
    "a picture": (
        '<texture name="t" type="2d" file="gone.png"/><material name="m" texture="t"/>',
        '<body name="link"><joint/><geom size=".1" material="m"/></body>',
        r"gone.png \(no such file\)",
    ),
    "a shape without a size": (
        "",
        '<body name="link"><joint/><geom size=".1"/><geom size="0"/></body>',
        r"a shape of 'link' \(it has no size\)",
    ),
}


@pytest.mark.parametrize("what", GONE)
def test_what_cannot_be_drawn_of_a_robot_is_left_out_and_named(package, what):
    (package / "meshes" / "damaged.stl").write_bytes(b"damaged")
    (package / "meshes" / "line.obj").write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
    (package / "meshes" / "part.dae").write_bytes(b"<COLLADA/>")
    assets, bodies, said = GONE[what]
    path = written(package, mjcf_text(f"<asset>{assets}</asset>", bodies))
    with pytest.raises(ValueError, match="cannot read this target: "):
        read_spec(path, "target")  # a target is what is seen of it
    with pytest.warns(Notice, match=f"mine.xml: not drawn: {said}"):
        model = compiled(read_spec(path, "robot", whole=False))
    assert (model.njnt, model.nmesh, model.ngeom) == (1, 0, "size" in bodies)


def test_a_robot_without_shapes_is_drawn_as_sticks(package):
    text = (
        URDF.replace("<axis", '<origin xyz="0 0 .3"/><axis')
        .replace("<sphere", "<mesh")
        .replace('radius="0.1"', 'filename="part.dae"')
    )
    path = written(package, text.format(mesh="part.dae", extension=""), "mine.urdf")
    with pytest.warns(Notice, match=r"not drawn: part.dae \(no such file\)"):
        model = compiled(read_spec(path, "robot", whole=False))
    assert model.geom_size[0, 1] == pytest.approx(0.15)  # half of the link


def test_a_material_may_show_a_sky(package):
    sky = (
        '<asset><texture name="sky" type="skybox" builtin="flat" width="8" height="8"/>'
        '<texture name="other" type="skybox" builtin="flat" width="8" height="8"/>'
        '<material name="chrome" texture="sky"/></asset>'
    )
    body = '<body name="link"><joint/><geom size=".1" material="chrome"/></body>'
    spec = read_spec(written(package, mjcf_text(sky, body)), "robot")
    leave_out(spec, SIMULATION)
    room = mujoco.MjSpec()
    room.attach(spec, prefix="robot/", frame=room.worldbody.add_frame())
    model = compiled(room)
    assert model.ntex == 1
    assert model.mat_texid[0, mujoco.mjtTextureRole.mjTEXROLE_RGB] == 0


def test_an_obj_of_a_urdf_has_the_colours_of_its_materials(package):
    (package / "meshes" / "two.obj").write_text(
        "mtllib two.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
        "usemtl red\nf 1 2 3\nusemtl blue\nf 1 2 4\n"
    )
    (package / "meshes" / "two.mtl").write_text("newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n")
    text = URDF.format(mesh="../meshes/two.obj", extension="")
    model = compiled(read_spec(written(package, text, "mine.urdf"), "robot"))
    assert sorted(model.geom_rgba.tolist()) == [[0, 0, 1, 1], [1, 0, 0, 1]]
    own = '<material name="m"><color rgba="0 1 0 1"/></material></visual>'
    path = written(package, text.replace("</visual>", own), "own.urdf")
    assert compiled(read_spec(path, "robot")).geom_rgba.tolist() == [[0, 1, 0, 1]]


def test_elements_of_other_programs_are_skipped(package):
    sensor = '<gazebo xmlns:sensor="http://x.org/s"><sensor:camera name="c"/></gazebo></robot>'
    text = URDF.format(mesh="../meshes/part.stl", extension="").replace("</robot>", sensor)
    assert compiled(read_spec(written(package, text, "mine.urdf"), "robot")).njnt == 1


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
    ("mine.xml", mjcf_text(bodies='<geom type="mesh" mesh="none"/>')): "mesh 'none' not found",
    ("mine.urdf", "<robot>"): "no element found: line 1, column 7",
    (
        "mine.urdf",
        XACRO,
    ): "the file has xacro elements: expand it first (xacro IN > OUT)",
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
