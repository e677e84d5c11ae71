"""Lines of the TraX protocol (Cehovin 2017), for both ends of it.

A message is a line @@TRAX:TYPE with quoted arguments and named ones (key=value); all other lines
are a program's own output. In versions 1 to 3 `initialize` carries picture and region; in version 4
it carries the region, and a `frame` with the picture follows.
"""

import base64
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from sim.quiet import silent_libraries
from sim.types import Array, Image

PREFIX = "@@TRAX:"
TYPES = {"hello", "initialize", "frame", "state", "status", "quit"}
ARGUMENT = re.compile(r'"((?:[^"\\]|\\.)*+)"|(\S+)')
"""An argument in quotes, or without. The possessive repetition takes linear time on a line whose
quotes are not closed, as a crashing server leaves it."""
NAMED = re.compile(r"([\w.]{1,64})=(.*)", re.ASCII | re.DOTALL)
SPECIAL = re.compile(r'[\\"\n]')
ESCAPED = {"\\": "\\\\", '"': '\\"', "\n": "\\n"}
BOX = 4
FEWEST_NUMBERS = 6
"""Numbers of a rectangle, and fewest of a polygon."""
PNG = [cv2.IMWRITE_PNG_COMPRESSION, 1]
MASK = "m"
"""First letter of a region that is a mask."""


@dataclass(frozen=True, slots=True)
class Message:
    """One message."""

    type: str
    arguments: Sequence[str] = ()
    named: Mapping[str, str] = field(default_factory=dict[str, str])

    def line(self) -> str:
        """Return the line that is sent."""
        texts = [*self.arguments, *(f"{key}={value}" for key, value in self.named.items())]
        quoted = [f'"{SPECIAL.sub(lambda m: ESCAPED[m[0]], text)}"' for text in texts]
        return f"{PREFIX}{' '.join([self.type, *quoted])}\n"


def message_in(line: str) -> Message | None:
    """Return the message in a line; None for any other line."""
    if not line.startswith(PREFIX):
        return None
    name, _, rest = line.removeprefix(PREFIX).strip().partition(" ")
    if name.lower() not in TYPES:
        return None
    texts = [
        plain or re.sub(r"\\(.)", lambda m: "\n" if m[1] == "n" else m[1], quoted)
        for quoted, plain in ARGUMENT.findall(rest)
    ]
    pairs = [NAMED.fullmatch(text) for text in texts]
    arguments = [text for text, pair in zip(texts, pairs, strict=True) if pair is None]
    kind = "state" if name.lower() == "status" else name.lower()
    return Message(kind, arguments, {p[1]: p[2] for p in pairs if p})


def region_text(numbers: Array) -> str:
    """Return a box (4,), or corners (n, 2), as a region."""
    return ",".join(f"{number:.4f}" for number in numbers.ravel().tolist())


def region_in(text: str) -> Array | None:
    """Return a box (4,) or a polygon (n, 2) [px]; None for a code, or a box of zeros: the target is
    not seen.

    Raises:
        ValueError: It is a mask, or no region.
    """
    if text.startswith(MASK):
        raise ValueError("a mask; rectangles and polygons are known")
    try:
        numbers = np.array([float(part) for part in text.split(",")])
    except ValueError:
        raise ValueError("no region") from None
    if len(numbers) == 1 or (len(numbers) == BOX and not numbers.any()):
        return None
    if len(numbers) == BOX:
        return numbers
    if len(numbers) < FEWEST_NUMBERS or len(numbers) % 2:
        raise ValueError("no region")
    return numbers.reshape(-1, 2)


def picture_text(image: Image, formats: Sequence[str], file: Path) -> str:
    """Return an RGB picture in a format that the server takes: raw in the message, as PNG in it, or
    in a file.
    """
    if "memory" in formats:
        height, width = image.shape[:2]
        return f"image:{width};{height};rgb;{base64.b64encode(image.tobytes()).decode()}"
    png = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), PNG)[1].tobytes()
    if {"buffer", "data"} & set(formats) and "path" not in formats:
        return f"data:image/png;{base64.b64encode(png).decode()}"
    file.write_bytes(png)
    return f"file://{file}"


def picture_in(text: str) -> Image | Path:
    """Return the RGB picture in a message, or the path of its file.

    Raises:
        ValueError: It cannot be decoded.
    """
    scheme, _, rest = text.partition(":")
    try:
        if scheme == "image":
            width, height, kind, data = rest.split(";", 3)
            pixels = np.frombuffer(base64.b64decode(data), np.uint8)
            image = pixels.reshape(int(height), int(width), -1)
            return image if kind == "rgb" else np.repeat(image[..., :1], 3, axis=2)
        if scheme == "data":
            data = re.sub(r"^[^;,]*[;,](?:base64[;,])?", "", rest)
            with silent_libraries():
                read: Any = cv2.imdecode(np.frombuffer(base64.b64decode(data), np.uint8), 1)
            return cv2.cvtColor(read, cv2.COLOR_BGR2RGB).astype(np.uint8, copy=False)
    except (ValueError, cv2.error):
        raise ValueError(f"the picture {text[:40]}... cannot be decoded") from None
    return Path(rest.removeprefix("//") if scheme == "file" else text)
