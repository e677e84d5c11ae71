"""Reading of truth files (the target's true outline in each picture) in the formats of OTB, VOT,
TLD and CSV.

All coordinates become continuous pixels from the image's top left corner. OTB, GOT-10k and LaSOT
count pixels from 1, so that their box 1,1,w,h begins at the corner; VOT, TLD and CSV count from 0.
"""

import csv
import re
from enum import Enum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sim.files import reading
from sim.types import LARGEST_PICTURE, Array
from tracking.sequences.quadrilateral import BOX, QUAD, boxes, corners_of, crosses_itself
from tracking.types import FARTHEST

OTB_NAME = re.compile(r"groundtruth_rect.*\.txt$")
VOT_NAME = re.compile(r"groundtruth.*\.txt$")
ABSENCE = "absence.label"
"""File beside groundtruth.txt in GOT-10k's layout: for each frame 1 where the target is absent."""
GOT10K_FILES = ("meta_info.ini", ABSENCE, "cover.label", "cut_by_image.label")
"""Files beside groundtruth.txt in GOT-10k's layout, by which it differs from VOT's."""
LASOT_FILES = ("full_occlusion.txt", "out_of_view.txt")
"""Files beside groundtruth.txt in LaSOT's layout: for each frame 1 where the target is absent."""
MASK = re.compile(r"m-?\d+,\s*-?\d+,")
ABSENT = [0.0]
"""Numbers of a line by which VOT marks an absent target: 0, its code of an unknown region."""
TLD_NAMES = ("gt.txt", "init.txt")
HEADER = re.compile(r"\s*[A-Za-z_]\w*\s*,")
CORNERS = tuple(f"{axis}{i}" for i in range(1, 5) for axis in "xy")
FRAME = "frame"
BOX_NAMES = (
    ("left", "top", "width", "height"),
    ("x", "y", "width", "height"),
    ("x", "y", "w", "h"),
)
LONGEST = 80
"""Most characters of a line in a message."""
LARGEST_FILE = 20_000_000
"""Largest truth file [bytes]: ten hours at 30 pictures a second."""
MOST_LINES = 2
"""Most lines of a truth for each picture: a longer truth is refused before it is parsed."""
REMEDY = (
    "give the format of this truth: otb, vot or tld (--truth-format, or truth_format in a suite or "
    "in [recording])"
)


class Format(Enum):
    """Format of a truth file (the target's true outline in each picture); the value of each member
    says what the numbers of a line mean.
    """

    AUTO = "decided by the file's name and header, refused if they do not decide"
    OTB = "x,y,w,h, pixels counted from 1; also GOT-10k's and LaSOT's"
    VOT = "x,y,w,h, the x,y of four corners, or masks (their boxes), pixels counted from 0"
    TLD = "x1,y1,x2,y2: top left and bottom right corner, pixels counted from 0"
    CSV = "columns named by a header"

    @staticmethod
    def named(name: str) -> "Format":
        """Return the format with a name in lower case, such as "otb".

        Raises:
            ValueError: There is no such format.
        """
        formats = {each.name.lower(): each for each in Format}
        if name not in formats:
            raise ValueError(f"there is no truth format '{name}'; there is {', '.join(formats)}")
        return formats[name]


def other_count(place: str, lines: int, pictures: int) -> str:
    """Return the message that the truth file `place` has `lines` lines for another number
    `pictures` of pictures.
    """
    return (
        f"{place}: this truth has {lines} lines for {pictures} pictures; it needs one for each, "
        "with nan where the target is absent"
    )


def read(path: Path, form: Format = Format.AUTO, count: int | None = None) -> Array:
    """Return the target's true corners (n, 4, 2) [px] in each of n pictures, from the picture's top
    left corner: those of a box clockwise from its top left one, others in the file's order; nan in
    pictures without the target.

    The target is absent if all numbers of a line are nan or missing, if the line is VOT's 0, if its
    box has width and height 0 (not in TLD's format), and, in LaSOT's and GOT-10k's layouts, in the
    frames that other files mark.

    Args:
        path: The truth file, with a line for each picture.
        form: The format. AUTO means CSV for a file with a header, OTB for groundtruth_rect*.txt and
            in GOT-10k's and LaSOT's layouts, VOT for other groundtruth*.txt and for lines of eight
            numbers, TLD for gt.txt and init.txt; a file of another name is read as VOT, unless all
            its lines of four numbers could also be TLD.
        count: Number of pictures; a truth of more than twice as many lines is refused. None:
            unknown.

    Raises:
        ValueError: The file cannot be read or has no line or too many, a line does not fit the
            format, AUTO cannot decide, or a file that marks absent frames does not fit.
    """
    lines = reading.text(path, "truth", LARGEST_FILE).rstrip().splitlines()
    if not lines:
        raise ValueError(f"{path}: this truth has no lines: it needs one for each picture")
    if count is not None and len(lines) > MOST_LINES * (count + 1):
        raise ValueError(other_count(str(path), len(lines), count))
    has_header = (
        HEADER.match(lines[0])
        and not MASK.match(lines[0])
        and not lines[0].strip().lower().startswith("nan")
    )
    if form is Format.CSV or (form is Format.AUTO and has_header):
        try:
            return _of_csv(lines, path)
        except csv.Error as error:
            raise ValueError(f"{path}: this is not a valid CSV file: {error}: correct it") from None
    places = [f"{path.name}, line {i}" for i in range(1, len(lines) + 1)]
    rows = [_numbers(line.strip(), place) for line, place in zip(lines, places, strict=True)]
    if form is Format.AUTO:
        form = _format_of(path, rows)
    for beside in _absence_files(path):
        for i in np.flatnonzero(_marked_absent(path, beside, len(rows))):
            rows[i] = np.full(BOX, np.nan)  # some of the boxes there have negative sides
    return np.stack([_corners(row, form, place) for row, place in zip(rows, places, strict=True)])


def has_masks(path: Path) -> bool:
    """Return True if a truth file (true outlines of a target) begins with a mask of VOT, the pixels
    of the target; `read` replaces a mask by the box around it.

    Raises:
        ValueError: The file cannot be read.
    """
    return bool(MASK.match(reading.text(path, "truth", LARGEST_FILE)))


def _format_of(path: Path, rows: list[Array]) -> Format:
    """Return the format of a truth file by its name, the files beside it, and its numbers.

    Raises:
        ValueError: The numbers could be boxes or two corners.
    """
    # GOT-10k's authors: "all coordinate values are 1-based" (github.com/got-10k/toolkit, issue 6).
    is_got10k = any((path.parent / name).exists() for name in GOT10K_FILES)
    if OTB_NAME.match(path.name) or (is_got10k and VOT_NAME.match(path.name)) or _is_lasot(path):
        return Format.OTB
    if VOT_NAME.match(path.name) or not all(len(row) == BOX for row in rows):
        return Format.VOT
    if path.name in TLD_NAMES:
        return Format.TLD
    given = np.array([row for row in rows if np.isfinite(row).all()]).reshape(-1, BOX)
    if len(given) and _may_be_corners(given):
        raise ValueError(f"{path}: these numbers may be x,y,w,h or x1,y1,x2,y2; {REMEDY}")
    return Format.VOT


def _is_lasot(path: Path) -> bool:
    """Return True if a truth file is in LaSOT's layout, by the files beside it."""
    # The smallest coordinate is 1 (github.com/HengLan/LaSOT_Evaluation_Toolkit, issue 14).
    beside = all((path.parent / name).exists() for name in LASOT_FILES)
    return beside and bool(VOT_NAME.match(path.name))


def _absence_files(path: Path) -> list[Path]:
    """Return the files beside a truth file that mark frames without the target: LaSOT's two, or
    GOT-10k's one.
    """
    if _is_lasot(path):
        return [path.parent / name for name in LASOT_FILES]
    got10k = path.parent / ABSENCE
    return [got10k] if VOT_NAME.match(path.name) and got10k.exists() else []


def _marked_absent(path: Path, beside: Path, count: int) -> NDArray[np.bool_]:
    """Return a mask (count,), True in frames without the target by a file beside a truth of `count`
    lines.

    Raises:
        ValueError: It cannot be read, or has not `count` numbers 0 or 1.
    """
    marks = reading.text(beside, "truth", LARGEST_FILE).replace(",", " ").split()
    if len(marks) != count or not set(marks) <= {"0", "1"}:
        raise ValueError(
            f"{beside}: expected {count} numbers 0 or 1, one for each line of {path.name}"
        )
    return np.array(marks) == "1"


def check_boxes(corners: Array, size: tuple[int, int], place: str) -> None:
    """Check whether a truth file was read in the wrong format: as boxes x,y,w,h, of which some end
    outside the picture, though its numbers could be two corners x1,y1,x2,y2 (TLD) inside the
    picture.

    Args:
        corners: True corners (n, 4, 2) of the target [px], nan in frames without it.
        size: Width and height of the pictures [px].
        place: Path of the truth file, for messages.

    Raises:
        ValueError: The numbers seem to be x1,y1,x2,y2 but were read as x,y,w,h.
    """
    seen = corners[np.isfinite(corners).all(axis=(1, 2))]
    given = boxes(seen)
    most = np.add(size, 1)
    upright = len(seen) > 0 and np.allclose(corners_of(given[0]), seen[0])
    outside = (given[:, :2] + given[:, 2:] > most).any()
    if upright and outside and _may_be_corners(given) and (given[:, 2:] <= most).all():
        raise ValueError(
            f"{place}: read as x,y,w,h, these numbers place the target outside the picture, and "
            f"they may be x1,y1,x2,y2; {REMEDY}"
        )


def _may_be_corners(given: Array) -> bool:
    """Return True if the numbers of all lines (n, 4) [px] could be two corners x1,y1,x2,y2, with
    x2 > x1 and y2 > y1.
    """
    return bool((given[:, 2:] > given[:, :2]).all())


def _corners(row: Array, form: Format, place: str) -> Array:
    """Return the corners (4, 2) [px] that the numbers of a line stand for in a format.

    Args:
        row: The numbers (4,) or (8,).
        form: The format of the file.
        place: Name of file and line, for messages.

    Raises:
        ValueError: The numbers do not fit the format.
    """
    if form in (Format.OTB, Format.TLD) and len(row) != BOX:
        raise ValueError(
            f"{place}: the line has {len(row)} numbers: expected 4, as in format {form.name}; "
            f"correct the line, or {REMEDY}"
        )
    if len(row) == QUAD:
        if crosses_itself(row.reshape(4, 2)):
            raise ValueError(
                f"{place}: the corners are not in order around the target: two sides cross; "
                "reorder the corners"
            )
        return corners_of(row)
    if form is Format.TLD:
        if (row[2:] <= row[:2]).any():
            given = ",".join(f"{number:g}" for number in row)
            raise ValueError(
                f"{place}: {given} is not x1,y1,x2,y2 with x2 > x1 and y2 > y1: correct that line, "
                f"or {REMEDY}"
            )
        return corners_of(np.concatenate([row[:2], row[2:] - row[:2]]))
    width, height = row[2:]
    if width == height == 0:
        return np.full((4, 2), np.nan)
    if width <= 0 or height <= 0:
        raise ValueError(
            f"{place}: the target is {width:g} x {height:g} px: both sides should be positive; "
            "correct that line"
        )
    # OTB counts pixels from 1.
    return corners_of(row) - (1.0 if form is Format.OTB else 0.0)


def _numbers(line: str, place: str) -> Array:
    """Return the numbers (4,) or (8,) of a line [px]; nan if the target is absent. For a mask, they
    are x, y, width, height of the box around it.

    Raises:
        ValueError: The line is neither 4 or 8 numbers nor a mask; `place` names it in the message.
    """
    if MASK.match(line):
        return _around_mask(line, place)
    parts = line.split(";") if ";" in line else line.split(",") if "," in line else line.split()
    try:
        numbers = np.array([float(part) for part in parts])
    except ValueError:
        hint = " (if a comma is a decimal sign, write a point)" if "," in line else ""
        raise ValueError(
            f"{place}: '{line[:LONGEST]}' is not a line of numbers{hint}: correct it"
        ) from None
    if numbers.tolist() == ABSENT:
        return np.full(BOX, np.nan)
    if len(numbers) not in (BOX, QUAD):
        raise ValueError(
            f"{place}: the line has {len(numbers)} numbers: expected 4 of a box, or 8 of four "
            "corners; correct the line"
        )
    if not np.isnan(numbers).all() and not (np.abs(numbers) <= FARTHEST).all():
        raise ValueError(
            f"{place}: '{line[:LONGEST]}' is not a position in a picture: all numbers must be "
            f"from -{FARTHEST:g} to {FARTHEST:g}, or all nan for an absent target"
        )
    return numbers


def _around_mask(line: str, place: str) -> Array:
    """Return x, y, width, height (4,) [px] of the box around a mask of VOT; nan for an empty mask.

    The line is the letter m, then x, y, width, height of a rectangle, then the lengths of runs of
    zeros, ones, zeros ... through the rectangle's rows, one row after the other.

    Raises:
        ValueError: The line is not such a mask; `place` names it in the message.
    """
    try:
        x, y, width, height, *runs = (int(part) for part in line.removeprefix("m").split(","))
    except ValueError:
        raise ValueError(
            f"{place}: '{line[:LONGEST]}' is not a mask of VOT: after the m it should have x, y, "
            "width, height and the lengths of runs, all whole numbers separated by commas, such as "
            "m10,20,3,2,0,6"
        ) from None
    reach = max(abs(x), abs(y))
    if reach > FARTHEST or max(width, height) > LARGEST_PICTURE or min(width, height, *runs) < 0:
        raise ValueError(
            f"{place}: '{line[:LONGEST]}' is not a mask in a picture: a number is negative or too "
            "large; correct that line"
        )
    if sum(runs) > width * height:
        raise ValueError(
            f"{place}: the runs of this mask have {sum(runs)} pixels, but its rectangle only "
            f"{width * height}; correct that line"
        )
    mask = np.zeros(width * height, bool)
    mask[: sum(runs)] = np.repeat(np.arange(len(runs)) % 2 == 1, np.array(runs, int))
    rows, columns = (np.flatnonzero(mask.reshape(height, width).any(axis=k)) for k in (1, 0))
    if not len(rows):
        return np.full(BOX, np.nan)
    corner = [x + columns[0], y + rows[0]]
    return np.array([*corner, np.ptp(columns) + 1, np.ptp(rows) + 1], float)


def _frame(text: str, place: str) -> float:
    """Return the number of a frame in a line of a CSV file; `place` names the line in messages.

    Raises:
        ValueError: The text is not a number.
    """
    try:
        return float(text)
    except ValueError:
        raise ValueError(
            f"{place}: the frame is '{text}', but should be a number: correct it"
        ) from None


def _of_csv(lines: list[str], path: Path) -> Array:
    """Return the corners (n, 4, 2) [px] in the lines of a CSV file with a header.

    Raises:
        ValueError: Columns are missing, a line does not fit the header, the numbers of a column
            "frame" are not consecutive, or there is no line.
        csv.Error: The lines are not valid CSV.
    """
    header, *table = csv.reader(lines, skipinitialspace=True, strict=True)
    names = [name.strip() for name in header]
    wanted = next((n for n in (CORNERS, *BOX_NAMES) if set(n) <= set(names)), None)
    if wanted is None:
        need = "x1..y4, or left, top, width, height"
        raise ValueError(f"{path.name}: the columns are {', '.join(names)}; a truth needs {need}")
    rows: list[Array] = []
    begin: float | None = None
    for i, row in enumerate(table, 2):
        place = f"{path.name}, line {i}"
        if len(row) != len(names):
            raise ValueError(
                f"{place}: the line has {len(row)} columns, but the header has {len(names)}; "
                "correct or delete that line"
            )
        if FRAME in names:
            frame = _frame(row[names.index(FRAME)], place)
            begin = frame if begin is None else begin
            if frame != begin + len(rows):
                raise ValueError(
                    f"{place}: the frame is {frame:g}, expected {begin + len(rows):g}: sort the "
                    "lines by their frames, and give a line for each picture"
                )
        numbers = ";".join(row[names.index(name)].strip() or "nan" for name in wanted)
        rows.append(_corners(_numbers(numbers, place), Format.VOT, place))
    if not rows:
        raise ValueError(
            f"{path}: this truth has no lines below its header: it needs one for each picture"
        )
    return np.stack(rows)
