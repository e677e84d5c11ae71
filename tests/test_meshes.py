"""Meshes of OBJ and STL files as targets: their size, their rectangle, and that they are seen."""

import re

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
    assert mesh.read_mesh(model_folder / "part.stl").vertices.shape == (4, 3)
