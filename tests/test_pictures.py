"""Pictures on plates, boxes, meshes, grounds and walls: where, how large and how sharp both renderers
show them, and which are refused.
"""

import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from servo.loop.episode import Episode
from servo.mistake import Mistake
from servo.scenario.load import load
from servo.scenario.named_files import digest_of, digests
from sim.files.picture_file import LARGEST_SIDE, read_image, read_on_white
from sim.files.picture_name import packaged, picture_named

RENDERERS = [pytest.param("opengl", marks=pytest.mark.opengl), "exact"]
FREE = ("robot.kind=free", "camera.fovy_deg=60", "controller.feed_forward=[]")
TILTED = (*FREE, "start.tilt_deg=35", "start.tilt_towards_deg=110")
STEEP = (*FREE, "start.tilt_deg=75", "start.tilt_towards_deg=90")
SHEET = "v -1 -.5 0\nv 1 -.5 0\nv 1 .5 0\nv -1 .5 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n"
X, Y, Z = np.eye(3)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    cv2.imwrite("soft.png", soft()[..., ::-1])
    (tmp_path / "sheet.obj").write_text(SHEET)
    return tmp_path


def soft(height=48, width=96):
    """A smooth picture without any symmetry, which continues beyond its border."""
    noise = np.random.default_rng(4).normal(0, 1, (3 * height, 3 * width, 3)).astype(np.float32)
    tiled = np.tile(noise[:height, :width], (3, 3, 1))
    smooth = cv2.GaussianBlur(tiled, (0, 0), 4)[height : 2 * height, width : 2 * width]
    return (128 + 60 * smooth / smooth.std()).clip(20, 235).astype(np.uint8)


def first(*changes):
    """The first picture of a run, with the world that shows it."""
    more = ("run.duration=0.05", "tracker.kind=frozen", "clutter.toys=false", "expect={}")
    with Episode(load("still", [*more, *changes])) as episode:
        step = next(iter(episode))
        return step.frame.image, step.truth, episode.world.camera


def places(truth, camera, corner, right, up):
    """Where each pixel sees a plane, to the right of a corner and below it (H, W, 2) [m], and how
    far away it is; nan or below zero: not at all.
    """
    pixels = np.stack(np.meshgrid(*(np.arange(n) + 0.5 for n in (camera.width, camera.height))), 2)
    rays = np.dstack([camera.normalise(pixels), np.ones(pixels.shape[:2])])
    eye = truth.T_world_camera
    rays = rays @ eye.rotation.T
    normal = np.cross(right, up)
    with np.errstate(divide="ignore", invalid="ignore"):
        far = (corner - eye.translation) @ normal / (rays @ normal)
    points = eye.translation + far[..., None] * rays - corner
    return np.stack([points @ right, -points @ up], axis=2), far


def differences(image, picture, at, size, seen):
    """The differences [levels] between an image and a picture at its places, in the same light."""
    height, width = picture.shape[:2]
    u = at[..., 0] / size[0] * width - 0.5
    v = at[..., 1] / size[1] * height - 0.5
    tiled = np.pad(picture, ((1, 1), (1, 1), (0, 0)), mode="wrap").astype(np.float32)
    u, v = (n.astype(np.float32) for n in (np.mod(u, width) + 1, np.mod(v, height) + 1))
    wanted = cv2.remap(tiled, u, v, cv2.INTER_LINEAR)[seen]
    found = image[seen].astype(float)
    light = (found * wanted).sum() / (wanted**2).sum()
    assert 0.2 < light <= 1.01
    return np.abs(found - light * wanted)


def far_inside(at, size, border):
    return ((at > border) & (at < np.array(size) - border)).all(axis=2)


@pytest.mark.parametrize("renderer", RENDERERS)
@pytest.mark.parametrize(
    ("size", "top", "changes"),
    [
        (
            (0.4, 0.2),
            0.002,
            (
                "target.kind=plate",
                "target.picture=soft.png",
                "target.length=0.4",
                "target.width=0.2",
            ),
        ),
        (
            (0.4, 0.2),
            0.1,
            ("target.kind=box", "target.picture=soft.png", "target.size=[0.4,0.2,0.1]"),
        ),
        (
            (0.4, 0.2),
            0.001,
            (
                "target.kind=mesh",
                "target.file=sheet.obj",
                "target.texture=soft.png",
                "target.size=0.4",
            ),
        ),
    ],
    ids=["plate", "box", "mesh"],
)
def test_a_target_shows_its_picture_upright_and_in_its_size(renderer, size, top, changes):
    image, truth, camera = first(*TILTED, *changes, f"camera.renderer={renderer}")
    target = truth.T_world_target
    right, up = target.rotation[:, 0], target.rotation[:, 1]
    corner = target.translation + top * Z - size[0] / 2 * right + size[1] / 2 * up
    at, far = places(truth, camera, corner, right, up)
    seen = far_inside(at, size, 0.01) & (far > 0)
    assert seen.sum() > 2000
    found = differences(image, soft(), at, size, seen)
    assert np.percentile(found, 95) < 6
    assert np.median(found) < 2.5


@pytest.mark.parametrize("renderer", RENDERERS)
@pytest.mark.parametrize("side", range(4))
def test_every_side_of_a_box_shows_the_picture_upright(renderer, side):
    changes = ("target.kind=box", "target.picture=soft.png", "target.size=[0.4,0.4,0.2]")
    tilt = (*FREE, "start.tilt_deg=60", f"start.tilt_towards_deg={90 * side + 20}")
    image, truth, camera = first(*tilt, *changes, f"camera.renderer={renderer}")
    target = truth.T_world_target.rotation
    compared = 0
    for normal in (target[:, 0], target[:, 1], -target[:, 0], -target[:, 1]):
        right = np.cross(Z, normal)
        corner = truth.T_world_target.translation + 0.2 * Z + 0.2 * normal - 0.2 * right
        if normal @ (truth.T_world_camera.translation - corner) < 0.3:
            continue
        at, far = places(truth, camera, corner, right, Z)
        seen = far_inside(at, (0.4, 0.2), 0.012) & (far > 0)
        if seen.sum() > 500:
            found = differences(image, soft(), at, (0.4, 0.2), seen)
            assert np.percentile(found, 90) < 8
            compared += 1
    assert compared


@pytest.mark.parametrize("renderer", RENDERERS)
def test_the_ground_has_the_pictures_proportions_and_size(renderer):
    changes = ("ground.kind=picture", "ground.file=soft.png", "ground.tile=0.4")
    image, truth, camera = first(*TILTED, *changes, f"camera.renderer={renderer}")
    at, far = places(truth, camera, np.array([-1.5, 1.2, 0.0]), X, Y)
    seen = far_inside(at, (3.0, 2.4), 0.05) & (far > 0) & (far < 1.6)
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    seen &= np.hypot(u - truth.centre[0], v - truth.centre[1]) > 45  # the car
    assert seen.sum() > 20_000
    found = differences(image, soft(), at, (0.4, 0.2), seen)
    assert np.percentile(found, 95) < 8
    assert np.median(found) < 3


@pytest.mark.parametrize("renderer", RENDERERS)
@pytest.mark.parametrize("towards", [90, 0])
def test_walls_show_the_picture_upright_from_inside(renderer, towards):
    walls = ("walls.picture=soft.png", "walls.tile=2", "walls.distance=2.5", "walls.height=2")
    tilt = (*STEEP, f"start.tilt_towards_deg={towards}", "camera.fovy_deg=90")
    image, truth, camera = first(*tilt, *walls, f"camera.renderer={renderer}")
    eye = truth.T_world_camera
    compared = 0
    for right in (X, -X, Y, -Y):
        normal = np.cross(right, Z)
        corner = -2.5 * normal - 2.5 * right - 0.75 * Z  # on the floor
        at, far = places(truth, camera, corner, right, Z)
        seen = far_inside(at + (0, 2.75), (5.0, 1.8), 0.1) & (far > 0)
        if seen.sum() < 2000:
            continue
        assert normal @ (eye.translation - corner) > 0
        found = differences(image, soft(), at, (2.0, 1.0), seen)
        # The exact renderer moves what is tilted by up to 0.4 px.
        assert np.percentile(found, 90) < 12
        compared += 1
    assert compared


@pytest.mark.parametrize("renderer", RENDERERS)
def test_a_fine_far_checkerboard_is_grey(renderer):
    """Without mipmaps each pixel is black or white, a variance of a hundred levels and more."""
    board = np.indices((256, 256)).sum(axis=0) % 2 * 255
    cv2.imwrite("board.png", board.astype(np.uint8))
    changes = ("ground.kind=picture", "ground.file=board.png", "ground.tile=0.1")
    image, truth, _ = first(*changes, f"camera.renderer={renderer}")
    ground = image[int(truth.centre[1]) + 50 :].astype(float)
    assert ground.std() < 6
    assert 60 < ground.mean() < 200


def test_pictures_of_scikit_image_are_found_by_name(folder):
    pytest.importorskip("skimage")
    for name in ("brick", "grass", "gravel", "coffee", "chelsea", "astronaut", "rocket"):
        picture = picture_named(f"skimage:{name}", "targets", "picture")
        assert min(picture.shape[:2]) >= 300
        assert picture.shape[2] == 3
    image, _, _ = first("ground.kind=picture", "ground.file=skimage:gravel")
    plain, _, _ = first()
    assert (image != plain).mean() > 0.5


def test_the_identity_of_a_picture_by_name_is_that_of_its_file():
    pytest.importorskip("skimage")
    file = packaged("skimage:gravel", "picture")
    assert digests(["skimage:gravel", "pebbles"]) == {"skimage:gravel": digest_of(str(file))}
    table = load("still", ["target.kind=box", "target.picture=skimage:coffee"]).table
    assert table["target"]["picture"] == "skimage:coffee"


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (
            ("target.kind=plate", "target.picture=skimage:cofee"),
            "still: target: picture = 'skimage:cofee': scikit-image's package has no such picture; it has astronaut, brick, ",
        ),
        (
            ("target.kind=box", "target.picture=gone.png"),
            "still: target: picture: gone.png: cannot read this picture: No such file",
        ),
        (
            ("ground.kind=picture", "ground.file=broken.png"),
            "still: ground.file: broken.png: this picture cannot be decoded",
        ),
        (
            ("ground.kind=picture", "ground.file=skimage:x"),
            "still: ground.file = 'skimage:x': scikit-image's package has no such",
        ),
        (
            ("walls.picture=stone",),
            "still: walls.picture = 'stone': no file of this name is shipped; give brick, ",
        ),
        (
            ("walls.picture=broken.png",),
            "still: walls.picture: broken.png: this picture cannot be decoded",
        ),
        (
            ("target.kind=mesh", "target.file=sheet.obj", "target.texture=skimage:../coffee"),
            "still: target: texture = 'skimage:../coffee': ",
        ),
    ],
)
def test_a_picture_that_is_missing_or_broken_is_named_with_its_setting(folder, changes, sentence):
    pytest.importorskip("skimage")
    (folder / "broken.png").write_bytes((folder / "soft.png").read_bytes()[:60])
    with pytest.raises(Mistake) as found:
        first(*changes)
    assert str(found.value).startswith(sentence), str(found.value)


def test_without_the_extra_a_sentence_names_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "skimage", None)
    with pytest.raises(Mistake) as found:
        first("ground.kind=picture", "ground.file=skimage:grass")
    assert str(found.value) == (
        "still: ground.file = 'skimage:grass': scikit-image is not installed: install "
        "servobench[pictures]"
    )
    assert digests(["skimage:grass"]) == {}


def test_odd_pictures_are_shown_as_viewers_show_them(folder):
    grey = np.full((20, 30), 90, np.uint8)
    cv2.imwrite("grey.png", grey)
    assert (read_on_white(Path("grey.png")) == 90).all()
    cv2.imwrite("deep.png", grey.astype(np.uint16) * 257)
    assert abs(int(read_on_white(Path("deep.png")).mean()) - 90) <= 1
    clear = np.zeros((20, 30, 4), np.uint8)
    clear[:, :10] = (0, 0, 200, 255)
    clear[:, 10:20] = (0, 0, 200, 128)
    cv2.imwrite("clear.png", clear)
    found = read_on_white(Path("clear.png"))
    assert [found[5, u].tolist() for u in (5, 15, 25)] == [[200, 0, 0], [227, 127, 127], [255] * 3]
    turned = folder / "turned.jpg"
    turned.write_bytes(with_orientation(cv2.imencode(".jpg", grey)[1].tobytes(), 6))
    assert read_on_white(turned).shape == (30, 20, 3)
    large = np.full((10, 3 * LARGEST_SIDE), 255, np.uint8)
    cv2.imwrite("large.png", large)
    assert read_on_white(Path("large.png")).shape == (3, LARGEST_SIDE, 3)
    pages = [np.full((8, 8, 3), value, np.uint8) for value in (250, 20)]
    cv2.imwritemulti("pages.tiff", pages)
    assert read_on_white(Path("pages.tiff")).mean() > 200  # its first page


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize(("orientation", "place"), [(1, (0, 0)), (3, (-1, -1)), (6, (0, -1))])
def test_exif_turns_a_picture_with_its_transparency(orientation, place, dtype):
    opaque = np.iinfo(dtype).max
    picture = np.zeros((20, 30, 4), dtype)
    picture[..., 3] = opaque
    picture[0, 0] = (0, 0, opaque, opaque // 2)  # the only pixel in which white shows through
    exif = np.frombuffer(orientation_tag(orientation), np.uint8)
    cv2.imwriteWithMetadata("turned.png", picture, [0], [exif])
    found = read_on_white(Path("turned.png"))
    assert found.shape == ((30, 20, 3) if orientation == 6 else (20, 30, 3))
    assert found[place].tolist() == [255, 128, 128]
    assert np.count_nonzero(found) == 3


def with_orientation(jpeg, orientation):
    """A JPEG file with the EXIF tag that says how it is to be turned."""
    exif = b"Exif\0\0" + orientation_tag(orientation)
    return jpeg[:2] + b"\xff\xe1" + (len(exif) + 2).to_bytes(2, "big") + exif + jpeg[2:]


def orientation_tag(orientation):
    """EXIF data that say how a picture is to be turned, as a TIFF block."""
    entry = b"\x01\x12\x00\x03\x00\x00\x00\x01" + bytes([0, orientation]) + b"\0\0"
    return b"MM\0*\0\0\0\x08\0\x01" + entry + b"\0\0\0\0"


def test_shipped_pictures_are_those_of_scikit_image_made_smaller():
    pytest.importorskip("skimage")
    import scenes

    for folder, name in (("grounds", "gravel"), ("grounds", "brick"), ("targets", "coffee")):
        own = read_image(Path(scenes.__file__).parent / folder / f"{name}.png")
        whole = read_image(packaged(f"skimage:{name}", "picture"))
        if name == "brick":
            whole = np.rot90(whole)  # its courses are level
        small = cv2.resize(whole, own.shape[1::-1], interpolation=cv2.INTER_AREA)
        assert np.abs(small.astype(int) - own).max() <= 2


@pytest.mark.parametrize("renderer", RENDERERS)
@pytest.mark.parametrize("shape", [(1, 1), (1, 2048), (2048, 1), (3, 5000)])
@pytest.mark.parametrize("ends", [(0.01, 2, 0.1), (10, 10, 10)])
def test_pictures_of_any_shape_are_shown_at_both_ends_of_the_settings(renderer, shape, ends):
    tile, distance, height = ends
    picture = np.random.default_rng(0).integers(100, 200, (*shape, 3), np.uint8)
    cv2.imwrite("odd.png", picture)
    grounds = ("ground.kind=picture", "ground.file=odd.png", f"ground.tile={tile}")
    walls = ("walls.picture=odd.png", f"walls.tile={tile}", f"walls.distance={distance}")
    target = ("target.kind=box", "target.picture=odd.png")
    more = (*STEEP, f"walls.height={height}", f"camera.renderer={renderer}")
    image, _, _ = first(*grounds, *walls, *target, *more)
    assert image.std() > 1
