"""Pictures of all formats and depths, and files that are no pictures."""

import os
import subprocess
import sys

import cv2
import numpy as np
import pytest

from sim.files import picture_file
from sim.files.picture_file import SUFFIXES, read_image
from sim.stderr import silent_libraries
from tracking.sequences.sources import Folder

WHY = "known formats are JPEG, PNG, BMP, TIFF, WebP, PPM"
PICTURE = np.random.default_rng(0).integers(0, 256, (23, 37, 3), np.uint8)


def encoded(suffix, image=PICTURE):
    done, data = cv2.imencode(suffix, image)
    assert done
    return data.tobytes()


@pytest.mark.parametrize("suffix", sorted(SUFFIXES))
def test_every_format_is_read(tmp_path, suffix):
    image = PICTURE[..., 0] if suffix == ".pgm" else PICTURE
    data = encoded(suffix, image)
    (tmp_path / f"a{suffix}").write_bytes(data)
    found = read_image(tmp_path / f"a{suffix}")
    assert found.shape == (23, 37, 3)
    if suffix not in (".jpg", ".jpeg", ".webp", ".pgm"):
        np.testing.assert_array_equal(found, PICTURE[..., ::-1])


@pytest.mark.parametrize("depth", [np.uint8, np.uint16])
@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_every_depth_and_number_of_channels_is_rgb(tmp_path, suffix, depth, channels):
    image = np.full((5, 7, channels), np.iinfo(depth).max // 2, depth)
    (tmp_path / f"a{suffix}").write_bytes(encoded(suffix, image))
    found = read_image(tmp_path / f"a{suffix}")
    assert (found.shape, found.dtype) == ((5, 7, 3), np.uint8)
    np.testing.assert_allclose(found, 127, atol=1)


def test_a_picture_with_too_long_a_side_is_refused(tmp_path):
    (tmp_path / "a.png").write_bytes(encoded(".png", np.zeros((1, 16_385, 3), np.uint8)))
    with pytest.raises(ValueError) as refused:
        read_image(tmp_path / "a.png")
    assert str(refused.value) == (
        f"{tmp_path / 'a.png'}: the picture has 16385 x 1 px; both sides should be 1 to 16384 px"
    )


def test_a_suffix_that_lies_does_no_harm(tmp_path):
    (tmp_path / "a.jpg").write_bytes(encoded(".png"))
    np.testing.assert_array_equal(read_image(tmp_path / "a.jpg"), PICTURE[..., ::-1])


def test_what_is_in_a_folder_but_no_picture_gives_its_reason(tmp_path, capfd):
    """A pipe would be waited for, for ever; libraries would write lines of their own."""
    (tmp_path / "0.png").write_bytes(encoded(".png"))
    (tmp_path / "1.png").mkdir()
    (tmp_path / "2.png").symlink_to("gone")
    (tmp_path / "3.png").symlink_to("3.png")
    os.mkfifo(tmp_path / "4.png")
    (tmp_path / "5.png").write_bytes(b"")
    (tmp_path / "6.png").write_bytes(encoded(".png")[:20])
    (tmp_path / "7.png").write_bytes(encoded(".png")[:40])
    (tmp_path / "8.png").write_bytes(b"\xff\xd8\xff\xe0\x00")
    first, *others = Folder.of(tmp_path)
    assert first.image is not None
    unread = "cannot read this picture: "
    assert [picture.reason for picture in others] == [
        f"{unread}it is a folder",
        f"{unread}No such file or directory",
        f"{unread}Too many levels of symbolic links",
        f"{unread}it is a named pipe, not a file",
        *[f"this picture cannot be decoded; {WHY}"] * 4,
    ]
    assert [picture.image for picture in others] == [None] * 8
    assert capfd.readouterr() == ("", "")


def test_half_a_jpeg_says_nothing_by_itself(tmp_path, capfd):
    """OpenCV logs that it is cut off."""
    whole = encoded(".jpg", np.tile(PICTURE, (20, 20, 1)))
    (tmp_path / "a.jpg").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ValueError, match=r"a\.jpg: this picture cannot be decoded"):
        read_image(tmp_path / "a.jpg")
    assert capfd.readouterr() == ("", "")


def test_libraries_are_silent_only_meanwhile(capfd):
    os.write(2, b"before ")
    with silent_libraries():
        os.write(2, b"meanwhile ")
    os.write(2, b"after")
    assert capfd.readouterr().err == "before after"


def test_a_closed_stderr_silences_nothing_and_does_no_harm(tmp_path):
    (tmp_path / "a.png").write_bytes(encoded(".png"))
    code = (
        "import os, sys; from pathlib import Path; os.close(2)\n"
        f"from {picture_file.__name__} import read_image\n"
        "print(read_image(Path(sys.argv[1])).shape)"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "a.png")]
    done = subprocess.run(command, stdout=subprocess.PIPE, check=True)
    assert done.stdout == b"(23, 37, 3)\n"
