"""Pictures of 16 bits whose camera uses fewer: every kind of source gives the same 8 bits."""

import io
import json

import av
import cv2
import numpy as np
import pytest
from tracked import REGION, call, image

from sim.files.bit_depth import BitDepth
from sim.files.picture_file import decoded, read_image
from tracking.guests import trax_messages
from tracking.sequences.sequence import source_of
from tracking.sequences.sources import Folder
from tracking.sequences.video_file import Video

RNG = np.random.default_rng(0)
NOTE = (
    "the pictures have 16 bits, of which 12 are used: the largest value of the first is 3000; "
    "later ones are clipped at 4095"
)


def deep(largest, shape=(24, 40)):
    """Noise of 16 bits with a given largest value."""
    picture = RNG.integers(0, largest + 1, shape, np.uint16)
    picture[0, 0] = largest
    return picture


@pytest.mark.parametrize(
    ("largest", "used"),
    [(1, 8), (255, 8), (256, 10), (1023, 10), (1024, 12), (4096, 14), (16383, 14), (16384, 16)],
)
def test_the_bits_in_use_are_the_fewest_that_hold_the_largest_value(largest, used):
    depth = BitDepth()
    picture = deep(largest)
    assert not depth.reduced(np.zeros_like(picture)).any()
    assert depth.used is None  # black decides nothing
    np.testing.assert_array_equal(depth.reduced(picture), picture >> (used - 8))
    assert (depth.used, bool(depth.notes)) == (used, used < 16)


def test_brighter_pictures_are_clipped_and_darker_ones_keep_their_values():
    depth = BitDepth()
    depth.reduced(deep(3000))
    later = np.array([[16, 4095, 4096, 65535]], np.uint16)
    assert depth.reduced(later).tolist() == [[1, 255, 255, 255]]
    assert depth.notes == (NOTE,)


@pytest.mark.parametrize(
    ("suffix", "shape"),
    [
        (".png", (24, 40)),
        (".png", (24, 40, 3)),
        (".png", (24, 40, 4)),
        (".tiff", (24, 40)),
        (".tiff", (24, 40, 3)),
        (".pgm", (24, 40)),
        (".ppm", (24, 40, 3)),
    ],
)
def test_pictures_of_all_16_bits_keep_the_values_of_opencv(suffix, shape):
    data = cv2.imencode(suffix, deep(65535, shape))[1].tobytes()
    expected = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    depth = BitDepth()
    for _ in range(2):
        np.testing.assert_array_equal(decoded(data, depth), expected)


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_a_folder_is_read_by_the_bits_of_its_first_deep_picture(tmp_path, suffix):
    eight = deep(255).astype(np.uint8)
    first, brighter = deep(3000, (24, 40, 3)), deep(9000)
    for name, picture in (("a", eight), ("b", first), ("c", brighter)):
        cv2.imwrite(str(tmp_path / f"{name}{suffix}"), picture)
    a, b, c = Folder.of(tmp_path)
    np.testing.assert_array_equal(a.image, np.dstack([eight] * 3))
    np.testing.assert_array_equal(b.image, first[..., ::-1] >> 4)
    np.testing.assert_array_equal(c.image, np.dstack([np.minimum(brighter >> 4, 255)] * 3))
    assert [p.notes for p in (a, b, c)] == [(), (NOTE,), (NOTE,)]
    alone = read_image(tmp_path / f"c{suffix}")  # it stands alone, and has 14 bits
    np.testing.assert_array_equal(alone[..., 0], brighter >> 6)


@pytest.mark.parametrize("big", [0, 1])
def test_a_bag_of_12_bits_is_read_by_them(tmp_path, big):
    bags = pytest.importorskip("bags", reason="rosbags and mcap are not installed")
    grey = [deep(3000), deep(9000)]

    def message(picture):
        def make(store):
            pixels = picture.astype(">u2" if big else "<u2").view(np.uint8)[..., None]
            found = bags.raw(store, 1.0, pixels, "mono16")
            found.width, found.is_bigendian = picture.shape[1], big
            return [(bags.START, bags.RAW, found)]

        return make

    def both(store):
        return [made for picture in grey for made in message(picture)(store)]

    first, later = source_of(str(bags.write(tmp_path / "log.mcap", {"/eye": both})), 30.0)
    np.testing.assert_array_equal(first.image[..., 1], grey[0] >> 4)
    np.testing.assert_array_equal(later.image[..., 1], np.minimum(grey[1] >> 4, 255))
    assert first.notes == (NOTE,)


@pytest.mark.parametrize(
    ("stored", "given", "largest", "shift"),
    [
        ("gray16le", "gray16le", 3000, 4),
        ("rgb48le", "rgb48le", 900, 2),
        ("gbrp16le", "rgb48le", 200, 0),
        ("gray16le", "gray16le", 65535, 8),
        ("gray10le", "gray10le", 900, 2),  # such a format states its bits
    ],
)
@pytest.mark.newest
def test_a_video_of_16_bits_is_read_by_those_in_use(tmp_path, stored, given, largest, shift):
    picture = deep(largest, (24, 40, 3) if given == "rgb48le" else (24, 40))
    data = io.BytesIO()
    with av.open(data, mode="w", format="matroska") as container:
        stream = container.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = 40, 24, stored
        container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format=given)))
        container.mux(stream.encode(None))
    path = tmp_path / "film.mkv"
    path.write_bytes(data.getvalue())
    (found,) = Video.of(path)
    expected = picture >> shift
    expected = expected if expected.ndim == 3 else np.dstack([expected] * 3)
    np.testing.assert_allclose(found.image, expected, atol=0 if found.notes else 1)
    assert bool(found.notes) == (stored != "gray10le" and shift < 8)


def test_a_trax_client_s_pictures_are_read_by_the_bits_of_the_first():
    depth = BitDepth()
    for largest in (3000, 700):
        picture = deep(largest, (2, 3))
        text = trax_messages.base64.b64encode(picture.astype("<u2").tobytes()).decode()
        found = trax_messages.picture_in(f"image:3;2;gray16;{text}", depth)
        np.testing.assert_array_equal(found[..., 0], picture >> 4)


def test_the_command_says_how_many_bits_are_used(monkeypatch, capfd, tmp_path):
    """A tracker sees the same as in pictures of 8 bits."""
    for folder, bits in (("eight", 0), ("twelve", 4)):
        (tmp_path / folder).mkdir()
        for k in range(4):
            picture = image(k) if not bits else image(k).astype(np.uint16) << bits
            cv2.imwrite(str(tmp_path / folder / f"{k}.png"), picture)
    monkeypatch.chdir(tmp_path)
    for folder in ("eight", "twelve"):
        words = ("--region", REGION, "--tracker", "pf_ssd", "-q", "--out", f"out-{folder}")
        code, _, err = call(monkeypatch, capfd, folder, *words)
    (note,) = json.loads((tmp_path / "out-twelve" / "report.json").read_text())["notes"]
    assert (code, err) == (0, f"servobench: {note}\n")
    assert note.startswith("the pictures have 16 bits, of which 12 are used: ")
    tracks = [(tmp_path / f"out-{f}" / "track.csv").read_text() for f in ("eight", "twelve")]
    eight, twelve = ([line.split(",")[:18] for line in track.splitlines()] for track in tracks)
    assert eight == twelve
