"""Meshes of OBJ and STL files as targets: their size, their rectangle, and that they are seen."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from seen_targets import (
    CUBE,
    FACES,
    SHEET,
    build,
    mesh_file_of,
    rectangle_of,
    stl_of,
    stl_text,
)

from sim.files.notices import Notice, notice
from sim.models.mesh_file import read_mesh
from sim.targets import mesh


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({}, (0.2, 0.2 / 3, 0.1 / 3)),
        ({"size": 0.3}, (0.3, 0.1, 0.05)),
        ({"size": (0.1, 0.2, 0.3)}, (0.1, 0.2, 0.3)),
        ({"up": "y"}, (0.2, 0.1 / 3, 0.2 / 3)),
        ({"up": "x"}, (0.2, 0.1, 0.6)),
        ({"turn_deg": 90.0}, (0.2 / 3, 0.2, 0.1 / 3)),
        ({"outline": (0.12, 0.08, 0.03)}, (0.12, 0.08, 0.03)),
    ],
)
def test_the_rectangle_of_a_mesh_is_found(model_folder, settings, expected):
    target = build(mesh.Config(file=mesh_file_of(model_folder), **settings))
    np.testing.assert_allclose(rectangle_of(target), [*expected, 0.0, 0.0], atol=1e-3)
    assert target.found == ("outline" not in settings)


def test_a_longer_side_along_y_becomes_the_length(model_folder):
    turned = re.sub(r"v (\d+) (\d+)", r"v \2 \1", CUBE)  # inside out, too
    target = build(mesh.Config(file=mesh_file_of(model_folder, turned)))
    np.testing.assert_allclose(rectangle_of(target)[:3], [0.2, 0.2 / 3, 0.1 / 3], atol=1e-3)


OPEN = {
    "inside out": re.sub(r"f (\d) (\d) (\d) (\d)", r"f \4 \3 \2 \1", CUBE),
    "without a bottom": CUBE.replace("f 4 3 2 1\n", ""),
    "half turned": CUBE.replace("f 5 6 7 8", "f 8 7 6 5"),
    "in micrometres": CUBE.replace("00 ", "00000 ").replace("50", "50000"),
    "counted from the end": CUBE.replace("f 5 6 7 8", "f -4 -3 -2 -1"),
    "with normals": CUBE.replace("f 5 6 7 8", "vn 0 0 1\nf 5//1 6//1 7//1 8//1"),
    "with a needle": CUBE + "f 1 1 2\n",
}


@pytest.mark.parametrize("case", OPEN)
def test_meshes_that_are_not_as_they_should_be_are_seen_all_the_same(
    show_target, model_folder, case
):
    image, truth, world = show_target(
        mesh.Config(file=mesh_file_of(model_folder, OPEN[case]), colour="#00ff00")
    )
    np.testing.assert_allclose(rectangle_of(world)[:3], [0.2, 0.2 / 3, 0.1 / 3], atol=1e-3)
    top = image[int(truth.centre[1]), int(truth.centre[0])]
    assert top[1] > 3 * max(top[0], top[2])
    assert top[1] > 120
    assert truth.visible == 1.0


def test_a_flat_mesh_lies_over_the_table(show_target, model_folder):
    upside_down = mesh_file_of(model_folder, SHEET + "f 4 3 2 1\n")
    image, _, world = show_target(mesh.Config(file=upside_down, colour="#00ff00"))
    np.testing.assert_allclose(rectangle_of(world), [0.2, 0.1, 0.001, 0, 0], atol=1e-6)
    assert image[120, 160, 1] > 3 * image[120, 160, 0]


@pytest.mark.parametrize("data", [stl_of(FACES), stl_text(FACES), b"SOLID" + stl_text(FACES)[5:]])
def test_binary_and_written_stl_files_are_read(model_folder, data):
    (model_folder / "part.STL").write_bytes(data)
    target = build(mesh.Config(file="part.STL"))
    np.testing.assert_allclose(rectangle_of(target)[:3], [0.2, 0.05, 0.001], atol=1e-6)


def test_equal_vertices_become_one(model_folder):
    (model_folder / "part.stl").write_bytes(stl_of(FACES))
    assert read_mesh(model_folder / "part.stl").vertices.shape == (4, 3)


TOPS = """mtllib the two.mtl
v 0 0 0
v 10 0 0
v 20 0 0
v 0 10 0
v 10 10 0
v 20 10 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
usemtl left side
f 1/1 2/2 5/3 4/4
usemtl right
f 2/1 3/2 6/3 5/4
"""
"""A sheet of two materials."""
RED_AND_GREEN = "newmtl left side\nKd 1 0 0\nnewmtl right\nKd 0 1 0\n"
BLUE = RED_AND_GREEN + "map_Kd -s 1 1 1 C:\\Users\\me\\blue.png\n"
BOTH = {
    "colours": (RED_AND_GREEN, {}, "rg"),
    "a picture, of another computer": (BLUE, {}, "rb"),
    "a colour of the scenario": (BLUE, {"colour": "#0000ff"}, "bb"),
    "a picture of the scenario": (RED_AND_GREEN, {"texture": "blue.png"}, "bb"),
    "a picture in a folder of Windows": (RED_AND_GREEN + "map_Kd in\\one.png", {}, "rb"),
    "tabs": (
        RED_AND_GREEN.replace("Kd ", "Kd\t").replace("newmtl ", "newmtl\t"),
        {"text": TOPS.replace("usemtl ", "usemtl\t")},
        "rg",
    ),
    "two files of materials": (
        RED_AND_GREEN,
        {"text": "mtllib red.mtl\n" + TOPS.replace("left side", "red")},
        "rg",
    ),
    "windows' line ends": (RED_AND_GREEN.replace("\n", "\r\n"), {}, "rg"),
}


def _strongest(pixel):
    k = int(pixel.argmax())
    return "rgb"[k] if pixel[k] > 2 * pixel.sum() / 3 else "-"


@pytest.fixture
def show_sides(show_target, model_folder):
    """Returns the strongest of red, green and blue on the left and the right side of a mesh."""

    def sides(materials, text=TOPS, renderer="opengl", **settings):
        blue = np.zeros((4, 4, 3), np.uint8)
        blue[..., 0] = 255
        cv2.imwrite(str(model_folder / "blue.png"), blue)
        (model_folder / "in").mkdir(exist_ok=True)
        cv2.imwrite(str(model_folder / "in" / "one.png"), blue)
        (model_folder / "red.mtl").write_text("newmtl red\nKd 1 0 0\n")
        (model_folder / "the two.mtl").write_text(materials, newline="")
        config = mesh.Config(file=mesh_file_of(model_folder, text), size=0.2, **settings)
        image, truth, _ = show_target(config, renderer=renderer)
        (x, y), shift = truth.centre.astype(int), 10
        pixels = image[y, [x - shift, x + shift]].astype(int)
        return "".join(_strongest(pixel) for pixel in pixels)

    return sides


@pytest.mark.parametrize("renderer", ["opengl", "exact"])
@pytest.mark.parametrize("case", BOTH)
def test_an_obj_has_the_colours_and_pictures_of_its_materials(show_sides, case, renderer):
    materials, settings, expected = BOTH[case]
    assert show_sides(materials, renderer=renderer, **settings) == expected


LESS = {
    "one of two files of materials": (
        RED_AND_GREEN,
        "mtllib gone.mtl\n" + TOPS,
        "rg",
        "gone.mtl (no such file)",
    ),
    "no file of materials": (
        RED_AND_GREEN,
        TOPS.replace("the two", "gone"),
        "--",
        "gone.mtl (no such file)",
    ),
    "no picture": (
        RED_AND_GREEN + "map_Kd lost.png",
        TOPS,
        "rg",
        "lost.png (no such file)",
    ),
    "no places": (
        BLUE,
        re.sub("/[1-4]", "", TOPS),
        "rg",
        "the picture of right (the mesh has no vt)",
    ),
    "another material": (
        RED_AND_GREEN,
        TOPS.replace("usemtl right", "usemtl wrong"),
        "r-",
        "wrong (no .mtl file describes it)",
    ),
}


@pytest.mark.parametrize("case", LESS)
def test_materials_that_are_missing_are_named(show_sides, case):
    materials, text, expected, missing = LESS[case]
    notice.cache_clear()
    with pytest.warns(Notice, match=f"^part.obj: not drawn: {re.escape(missing)}$"):
        assert show_sides(materials, text) == expected


def test_materials_that_are_not_wanted_are_not_missed(show_sides):
    assert show_sides("", TOPS.replace("the two", "gone"), colour="#00ff00") == "gg"


def test_a_mesh_with_places_in_a_picture_and_no_material_has_no_material():
    """Its colour is then the target's; trimesh makes up a grey one."""
    duck = Path(__file__).parents[1] / "scenes" / "targets" / "duck.obj"
    assert read_mesh(duck).materials == (None,)
