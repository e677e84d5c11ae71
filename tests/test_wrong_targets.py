"""Models, meshes and pictures that cannot be a target: refused in one sentence."""

import pytest
from seen_targets import FACES, PLACED, SHEET, build, mesh_file_of, stl_of

from servo.loop.episode import Episode
from servo.mistake import Mistake
from servo.scenario.load import parse
from sim.models import mesh_file
from sim.targets import mesh

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
    "k.obj": SHEET + PLACED + "f 1/1 2/2 3/7\n",
    "l.obj": SHEET + "f 1 1 2\n",
    "a.stl": stl_of(FACES)[:-1],
    "b.stl": b"solid part\nvertex 1 2\n",
    "c.stl": b"",
    "d.stl": stl_of([]),
    "a.png": "no picture",
    "a.ply": "ply\n",
    "a.xml": "<mujoco",
    "c.xml": MODEL.format('<geom type="plane" size="1 1 1" name="ground"/>'),
    "d.xml": MODEL.format(""),
    "e.xml": MODEL.format('<geom size=".1" pos="0 0 -.2"/>'),
    "f.xml": MODEL.format('<geom size=".1" group="4"/>'),
    "g.xml": '<mujoco><asset><mesh file="gone.obj"/></asset></mujoco>',
}
NO_PICTURE = "a.png: this is not a picture; known formats are JPEG, PNG, BMP, TIFF, WebP, PPM"
WRONG = [
    ("mesh", {"file": "gone.obj"}, "gone.obj: cannot read this mesh: No such file or directory"),
    ("mesh", {"file": "."}, "file = '.': this is not shipped; there is duck (or a path)"),
    ("mesh", {"file": "dir.obj"}, "dir.obj: cannot read this mesh: it is a folder"),
    ("mesh", {"file": "duk"}, "file = 'duk': this is not shipped; there is duck (or a path)"),
    ("mesh", {"file": "a.ply"}, "a.ply: a mesh is an .obj or an .stl file"),
    ("mesh", {"file": "a.obj"}, "a.obj: there is no triangle in this mesh"),
    ("mesh", {"file": "b.obj"}, "b.obj: line 4: there is no vertex 9; there are 3 before it"),
    ("mesh", {"file": "c.obj"}, "c.obj: line 3: there is no vertex 0; there are 2 before it"),
    ("mesh", {"file": "d.obj"}, "d.obj: line 1: 'zero' is not a number"),
    ("mesh", {"file": "e.obj"}, "e.obj: line 1 is too short"),
    ("mesh", {"file": "f.obj"}, "f.obj: a vertex is not finite, or farther away than 1e+09"),
    ("mesh", {"file": "g.obj"}, "g.obj: line 1: 'a' is not the number of a vertex"),
    ("mesh", {"file": "h.obj"}, "h.obj: it has no length and no width"),
    ("mesh", {"file": "i.obj"}, "i.obj: mesh surface area is too small: mesh, Element name 'mesh'"),
    (
        "mesh",
        {"file": "j.obj", "texture": "duck"},
        "j.obj: it does not say where the texture lies on it (vt)",
    ),
    (
        "mesh",
        {"file": "k.obj"},
        "k.obj: line 9: there is no place in a picture 7; there are 4 before it",
    ),
    ("mesh", {"file": "l.obj"}, "l.obj: there is no triangle in this mesh"),
    (
        "mesh",
        {"file": "a.stl"},
        "a.stl: this STL file is cut off or damaged: it has 183 bytes, not 184",
    ),
    ("mesh", {"file": "b.stl"}, "b.stl: this STL file is cut off or damaged"),
    (
        "mesh",
        {"file": "c.stl"},
        "c.stl: this STL file is cut off or damaged: it has 0 bytes, not 84",
    ),
    ("mesh", {"file": "d.stl"}, "d.stl: there is no triangle in this mesh"),
    (
        "mesh",
        {"colour": "blue"},
        "colour = 'blue': a colour is '#rrggbb', or three numbers from 0 to 1",
    ),
    ("mesh", {"texture": "a.png"}, NO_PICTURE),
    (
        "plate",
        {"picture": "gone.png"},
        "gone.png: cannot read this picture: No such file or directory",
    ),
    (
        "plate",
        {"picture": "stones"},
        "picture = 'stones': this is not shipped; there is duck, pebbles (or a path)",
    ),
    ("box", {"picture": "a.png"}, NO_PICTURE),
    (
        "mjcf",
        {"model": "lorry"},
        "model = 'lorry': this is not shipped; there is truck (or a path)",
    ),
    ("mjcf", {"model": "gone.xml"}, "gone.xml: cannot read this target"),
    ("mjcf", {"model": "a.xml"}, "a.xml: cannot read this target: XML parse error 6"),
    ("mjcf", {"model": "c.xml"}, "c.xml: the geom 'ground' is a plane, which cannot move"),
    (
        "mjcf",
        {"model": "d.xml"},
        "d.xml: nothing of it is seen from above the table, whose top is at z = 0",
    ),
    (
        "mjcf",
        {"model": "e.xml"},
        "e.xml: nothing of it is seen from above the table, whose top is at z = 0",
    ),
    (
        "mjcf",
        {"model": "f.xml"},
        "f.xml: nothing of it is seen from above the table, whose top is at z = 0",
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


def test_limits_are_named_before_a_file_is_taken_in(model_folder, monkeypatch):
    name = mesh_file_of(model_folder)
    monkeypatch.setattr(mesh_file, "MOST_FACES", 11)
    with pytest.raises(ValueError, match=r"^part.obj: this mesh has 12 faces; the limit is 11$"):
        build(mesh.Config(file=name))
    monkeypatch.setattr(mesh_file, "LARGEST", 100)
    with pytest.raises(ValueError, match="it is too large; the limit is 100 bytes"):
        build(mesh.Config(file=name))


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
