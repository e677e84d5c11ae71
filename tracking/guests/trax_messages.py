"""Messages of the TraX protocol (Cehovin 2017), for clients and servers.

A message is a line @@TRAX:TYPE with quoted arguments and named ones (key=value); all other lines
are a program's own output. In versions 1 to 3 `initialize` carries picture and region; in version 4
it carries the region, and a `frame` with the picture follows.
"""

import base64
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from sim.files.bit_depth import BitDepth
from sim.files.picture_file import check_size, decoded, read_image
from sim.types import Array, Image
from tracking.types import FARTHEST

PREFIX = "@@TRAX:"
CONFIDENCE = "confidence"
"""Name of the argument in which servers report their score."""
SEEN = "seen"
NOT_SEEN = "0"
"""Argument seen=0 by which our server reports that its tracker did not see the target; TraX itself
has no message for this."""
TYPES = {"hello", "initialize", "frame", "state", "status", "quit"}
ARGUMENT = re.compile(r'"([^"\\]*+(?:\\.[^"\\]*+)*+)"|(\S+)')
"""An argument with or without quotes. The possessive repetitions take linear time on a line whose
quotes are not closed, as a crashing server leaves it, and pass over a picture's text at once."""
NAMED = re.compile(r"([\w.]{1,64})=(.*)", re.ASCII | re.DOTALL)
SPECIAL = re.compile(r'[\\"\n]')
ESCAPE = re.compile(r"\\(.)")
ESCAPED = {"\\": "\\\\", '"': '\\"', "\n": "\\n"}
BOX = 4
"""Number of numbers of a box: x, y, width, height."""
DECIMALS = 9
"""Decimals of a number [px] in the text of a region: more than a report keeps, so that the sides of
a box follow exactly from its corners."""
MASK = "m"
"""First letter of a mask's text. Whole numbers follow: left, top, width, height of the part of the
picture that it covers, and the lengths of its runs of zeros and ones, row by row, zeros first."""
FEWEST_NUMBERS = 6
"""Fewest numbers of a polygon: x, y of three corners."""
CORNERS = 4
"""Number of corners of the polygons whose angle can be used; other polygons are replaced by the
upright box around them."""
PNG = [cv2.IMWRITE_PNG_COMPRESSION, 1]
BYTES = {"rgb": 3, "gray8": 1, "gray16": 2}
"""Bytes of a pixel in each format of raw pictures."""


@dataclass(frozen=True, slots=True)
class Message:
    """A message of the TraX protocol: its type, such as "frame", its arguments in order, and its
    named arguments.
    """

    type: str
    """One of `TYPES`."""
    arguments: Sequence[str] = ()
    named: Mapping[str, str] = field(default_factory=dict[str, str])

    def line(self) -> str:
        """Return the message as the line of text that is sent, with its newline."""
        texts = [*self.arguments, *(f"{key}={value}" for key, value in self.named.items())]
        quoted = [f'"{SPECIAL.sub(lambda m: ESCAPED[m[0]], text)}"' for text in texts]
        return f"{PREFIX}{' '.join([self.type, *quoted])}\n"


def message_in(line: str) -> Message | None:
    """Return the TraX message in a received line of text; None if the line is other output, or the
    message's type is unknown. A message of the type "status", an old name, gets the type "state".
    """
    if not line.startswith(PREFIX):
        return None
    name, _, rest = line.removeprefix(PREFIX).strip().partition(" ")
    if name.lower() not in TYPES:
        return None
    texts = [
        plain or (ESCAPE.sub(_unescaped, quoted) if "\\" in quoted else quoted)
        for quoted, plain in ARGUMENT.findall(rest)
    ]
    pairs = [NAMED.fullmatch(text) for text in texts]
    arguments = [text for text, pair in zip(texts, pairs, strict=True) if pair is None]
    kind = "state" if name.lower() == "status" else name.lower()
    return Message(kind, arguments, {p[1]: p[2] for p in pairs if p})


def _unescaped(found: re.Match[str]) -> str:
    """Return the character that a backslash and a letter stand for."""
    return "\n" if found[1] == "n" else found[1]


def region_text(numbers: Array) -> str:
    """Return a box (4,) x, y, width, height, or corners (n, 2) [px] as the text of a region, with
    nine decimals at most.
    """
    texts = (f"{number:.{DECIMALS}f}" for number in numbers.ravel().tolist())
    return ",".join(text.rstrip("0").rstrip(".") for text in texts)


def mask_text(corners: Array, image: Image) -> str:
    """Return a convex region in a picture (H, W, 3) as the text of a TraX mask: lengths of runs of
    pixels outside and inside. A pixel is inside if its centre is.

    Args:
        corners: The region's corners (n, 2) [px], clockwise in the image.
        image: The picture, whose size the mask gets.
    """
    height, width = image.shape[:2]
    mask = np.ones((height, width), dtype=np.int8)
    y, x = np.mgrid[:height, :width] + 0.5  # the middles of the pixels
    for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        mask &= (x1 - x0) * (y - y0) >= (y1 - y0) * (x - x0)
    flat = np.concatenate([[0], mask.ravel()])
    ends = np.flatnonzero(np.diff(flat))
    runs = np.diff(np.concatenate([[0], ends, [mask.size]])).tolist()
    return f"{MASK}0,0,{width},{height},{','.join(map(str, runs))}"


def region_in(text: str) -> Array | None:
    """Return the box (4,) x, y, width, height, or the polygon (n, 2) [px] in the text of a region;
    of a mask the box around it.

    Returns:
        None where the target is not seen: for a single number, a box of zeros or an empty mask.

    Raises:
        ValueError: The text has another form, or its mask has numbers that are not possible.
    """
    try:
        numbers = np.array(text.removeprefix(MASK).split(","), dtype=float)
    except ValueError:
        numbers = np.empty(0)
    count = len(numbers)
    if text.startswith(MASK) and count > BOX:
        return _box_of_mask(numbers)
    if count == 1 or (count == BOX and not numbers.any()):
        return None
    polygon = count >= FEWEST_NUMBERS and count % 2 == 0
    if text.startswith(MASK) or not (polygon or count == BOX) or not np.isfinite(numbers).all():
        raise ValueError("a region of TraX should be a rectangle, a polygon or a mask")
    return numbers.reshape(-1, 2) if polygon else numbers


def _box_of_mask(numbers: Array) -> Array | None:
    """Return the box (4,) x, y, width, height [px] around the ones of a mask; None for an empty
    mask.

    Args:
        numbers: Left, top, width, height of the mask, and the lengths of its runs.

    Raises:
        ValueError: A number is not whole or is too large, or the runs do not fit the size.
    """
    if not (np.abs(numbers) <= FARTHEST).all() or (numbers != numbers.round()).any():  # nan is not
        raise ValueError("the mask of the region has a number that is not whole, or is too large")
    left, top, width, height, *runs = numbers.astype(int).tolist()
    check_size(width, height, "the mask of this region")
    if min(runs) < 0 or sum(runs) > width * height:
        raise ValueError("the mask of the region has runs that do not fit its width and height")
    is_one = np.arange(len(runs)) % 2 == 1
    found = np.flatnonzero(np.repeat(is_one, runs))
    if not len(found):
        return None
    columns = found % width
    rows = found // width
    low = columns.min(), rows.min()
    high = columns.max() + 1, rows.max() + 1
    sides = high[0] - low[0], high[1] - low[1]
    return np.array([left + low[0], top + low[1], *sides], dtype=float)


def picture_text(image: Image, formats: Sequence[str], file: Path) -> str:
    """Return an RGB picture (H, W, 3) as the argument of a message.

    Args:
        image: The picture.
        formats: Formats that the server accepts. Raw pixels in the message ("memory") are
            preferred, then PNG in a file ("path"), then PNG in the message ("buffer", "data").
        file: The file that is written for "path".
    """
    if "memory" in formats:
        height, width = image.shape[:2]
        return f"image:{width};{height};rgb;{base64.b64encode(image.tobytes()).decode()}"
    png = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), PNG)[1].tobytes()
    if {"buffer", "data"} & set(formats) and "path" not in formats:
        return f"data:image/png;{base64.b64encode(png).decode()}"
    file.write_bytes(png)
    return f"file://{file}"


def picture_in(text: str, depth: BitDepth | None = None) -> Image:
    """Return the RGB picture (H, W, 3) in an argument of a message, or in a file named there.

    Args:
        text: The argument of the message.
        depth: Number of bits that 16-bit pictures of the client use, which the first picture
            determines; None: this picture alone determines it.

    Raises:
        ValueError: The picture cannot be read or decoded, or its data do not fit its size.
    """
    scheme, _, rest = text.partition(":")
    try:
        if scheme == "image":
            width, height, kind, data = rest.split(";", 3)
            check_size(int(width), int(height))
            if kind not in BYTES:
                raise ValueError(f"the format '{kind}' is unknown; known are {', '.join(BYTES)}")
            pixels = np.frombuffer(base64.b64decode(data, validate=True), np.uint8)
            image = pixels.reshape(int(height), int(width), BYTES[kind])
            if kind == "gray16":
                image = (depth or BitDepth()).reduced(image.view("<u2"))
            return image if kind == "rgb" else np.repeat(image, 3, axis=2)
        if scheme == "data":
            return decoded(base64.b64decode(re.split("[;,]", rest)[-1], validate=True), depth)
    except ValueError as error:
        raise ValueError(f"the picture {text[:40]!r}... cannot be decoded: {error}") from None
    return read_image(Path(rest.removeprefix("//") if scheme == "file" else text), depth)
