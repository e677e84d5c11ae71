"""A web page on 127.0.0.1 on which the user draws the target's region with the mouse, for machines
without a desktop.

The page's address holds a random token, so that neither other users of the machine nor other pages
in the browser can answer. The server ends with the first answer.
"""

import base64
import itertools
import secrets
import webbrowser
from collections.abc import Iterator
from importlib import resources
from queue import Empty, Queue
from typing import Literal

import pydantic
from jinja2 import Environment, StrictUndefined
from rich.console import Console

from servo.cli.terminal import plain
from servo.mistake import Mistake
from servo.output.local_page import HOST, LocalHandler, LocalServer, has_display
from sim.types import Image
from tracking.drawing.picture_bytes import encoded
from tracking.sequences.sources import Picture

Number = pydantic.FiniteFloat
Box = tuple[Number, Number, Number, Number, Number]
"""Left, top, width, height [px], and rotation about the centre [deg]."""
PATIENCE = 600.0
"""Time to wait for an answer [s]."""
QUALITY = 92
"""JPEG quality of the picture."""
LONGEST = 1000
"""Longest answer [bytes]."""
HEADERS = {
    "Content-Type": "text/html; charset=utf-8",
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Frame-Options": "DENY",
    "Content-Security-Policy": "default-src 'none'; img-src data:; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'; connect-src 'self'",
}

CANCELLED = "cancelled"
"""The answer of a user who cancels."""
ANSWER = pydantic.TypeAdapter[Box | Literal["cancelled"]](Box | Literal["cancelled"])


def select(
    source: str, pictures: Iterator[Picture], region: str | None
) -> tuple[str, Iterator[Picture]]:
    """Let the user draw the target's region in the first picture, on a page in a browser.

    Args:
        source: Name of the source, for the page and for errors.
        pictures: The pictures of the source.
        region: The value of the option --region, which must be None.

    Returns:
        The region as a text "X,Y,W,H[,DEG]" (top left corner and size [px] before a clockwise
        rotation about its centre [deg]), and an iterator over all pictures, the first one included.

    Raises:
        Mistake: The option --region is given too, there is no first picture, it cannot be read, or
            the user drew no region.
        ValueError: The source cannot be read.
    """
    if region is not None:
        raise Mistake("--region and --select are both given: leave out one")
    first = next(pictures, None)
    if first is None:
        raise Mistake(f"{source}: this source has no pictures: give another one")
    if first.image is None:
        raise Mistake(
            f"{first.name}: the first picture cannot be read ({first.reason}): begin with another "
            "picture"
        )
    box = ask(first.image, source)
    if box is None:
        raise Mistake("--select: no region was drawn; run again, or give --region X,Y,W,H[,DEG]")
    text = ",".join(f"{number:.6g}" for number in (box if box[4] else box[:4]))
    plain(Console(stderr=True), f"to choose the same region again: --region {text}")
    return text, itertools.chain([first], pictures)


def ask(image: Image, name: str) -> Box | None:
    """Serve a page on 127.0.0.1 on which the user draws a region in a picture, print its address on
    stderr, open it in a browser where there is a desktop, and wait for the answer.

    Args:
        image: The picture, RGB (H, W, 3).
        name: The source's name, for the title.

    Returns:
        Five numbers: left, top, width and height of the region before its rotation [px], and its
        clockwise rotation about its centre [deg]; None if the user cancelled.

    Raises:
        Mistake: The user did not answer within 10 minutes.
    """
    page = _page(image, name)
    answers = Queue[Box | None]()

    def choose(request: LocalHandler) -> None:
        """Take the region that the user draws, or the word that cancels, as JSON."""
        try:
            length = min(int(request.headers.get("Content-Length", "0")), LONGEST)
            found = ANSWER.validate_json(request.rfile.read(length), strict=True)
        except ValueError:
            request.send(400, b"this is not a region", HEADERS)
            return
        request.send(200, b"", HEADERS)
        answers.put(None if found == CANCELLED else found)

    path = f"/{secrets.token_urlsafe(16)}"
    requests = {
        f"GET {path}": lambda request: request.send(200, page, HEADERS),
        f"POST {path}": choose,
    }
    with LocalServer(0, requests, path) as server:
        address = server.address
        plain(
            Console(stderr=True),
            f"draw the region on this page: {address}",
            f"  (to open the page on another machine, first run there: "
            f"ssh -L {server.port}:{HOST}:{server.port} THIS-MACHINE)",
        )
        if has_display():
            webbrowser.open(address)
        try:
            return answers.get(timeout=PATIENCE)
        except Empty:
            raise Mistake(
                f"--select: nobody drew a region on {address} within {PATIENCE:g} s; "
                "give --region X,Y,W,H[,DEG]"
            ) from None
        finally:
            server.shutdown()


def _page(image: Image, name: str) -> bytes:
    """Return the HTML page with a picture, RGB (H, W, 3), and the source's name as the title."""
    template = (resources.files("servo.cli") / "templates" / "region.html.jinja").read_text("utf-8")
    page = Environment(undefined=StrictUndefined, autoescape=True).from_string(template)
    height, width = image.shape[:2]
    picture = base64.b64encode(encoded(image, QUALITY)).decode()
    text = page.render(name=name, width=width, height=height, picture=picture)
    return text.encode(errors="replace")
