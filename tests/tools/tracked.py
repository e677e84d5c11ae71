"""A target that moves through a folder of pictures, and `servobench track` as a test calls it."""

import csv

import cv2
import numpy as np
import pytest

from servo.cli import main

REGION = "40,30,30,20"
FRAMES = 8


def image(k, shift=2):
    """A blue rectangle with a yellow half on textured grey, 2 px further right in each frame."""
    rng = np.random.default_rng(0)
    picture = cv2.GaussianBlur(rng.integers(90, 160, (100, 160, 3)).astype(np.uint8), (0, 0), 2)
    x = 40 + shift * k
    picture[30:50, x : x + 30] = (200, 60, 30)
    picture[30:50, x : x + 12] = (40, 220, 230)
    return picture


def pictures(folder):
    """Write the pictures into FOLDER/in."""
    (folder / "in").mkdir()
    for k in range(FRAMES):
        cv2.imwrite(str(folder / "in" / f"{k:03}.png"), image(k))
    return folder


def call(monkeypatch, capfd, *arguments):
    monkeypatch.setattr("sys.argv", ["servobench", "track", *arguments])
    with pytest.raises(SystemExit) as left:
        main.main()
    out, err = capfd.readouterr()
    return left.value.code, out, err


def rows_of(path):
    with path.open() as file:
        return list(csv.DictReader(file))
