"""Pictures that a setting names: by a path, by a shipped picture's name, or as `skimage:NAME`."""

from importlib.util import find_spec
from pathlib import Path

from sim.files.picture_file import SUFFIXES, read_on_white
from sim.files.shipped import file_of
from sim.types import Image

SKIMAGE = "skimage:"
"""Prefix of the names of the pictures in scikit-image's package."""


def picture_named(name: str, folder: str, setting: str) -> Image:
    """Return the picture that a setting of a scenario names, as RGB (H, W, 3), uint8, at most 2048
    px a side; where it is transparent, white shows through.

    Args:
        name: A path, the bare name of a shipped picture, or `skimage:NAME` for a picture of
            scikit-image.
        folder: Folder of the shipped pictures in the package `scenes`, such as "grounds".
        setting: Name of the setting, for error messages.

    Raises:
        ValueError: There is no such picture, or it cannot be read.
    """
    is_packaged = name.startswith(SKIMAGE)
    path = packaged(name, setting) if is_packaged else file_of(name, folder, ".png", setting)
    try:
        return read_on_white(path)
    except ValueError as error:
        raise ValueError(f"{setting}: {error}") from None


def packaged(name: str, setting: str) -> Path:
    """Return the path of a picture file in the installed package scikit-image. Nothing is imported
    or downloaded.

    Args:
        name: `skimage:NAME`, where NAME is the file's name without its suffix.
        setting: Name of the setting that names the picture, for error messages.

    Raises:
        ValueError: The package is not installed, or has no such picture.
    """
    spec = find_spec(SKIMAGE.removesuffix(":"))
    if spec is None or spec.origin is None:
        raise ValueError(
            f"{setting} = {name!r}: scikit-image is not installed: install servobench[pictures]"
        )
    files = sorted((Path(spec.origin).parent / "data").glob("*.*"))
    pictures = {file.stem: file for file in files if file.suffix in SUFFIXES}
    found = pictures.get(name.removeprefix(SKIMAGE))
    if found is None:
        there = ", ".join(pictures)
        raise ValueError(
            f"{setting} = {name!r}: scikit-image's package has no such picture; it has {there}"
        )
    return found
