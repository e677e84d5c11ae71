"""Models, meshes and pictures that cannot be a target: refused in one sentence."""

import pytest
from seen_targets import FACES, SHEET, stl_of

from servo.loop.episode import Episode
from servo.mistake import Mistake
from servo.scenario.load import parse

MODEL = "<mujoco><worldbody>{}</worldbody></mujoco>"
BROKEN = {
    "a.obj": "",
    "b.obj": "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 9\n",
    "c.obj": "v 0 0 0\nv 1 0 0\nf 0 1 2\n",
    "d.obj": "v 0 zero 0\n",
    "e.obj": "v 0 0\n",
    "f.obj": "v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n",
    "g.obj": "f a b c\n",
    "h.obj": "v 0 0 0\nv 0 0 1\nv 0 0 2\nf 1 2 3\n",
    "i.obj": "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n",
    "j.obj": SHEET + "f 1 2 3 4\n",
    "l.obj": SHEET + "f 1 1 2\n",
    "a.stl": stl_of(FACES)[:-1],
    "b.stl": b"solid part\nvertex 1 2\n",
    "c.stl": b"",
    "d.stl": stl_of([]),
    "a.png": "no picture",
    "a.ply": "ply\n",
    "a.xml": "<mujoco",
    "c.xml": MODEL.format('<geom type="plane" size="1 1 1" name="ground"/>'),
    "unnamed.xml": MODEL.format('<geom type="plane" size="1 1 1"/>'),
    "d.xml": MODEL.format(""),
    "e.xml": MODEL.format('<geom size=".1" pos="0 0 -.2"/>'),
    "f.xml": MODEL.format('<geom size=".1" group="4"/>'),
    "g.xml": '<mujoco><asset><mesh file="gone.obj"/></asset></mujoco>',
}
NO_PICTURE = (
    "a.png: this picture cannot be decoded; known formats are JPEG, PNG, BMP, TIFF, WebP, PPM"
)
NOT_ABOVE = (
    "no visible part of the target lies above the table's top, z = 0: move the model up, or give it "
    "visible shapes"
)
WRONG = [
    ("mesh", {"file": "gone.obj"}, "gone.obj: cannot read this mesh: No such file or directory"),
    ("mesh", {"file": "."}, ".: this is not a mesh of a target: give an .obj or .stl file"),
    ("mesh", {"file": "dir.obj"}, "dir.obj: cannot read this mesh: it is a folder"),
    (
        "mesh",
        {"file": "duk"},
        "file = 'duk': no file of this name is shipped; give duck, or a path",
    ),
    ("mesh", {"file": "a.ply"}, "a.ply: this is not a mesh of a target: give an .obj or .stl file"),
    (
        "mesh",
        {"file": "a.obj"},
        "a.obj: there is no triangle with an area in this mesh: give another file",
    ),
    (
        "mesh",
        {"file": "b.obj"},
        "b.obj: this mesh is damaged, or not of the format that its suffix says: export it again",
    ),
    (
        "mesh",
        {"file": "c.obj"},
        "c.obj: there is no triangle with an area in this mesh: give another file",
    ),
    (
        "mesh",
        {"file": "d.obj"},
        "d.obj: this mesh is damaged, or not of the format that its suffix says: export it again",
    ),
    (
        "mesh",
        {"file": "e.obj"},
        "e.obj: this mesh is damaged, or not of the format that its suffix says: export it again",
    ),
    ("mesh", {"file": "f.obj"}, "f.obj: the vertex nan 1 0 is not finite: correct it"),
    pytest.param(  # before version 5, trimesh could not read it
        *(
            "mesh",
            {"file": "g.obj"},
            "g.obj: there is no triangle with an area in this mesh: give another file",
        ),
        marks=pytest.mark.newest,
    ),
    (
        "mesh",
        {"file": "h.obj"},
        "h.obj: all points of the mesh lie on one vertical line: choose another axis as up, or "
        "correct the file",
    ),
    ("mesh", {"file": "i.obj"}, "i.obj: mesh surface area is too small: mesh, Element name 'mesh'"),
    (
        "mesh",
        {"file": "j.obj", "texture": "duck"},
        "j.obj: the mesh has no texture coordinates (vt) for the texture: add them to the file, or "
        "leave texture out",
    ),
    (
        "mesh",
        {"file": "l.obj"},
        "l.obj: there is no triangle with an area in this mesh: give another file",
    ),
    (
        "mesh",
        {"file": "a.stl"},
        "a.stl: this mesh is damaged, or not of the format that its suffix says: export it again",
    ),
    (
        "mesh",
        {"file": "b.stl"},
        "b.stl: there is no triangle with an area in this mesh: give another file",
    ),
    (
        "mesh",
        {"file": "c.stl"},
        "c.stl: there is no triangle with an area in this mesh: give another file",
    ),
    (
        "mesh",
        {"file": "d.stl"},
        "d.stl: there is no triangle with an area in this mesh: give another file",
    ),
    (
        "mesh",
        {"colour": "blue"},
        "colour = 'blue': this colour is not known: give '#rrggbb', or three numbers from 0 to 1",
    ),
    ("mesh", {"texture": "a.png"}, f"texture: {NO_PICTURE}"),
    (
        "plate",
        {"picture": "gone.png"},
        "picture: gone.png: cannot read this picture: No such file or directory",
    ),
    (
        "plate",
        {"picture": "stones"},
        "picture = 'stones': no file of this name is shipped; give coffee, duck, pebbles, or a path",
    ),
    ("box", {"picture": "a.png"}, f"picture: {NO_PICTURE}"),
    (
        "mjcf",
        {"model": "lorry"},
        "model = 'lorry': no file of this name is shipped; give truck, or a path",
    ),
    ("mjcf", {"model": "gone.xml"}, "gone.xml: cannot read this target"),
    ("mjcf", {"model": "a.xml"}, "a.xml: cannot read this target: XML parse error 6"),
    (
        "mjcf",
        {"model": "c.xml"},
        "c.xml: the geom 'ground' is a plane, which cannot move: delete it",
    ),
    (
        "mjcf",
        {"model": "unnamed.xml"},
        "unnamed.xml: the geom of the body 'world' is a plane, which cannot move: delete it",
    ),
    (
        "mjcf",
        {"model": "d.xml"},
        f"d.xml: {NOT_ABOVE}",
    ),
    (
        "mjcf",
        {"model": "e.xml"},
        f"e.xml: {NOT_ABOVE}",
    ),
    (
        "mjcf",
        {"model": "f.xml"},
        f"f.xml: {NOT_ABOVE}",
    ),
    ("mjcf", {"model": "g.xml"}, "g.xml: cannot read this target: "),
]


@pytest.mark.parametrize(("kind", "settings", "said"), WRONG, ids=lambda w: str(w)[:40])
def test_what_cannot_be_a_target_is_one_sentence(model_folder, kind, settings, said):
    (model_folder / "dir.obj").mkdir()
    for name, content in BROKEN.items():
        (model_folder / name).write_bytes(
            content if isinstance(content, bytes) else content.encode()
        )
    scenario = parse({"target": {"kind": kind} | settings}, "mine", "mine.toml")
    with pytest.raises(Mistake) as found:
        Episode(scenario)
    sentence = str(found.value)
    assert sentence.startswith(f"mine: target: {said}"), sentence
    assert "\\n" not in sentence


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"colour": [2, 0, 0]}, "colour.0 = 2: input should be less than or equal to 1"),
        ({"colour": [0, 0]}, "colour.2: a value is missing"),
        ({"colour": True}, "colour = True: input should be a valid string"),
        ({"size": "large"}, "size = 'large': input should be a valid number"),
        ({"size": [0.1, 0.1, 9.0]}, "size.2 = 9.0: input should be less than or equal to 5"),
        ({"size": 0.0}, "size = 0.0: input should be greater than or equal to 0.001"),
        ({"up": "w"}, "up = 'w': input should be 'x', 'y' or 'z'"),
        ({"outline": [0.1, 0.1]}, "outline.2: a value is missing"),
    ],
)
def test_a_value_that_may_have_several_forms_is_refused_for_the_nearest(settings, said):
    with pytest.raises(Mistake) as found:
        parse({"target": {"kind": "mesh"} | settings}, "mine", "mine.toml")
    assert str(found.value) == f"mine.toml: target.{said}"
