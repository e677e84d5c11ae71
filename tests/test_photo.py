"""Straightened photographs are true to size, and what is no photograph of the sheet is a sentence."""

import tomllib

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from photographed import (
    dots_in,
    ground,
    lattice,
    photograph,
    printed,
    turned,
    with_sheet,
)

from servo.cli.main import app
from servo.mistake import Mistake
from servo.photo import sheet as sheets
from servo.photo.detection import edge_width
from servo.photo.fill import filled
from servo.photo.photograph import largest_rectangle
from servo.scenario.load import load
from sim.camera.distortion import Distortion
from sim.files.picture_file import read_image

TURN = 0.2
LENS = Distortion("plumb_bob", (-0.25, 0.08, 0.001, -0.001, 0.0))
CAMERA = """
image_width: 800
image_height: 600
camera_matrix: {rows: 3, cols: 3, data: [670, 0, 399.5, 0, 670, 299.5, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.25, 0.08, 0.001, -0.001, 0]}
"""


@pytest.fixture(scope="module")
def plane():
    return with_sheet(ground(), printed(), TURN)


@pytest.fixture(scope="module")
def plain(plane):
    """A photograph."""
    return photograph(plane, (0.05, -0.2, 0.8))[0]


@pytest.fixture(scope="module")
def bent(plane):
    """A photograph through a lens."""
    return photograph(plane, (0.05, -0.1, 0.8), 670.0, lens=LENS, blur=1.0, noise=4.0)[0]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write(name, image):
    cv2.imwrite(name, image[..., ::-1])
    return name


def photo(*words):
    return CliRunner().invoke(app, ["photo", *map(str, words)])


def refusal(*words):
    done = photo(*words)
    assert isinstance(done.exception, Mistake), done.output
    return str(done.exception)


def table_of(output, name):
    """The TOML lines that a command printed below a heading."""
    return tomllib.loads(output.split(f"{name}:\n")[1].split("\n\n")[0])


@pytest.mark.wide
@pytest.mark.parametrize("kind", ["sharp", "hard", "bent"])
def test_dots_on_the_plane_are_where_they_were(folder, plane, bent, kind):
    image = bent
    if kind != "bent":
        eye, blur, noise = (
            ((0.1, -0.5, 0.8), 0, 0) if kind == "sharp" else ((-0.4, -0.6, 0.7), 1.2, 6)
        )
        image, _ = photograph(plane, eye, blur=blur, noise=noise)
    (folder / "camera.yaml").write_text(CAMERA)
    lens = ["--calibration", "camera.yaml"] if kind == "bent" else []
    done = photo(write("a.png", image), "--covered", "keep", *lens)
    assert done.exit_code == 0, done.output
    assert "a.png: 6 of 6 tags, to 0." in done.output
    tile = table_of(done.output, "as the ground")["ground"]["tile"]
    dots = dots_in(read_image(folder / "ground.png"), tile)
    assert len(dots) >= 8
    # The sheet's frame is turned against the plane's, and the picture's middle is not the sheet's.
    wanted = lattice() @ turned(TURN)
    shift = best_shift(dots, wanted)
    apart = np.linalg.norm(dots[:, None] - shift - wanted, axis=2)
    assert apart.min(axis=1).max() < 0.003
    matched = wanted[apart.argmin(axis=1)]
    spread = [np.linalg.norm(each - each.mean(axis=0)) for each in (dots, matched)]
    assert spread[0] / spread[1] == pytest.approx(1.0, abs=0.004)


def best_shift(dots, wanted):
    """The shift by which most dots come near a wanted place, refined."""
    shifts = (dots[:, None] - wanted).reshape(-1, 2)
    near = [
        (np.linalg.norm(dots[:, None] - s - wanted, axis=2).min(axis=1) < 0.01).sum()
        for s in shifts
    ]
    shift = shifts[int(np.argmax(near))]
    apart = dots[:, None] - shift - wanted
    nearest = np.linalg.norm(apart, axis=2).argmin(axis=1)
    return shift + np.median(apart[np.arange(len(dots)), nearest], axis=0)


@pytest.mark.wide
def test_without_its_calibration_a_bent_picture_is_less_true(folder, bent):
    (folder / "camera.yaml").write_text(CAMERA)
    write("a.png", bent)
    errors = [
        float(photo("a.png", "--out", f"{k}.png", *more).output.split("to ")[1].split(" mm")[0])
        for k, more in enumerate(([], ["--calibration", "camera.yaml"]))
    ]
    assert errors[1] < 0.15 < errors[0]


@pytest.mark.wide
def test_the_sheets_place_is_filled_from_beside_it(folder, plain):
    write("a.png", plain)
    for covered in ("keep", "fill", "crop"):
        done = photo("a.png", "--out", f"{covered}.png", "--covered", covered)
        assert done.exit_code == 0, done.output
    kept, fill, crop = (read_image(folder / f"{name}.png") for name in ("keep", "fill", "crop"))
    white = [float((each.min(axis=2) > 200).mean()) for each in (kept, fill, crop)]
    assert white[0] > 0.01
    assert max(white[1:]) < 0.0005
    assert kept.shape == fill.shape
    assert crop.size < 0.8 * kept.size
    plain, there = cv2.cvtColor(fill, cv2.COLOR_RGB2GRAY), kept.min(axis=2) > 200
    around = cv2.dilate(there.astype(np.uint8), np.ones((41, 41))) > 0
    ring = around & ~there & (kept.min(axis=2) > 60)
    assert abs(plain[there].mean() - plain[ring].mean()) < 12


@pytest.mark.wide
def test_of_several_photographs_the_one_that_shows_most_is_taken(plane, plain):
    near, _ = photograph(plane, (0.02, -0.1, 0.5))
    done = photo(write("near.png", near), write("far.png", plain), "--covered", "keep")
    assert ", of far.png" in done.output


@pytest.mark.wide
def test_a_sheet_of_another_size_makes_the_plane_larger(plain):
    write("a.png", plain)
    tiles = [
        table_of(photo("a.png", "--out", f"{side}.png", "--side", side).output, "as the ground")
        for side in (60, 90)
    ]
    own, larger = (each["ground"]["tile"] for each in tiles)
    assert larger == pytest.approx(1.5 * own, rel=0.02)


def test_the_printed_lines_are_those_of_a_scenario(plain):
    output = photo(write("a.png", plain)).output
    plate = table_of(output, "as a plate")["target"]
    table = table_of(output, "as the ground")["ground"]
    found = load("still", [f"ground={inline(table)}", f"target={inline(plate)}"])
    assert found.ground.tile == found.target.length == table["tile"]
    height, width = read_image(
        found.ground.file and __import__("pathlib").Path("ground.png")
    ).shape[:2]
    assert plate["width"] / plate["length"] == pytest.approx(height / width, rel=0.01)


def inline(table):
    return "{" + ", ".join(f"{k}={v!r}".replace("'", '"') for k, v in table.items()) + "}"


@pytest.mark.parametrize("paper", ["a4", "letter"])
def test_the_sheet_has_its_true_size_and_its_tags_are_read(folder, paper):
    for suffix in ("pdf", "svg", "png"):
        done = photo("--sheet", f"sheet.{suffix}", "--paper", paper)
        assert done.output == (
            f"sheet.{suffix}: print it at 100 %; its ruler must be 150 mm long\n"
        )
    image = read_image(folder / "sheet.png")
    dots = 300 / 0.0254
    np.testing.assert_allclose(image.shape[1::-1], np.array(sheets.PAPERS[paper]) * dots, atol=1)
    corners, numbers, _ = cv2.aruco.ArucoDetector(sheets.DICTIONARY).detectMarkers(image)
    assert sorted(numbers.ravel().tolist()) == list(sheets.MIDDLES)
    for number, found in zip(numbers.ravel().tolist(), corners, strict=True):
        at = (found[0] + 0.5 - np.array(image.shape[1::-1]) / 2) * (1, -1) / dots
        assert np.abs(at - sheets.tag_corners(number)).max() < 0.0003
    text = (folder / "sheet.pdf").read_bytes()
    width, height = (side / 0.0254 * 72 for side in sheets.PAPERS[paper])
    box = text.split(b"/MediaBox [")[1].split(b"]")[0].split()
    np.testing.assert_allclose([*map(float, box)], [0, 0, width, height], atol=0.01)
    assert b"/Subtype /Image" not in text


def wrong_photographs(sharp):
    """Photographs that cannot be straightened, and the beginning of their sentences."""
    blurred = cv2.GaussianBlur(sharp, (0, 0), 7)
    bare, _ = photograph(ground(), (0.05, -0.2, 0.8))
    yield bare, "no tag of the sheet is seen: show the whole sheet, larger, evenly lit"
    yield blurred, "no tag of the sheet is seen: the photograph is blurred, its sharpest edges are"
    yield np.zeros((400, 300, 3), np.uint8), "no tag of the sheet is seen: "
    for kind, said in (
        (cv2.aruco.DICT_APRILTAG_36h11, "no tag of the sheet is seen, but the AprilTag 3, 4, 5"),
        (cv2.aruco.DICT_5X5_100, "no tag of the sheet is seen, but some of the family ArUco 5x5"),
    ):
        yield tags_of(kind, 3), said
    yield tags_of(cv2.aruco.DICT_APRILTAG_36h11, 570, 2), "2 of the sheet's 6 tags are seen, and 3"
    yield tags_of(cv2.aruco.DICT_APRILTAG_36h11, 570), "the tags' corners are "


def tags_of(kind, first, count=3):
    family = cv2.aruco.getPredefinedDictionary(kind)
    image = np.full((300, 900), 255, np.uint8)
    for k in range(count):
        tag = cv2.aruco.generateImageMarker(family, first + k, 160)
        image[70:230, 300 * k + 70 : 300 * k + 230] = tag
    return np.repeat(image[..., None], 3, axis=2)


def test_what_does_not_show_the_sheet_is_one_sentence(folder, plain):
    for image, said in wrong_photographs(plain):
        sentence = refusal(write("a.png", image))
        assert sentence.startswith(f"a.png: {said}"), sentence
    assert not (folder / "ground.png").exists()


@pytest.mark.parametrize(
    "hole",
    [np.s_[40:80, 60:100], np.s_[40:120, 60:140], np.s_[50:110, 20:180]],
    ids=["beside it", "left and right", "above and below"],
)
def test_a_hole_gets_the_texture_and_the_light_around_it(hole):
    rng = np.random.default_rng(0)
    light = np.linspace(60, 180, 200)[:, None] + np.zeros((160, 1, 1))
    image = (light + rng.normal(0, 12, (160, 200, 3))).clip(0, 255).astype(np.uint8)
    white = image.copy()
    white[hole] = 255
    found = filled(white, hole)[hole].astype(float)
    assert np.abs(found.mean(axis=(0, 2)) - image[hole].mean(axis=(0, 2))).max() < 9
    assert found.std(axis=0).mean() == pytest.approx(12, abs=2.5)


@pytest.mark.parametrize(
    ("size", "hole"),
    [
        ((40, 106), np.s_[5:35, 5:45]),
        ((40, 106), np.s_[5:35, 61:101]),
        ((106, 40), np.s_[5:45, 5:35]),
        ((106, 40), np.s_[61:101, 5:35]),
    ],
    ids=["right", "left", "below", "above"],
)
def test_a_hole_is_filled_from_the_only_place_beside_it(size, hole):
    picture = np.random.default_rng(0).integers(90, 110, (*size, 3)).astype(np.uint8)
    white = picture.copy()
    white[hole] = 255
    assert filled(white, hole).max() < 120


@pytest.mark.parametrize("is_upright", [True, False])
def test_a_sharpest_edge_is_as_wide_as_the_ramp_that_it_is(is_upright):
    ramp = np.interp(np.arange(100), [47, 53], [50, 170])
    rows = np.tile(ramp, (100, 1))
    image = np.dstack([rows if is_upright else rows.T] * 3).astype(np.uint8)
    assert edge_width(image) == pytest.approx(6.0, rel=0.01)


def test_where_there_is_no_room_for_a_filling_it_is_said():
    with pytest.raises(ValueError, match=r"^there is no room beside the sheet to fill its place"):
        filled(np.zeros((40, 40, 3), np.uint8), (slice(5, 35), slice(5, 35)))


def test_a_calibration_of_another_size_is_refused(folder, plain):
    (folder / "camera.yaml").write_text(CAMERA.replace("600", "601"))
    sentence = refusal(write("a.png", plain), "--calibration", "camera.yaml")
    assert sentence == (
        "a.png: the calibration is for 800 x 601 px, and the photograph has 800 x 600 px: give the "
        "calibration of such pictures"
    )


def test_the_largest_rectangle_of_a_mask_is_found():
    mask = np.zeros((6, 8), bool)
    mask[1:5, 2:5] = True
    mask[3:5, 1:8] = True
    assert largest_rectangle(mask) == ((3, 4), (1, 7))
    mask[4, 6] = False
    assert largest_rectangle(mask) == ((1, 4), (2, 4))
    assert largest_rectangle(np.zeros((6, 8), bool)) == ((0, 0), (0, 0))
