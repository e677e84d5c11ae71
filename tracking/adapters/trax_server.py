"""Our trackers for clients of the TraX protocol: `python -m tracking.adapters.trax_server KIND`."""

import argparse
import sys
import tomllib
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from sim.files.picture_file import read_image
from sim.types import Array, Image
from tracking.adapters.follower import Follower
from tracking.external.trax_messages import Message, message_in, picture_in, region_in, region_text
from tracking.sequences.sources import RATE

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
        seed: Of its random draws.
        rate: Of the pictures [1/s].
        requests: The client's messages; None: standard input.
        answers: Where ours go; None: standard output.
        **settings: The tracker's settings.

    Raises:
        ValueError: The client shows no region or no picture, or a frame before a region.
    """
    out = answers or sys.stdout

    def say(message: Message) -> None:
        out.write(message.line())
        out.flush()

    session = Session(Follower(kind, seed, rate, settings))
    say(Message("hello", named=ABOUT | {"trax.name": kind}))
    for line in requests or sys.stdin:
        asked = message_in(line)
        if asked is not None and asked.type == "quit":
            return
        if asked is not None and (answer := session.answer(asked)) is not None:
            say(answer)


class Session:
    """One conversation: the target that was given, until it is shown, then its tracker."""

    def __init__(self, follower: Follower) -> None:
        self._follower = follower
        self._given: Array | None = None
        self._boxes = True

    def answer(self, asked: Message) -> Message | None:
        """Return the answer to a message; None where none is due.

        Raises:
            ValueError: As for `run_trax`.
        """
        pictures = list(asked.arguments)
        if asked.type == "initialize":
            self._given = region_in(pictures.pop()) if pictures else None
        if not pictures:
            return None
        image = picture_in(pictures[0])
        image = read_image(image) if isinstance(image, Path) else image
        if self._given is not None:
            return self._begin(image, self._given)
        found, rect = self._follower.update(image)
        region = np.array(rect) if self._boxes else found.outline(self._follower.region)
        return _state(region, 1.0 - found.distance)

    def _begin(self, image: Image, given: Array) -> Message:
        self._follower.start(image, given.ravel(), turned=True)
        self._given = None
        self._boxes = given.ndim == 1
        return _state(given, 1.0)


def _state(region: Array, confidence: float) -> Message:
    return Message("state", [region_text(region)], {"confidence": f"{confidence:.6f}"})


def main() -> None:
    """Serve what the command line names."""
    parser = argparse.ArgumentParser(prog="python -m tracking.adapters.trax_server")
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
