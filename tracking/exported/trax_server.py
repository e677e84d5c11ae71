"""Our trackers for clients of the TraX protocol: `python -m tracking.exported.trax_server KIND`."""

import argparse
import sys
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from sim.files.picture_file import read_image
from sim.types import Array
from tracking.exported.toolkits import Follower
from tracking.sequences.sources import RATE
from tracking.wrapped.trax_messages import Message, message_in, picture_in, region_in, region_text

ABOUT = {
    "trax.version": "4",
    "trax.region": "rectangle;polygon;",
    "trax.image": "path;memory;buffer;",
    "trax.channels": "color;",
}


def run_trax(
    kind: str,
    seed: int = 0,
    rate: float = RATE,
    *,
    requests: TextIO | None = None,
    answers: TextIO | None = None,
    **settings: Any,
) -> None:
    """Follow what a TraX client shows until it quits.

    Args:
        kind: The tracker; see `tracking.create`.
        seed: Seed of its random draws.
        rate: Rate of the pictures [1/s].
        requests: The client's messages; None: standard input.
        answers: Stream for our messages; None: standard output.
        **settings: The tracker's settings.

    Raises:
        ValueError: The client shows no region or no picture, or a frame before a region.
    """
    out = answers or sys.stdout
    follower = Follower(kind, seed, rate, settings)
    for message in _conversation(kind, follower, requests or sys.stdin):
        out.write(message.line())
        out.flush()


def _conversation(kind: str, follower: Follower, requests: Iterable[str]) -> Iterator[Message]:
    """Yield a hello, and the answers to a client's messages."""
    yield Message("hello", named=ABOUT | {"trax.name": kind})
    given: Array | None = None  # a region, until its first picture comes
    boxes = True
    for line in requests:
        asked = message_in(line)
        if asked is None:
            continue
        if asked.type == "quit":
            return
        pictures = list(asked.arguments)
        if asked.type == "initialize":
            given = region_in(pictures.pop()) if pictures else None
        if not pictures:
            continue
        image = picture_in(pictures[0])
        image = read_image(image) if isinstance(image, Path) else image
        if given is not None:
            follower.start(image, given.ravel(), turned=True)
            boxes = given.ndim == 1
            yield _state(given, 1.0)
            given = None
        else:
            found, rect = follower.update(image)
            region = np.array(rect) if boxes else found.outline(follower.region)
            yield _state(region, 1.0 - found.distance)


def _state(region: Array, confidence: float) -> Message:
    return Message("state", [region_text(region)], {"confidence": f"{confidence:.6f}"})


def main() -> None:
    """Serve the tracker that the command line names."""
    parser = argparse.ArgumentParser(prog="python -m tracking.exported.trax_server")
    parser.add_argument("kind")
    parser.add_argument("settings", nargs="*", help="such as particles=80")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--preset")
    given = parser.parse_args()
    try:
        settings = tomllib.loads("\n".join(given.settings))
        run_trax(given.kind, given.seed, preset=given.preset, **settings)
    except (ValueError, TypeError) as error:
        raise SystemExit(f"trax_server: {error}") from None


if __name__ == "__main__":
    main()
