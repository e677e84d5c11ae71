"""Bags as sources: every encoding of a picture."""

import numpy as np
import pytest

from tracking.sequences.bag_file import Bag

bags = pytest.importorskip("bags", reason="rosbags and mcap are not installed")
WIDTH, HEIGHT = 30, 20
GREY = (77, 77, 77)
COLOUR = (200, 20, 40)  # RGB


def bayer(pattern, size=(HEIGHT, WIDTH)):
    mosaic = np.zeros(size, np.uint8)
    for place, letter in enumerate(pattern):
        mosaic[place // 2 :: 2, place % 2 :: 2] = COLOUR["rgb".index(letter)]
    return mosaic[..., None]


def full(*values):
    return np.full((HEIGHT, WIDTH, len(values)), values, np.uint8)


ENCODINGS = {
    "rgb8": (full(*COLOUR), COLOUR),
    "bgr8": (full(*COLOUR[::-1]), COLOUR),
    "8UC3": (full(*COLOUR[::-1]), COLOUR),
    "rgba8": (full(*COLOUR, 9), COLOUR),
    "bgra8": (full(*COLOUR[::-1], 9), COLOUR),
    "8UC4": (full(*COLOUR[::-1], 9), COLOUR),
    "mono8": (full(77), GREY),
    "8UC1": (full(77), GREY),
    **{f"bayer_{p}8": (bayer(p), COLOUR) for p in ("rggb", "bggr", "gbrg", "grbg")},
}


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_every_encoding_gives_its_colours(tmp_path, encoding):
    pixels, colour = ENCODINGS[encoding]

    def make(store):
        return [(bags.START, bags.RAW, bags.raw(store, 1.0, pixels, encoding))]

    (picture,) = Bag(bags.write(tmp_path / "log.mcap", {"/eye": make}), None)
    assert picture.image.shape == (HEIGHT, WIDTH, 3)
    np.testing.assert_array_equal(picture.image[4:-4, 4:-4], np.broadcast_to(colour, (12, 22, 3)))


@pytest.mark.parametrize("encoding", ["yuv422", "UYVY", "yuv422_yuy2", "YUYV"])
def test_yuv_is_read_in_both_orders(tmp_path, encoding):
    luma, blue, red = 120, 90, 200
    pair = (blue, luma, red, luma) if encoding in ("yuv422", "UYVY") else (luma, blue, luma, red)
    pixels = np.tile(np.array(pair, np.uint8).reshape(2, 2), (HEIGHT, WIDTH // 2, 1))

    def make(store):
        return [(bags.START, bags.RAW, bags.raw(store, 1.0, pixels, encoding))]

    (picture,) = Bag(bags.write(tmp_path / "log.mcap", {"/eye": make}), None)
    y, u, v = 1.164 * (luma - 16), blue - 128, red - 128  # ITU-R BT.601
    expected = (y + 1.596 * v, y - 0.392 * u - 0.813 * v, y + 2.017 * u)
    np.testing.assert_allclose(picture.image[5, 6], expected, atol=1.5)


@pytest.mark.parametrize("encoding", ["RGB8", "Mono8", "BAYER_RGGB8", "8uc3"])
def test_capitals_are_those_of_some_drivers(tmp_path, encoding):
    plain = next(each for each in ENCODINGS if each.lower() == encoding.lower())
    pixels, colour = ENCODINGS[plain]

    def make(store):
        return [(bags.START, bags.RAW, bags.raw(store, 1.0, pixels, encoding))]

    (picture,) = Bag(bags.write(tmp_path / "log.mcap", {"/eye": make}), None)
    np.testing.assert_array_equal(picture.image[10, 10], colour)


@pytest.mark.parametrize("big", [0, 1])
def test_of_sixteen_bits_that_are_all_used_the_high_byte_is_read(tmp_path, big):
    grey = np.full((HEIGHT, WIDTH), 77 * 256 + 200, ">u2" if big else "<u2")

    def make(store):
        message = bags.raw(store, 1.0, grey.view(np.uint8)[..., None], "mono16")
        message.width, message.is_bigendian = WIDTH, big
        return [(bags.START, bags.RAW, message)]

    (picture,) = Bag(bags.write(tmp_path / "log.mcap", {"/eye": make}), None)
    np.testing.assert_array_equal(picture.image, full(*GREY))
