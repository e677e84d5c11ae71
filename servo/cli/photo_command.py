"""The command `servobench photo`: straighten (rectify) the one of several photographs of a plane
that shows most of it, by a printed sheet of tags that lies on the plane; or draw this sheet.
"""

import json
from pathlib import Path

from rich.console import Console

from servo.cli.outputs import check_writable
from servo.cli.terminal import plain
from servo.mistake import Mistake, as_mistake, check_suffix, writing
from servo.photo.detection import seen_in
from servo.photo.fill import filled
from servo.photo.photograph import Photograph, Rectangle
from servo.photo.sheet import MIDDLES, RULER, SIDE, drawn
from servo.scenario.calibration import camera_in
from sim.files.picture_file import read_image, shrunk
from sim.types import Camera, Image
from tracking.drawing.picture_bytes import encoded

FILL = "fill"
CROP = "crop"
DONE = {
    FILL: "the sheet's place is filled with the plane beside it (or: --covered crop, keep)",
    CROP: "the part beside the sheet (or: --covered fill, keep)",
    "keep": "the sheet is in it (or: --covered fill, crop)",
}
"""What is said of the sheet's place, by the value of --covered."""
LARGEST_PHOTOGRAPH = 6000
"""Longest side of a photograph [px]; a larger one without a calibration is made smaller: its
straightened picture has at most 2048 px a side."""
MM = 1e3


def run(
    pictures: tuple[Path, ...],
    out: Path,
    sheet: Path | None,
    paper: str,
    side: float,
    calibration: Path | None,
    covered: str,
) -> None:
    """Straighten photographs of a plane on which a printed sheet of tags lies, and write the
    picture that shows most of the plane; or draw the sheet. Exactly one of `pictures` and `sheet`
    is given.

    Args:
        pictures: The photographs.
        out: The PNG to write; it must not exist.
        sheet: File (.pdf, .svg or .png) to draw the sheet into, in place of photographs.
        paper: Paper of the sheet, "a4" or "letter".
        side: Side of a printed tag's black square [mm].
        calibration: Calibration file of the camera, if there is one.
        covered: "fill" the place of the sheet with the plane beside it, "crop" it, or "keep" the
            sheet.

    Raises:
        Mistake: Both or neither of `pictures` and `sheet` are given, a photograph does not show the
            sheet, shows too little beside the sheet or does not fit the calibration, or a file
            cannot be read or written.
        Refused: The disk is full or fails.
    """
    if (sheet is None) == (not pictures):
        raise Mistake(
            "photo: give either photographs to straighten, or --sheet FILE to draw the sheet"
        )
    if sheet is None:
        camera = None if calibration is None else camera_in(calibration)
        _straighten(pictures, out, camera, side / MM / SIDE, covered)
    else:
        _draw_sheet(sheet, paper)


def _draw_sheet(sheet: Path, paper: str) -> None:
    """Write the sheet into a new file."""
    check_suffix(sheet, ".pdf", ".svg", ".png")
    check_writable(sheet)
    with writing(sheet, "this sheet"):
        drawn(paper).savefig(sheet, dpi=300)
    plain(Console(), f"{sheet}: print it at 100 %; its ruler must be {MM * RULER:g} mm long")


def _straighten(
    pictures: tuple[Path, ...], out: Path, camera: Camera | None, scale: float, covered: str
) -> None:
    """Straighten the photograph that shows most of the plane, write the picture, and print its size
    and the lines of a scenario that show it. `scale` is the printed size of the sheet relative to
    its design size.
    """
    check_suffix(out, ".png")
    check_writable(out)
    console = Console()
    best = None
    most = 0.0
    for file in pictures:
        with as_mistake():
            image = read_image(file)
            if camera is None:
                image = shrunk(image, LARGEST_PHOTOGRAPH)
        try:
            photograph = seen_in(image, camera, scale)
        except ValueError as error:
            raise Mistake(f"{file}: {error}") from None
        part = photograph.part(with_sheet=covered != CROP)
        width, height = part.size.tolist()
        plain(
            console,
            f"{file}: {photograph.tags} of {len(MIDDLES)} tags, to {MM * photograph.error:.2f} mm; "
            f"{width:.3f} x {height:.3f} m at {photograph.resolution:.0f} px a metre",
        )
        if width * height > most:
            best = file, photograph, part
            most = width * height
    if best is None:
        raise Mistake("photo: the photographs show nothing beside the sheet: give --covered keep")
    file, photograph, part = best
    picture, resolution = photograph.straightened(part)
    if covered == FILL:
        try:
            picture = _without_sheet(picture, resolution, photograph, part)
        except ValueError as error:
            raise Mistake(f"{file}: {error}") from None
    with writing(out, "this picture"):
        out.write_bytes(encoded(picture))
    width, height = part.size.tolist()
    plain(
        console,
        f"{out}: {width:.3f} x {height:.3f} m, {resolution:.0f} px a metre, of {file}; "
        f"{DONE[covered]}",
        _toml(out, width, height),
    )


def _without_sheet(
    picture: Image, resolution: float, photograph: Photograph, part: Rectangle
) -> Image:
    """Return a straightened picture in which the sheet is replaced by the plane beside it; the
    picture itself if the sheet is outside.

    Args:
        picture: The straightened picture.
        resolution: Its resolution [px/m].
        photograph: The photograph that was straightened.
        part: The rectangle of the plane that the picture shows.

    Raises:
        ValueError: The picture shows too little of the plane beside the sheet.
    """
    paper = photograph.paper
    height, width = picture.shape[:2]
    left, right = ((x - part.left) * resolution for x in (paper.left, paper.right))
    top, bottom = ((part.top - y) * resolution for y in (paper.top, paper.bottom))
    rows = slice(max(0, int(top)), min(height, int(bottom) + 1))
    columns = slice(max(0, int(left)), min(width, int(right) + 1))
    if rows.stop <= rows.start or columns.stop <= columns.start:
        return picture
    return filled(picture, (rows, columns))


def _toml(out: Path, width: float, height: float) -> str:
    """Return the lines of a scenario that show a picture of this size [m] in its true size."""
    name = json.dumps(str(out))
    return (
        f'\nas the ground:\n[ground]\nkind = "picture"\nfile = {name}\ntile = {width:.4f}\n'
        f'\nas a plate:\n[target]\nkind = "plate"\npicture = {name}\nlength = {width:.4f}\n'
        f"width = {height:.4f}"
    )
