"""Server of the protocol of `tracking.guests.program_client` with any tracker, such as a class of
your own in a process of its own: `python -m tracking.exported.program_server module:Class`.
"""

import json
import sys
from collections.abc import Iterator, Mapping
from contextlib import redirect_stdout
from typing import Any, BinaryIO

import numpy as np

from sim.kinds import PartConfig
from sim.types import Frame, Image
from tracking import configured
from tracking.evaluation.warm_up import warm_up
from tracking.exported.command_line import serve
from tracking.exported.served import Served
from tracking.guests.guest import GuestSettings
from tracking.guests.report import Report
from tracking.types import Region, State, Tracker

KEYS = ("width", "height", "index", "time")
"""Keys that each line before a picture has."""


def run_program(
    kind: str,
    preset: str | None = None,
    *,
    requests: BinaryIO | None = None,
    answers: BinaryIO | None = None,
    **settings: object,
) -> None:
    """Run a tracker for a client that speaks the protocol of `tracking.guests.program_client`:
    lines of JSON, and pictures as raw bytes.

    The tracker is loaded before the first answer, and runs until the client's input ends.

    Args:
        kind: Kind of the tracker; see `tracking.create`.
        preset: Name of one of the kind's presets, such as "paper" for the settings of the
            tracker's paper; None for the defaults, the best settings known.
        requests: Stream of the client's lines and pictures; None: standard input.
        answers: Stream of the answers (lines of JSON); None: standard output. What a tracker prints
            goes to standard error.
        **settings: Settings of the tracker.

    Raises:
        ValueError: There is no such kind or preset, a setting has a wrong value, the client sends
            something else than the protocol has, or the tracker cannot be loaded, refuses the
            target's region or the picture, or fails.
        TypeError: The tracker has no such setting.
    """
    lines = requests or sys.stdin.buffer
    out = answers or sys.stdout.buffer
    with redirect_stdout(sys.stderr):  # what a tracker prints is no answer
        config = configured(kind, preset, **settings)
        if not isinstance(config, GuestSettings):
            warm_up(config)
        for answer in _conversation(config, lines):
            out.write(json.dumps(answer).encode() + b"\n")
            out.flush()


def _conversation(
    config: PartConfig[Tracker], requests: BinaryIO
) -> Iterator[Mapping[str, object]]:
    """Yield the answer to each line that a client sends.

    Raises:
        ValueError: The client sends a picture before a seed, or a line that is not JSON or lacks a
            key; or the client's input ends within a picture.
    """
    served: Served | None = None
    while line := requests.readline():
        asked: Mapping[str, Any] = json.loads(line)
        if "seed" in asked:
            served = Served(config, asked["seed"])
            yield {} if served.gives is None else {"gives": sorted(served.gives)}
        elif served is None:
            raise ValueError(
                "the client sent a picture before a line with the seed: it must send that line "
                'first, such as {"seed": 7}'
            )
        else:
            _check_keys(asked)
            yield _answer(served, asked, picture_in(requests, asked))


def _check_keys(asked: Mapping[str, Any]) -> None:
    """Check that the line before a picture has all keys that it needs.

    Raises:
        ValueError: A key is missing.
    """
    for key in (*KEYS, *(("angle",) if "corners" in asked else ())):
        if key not in asked:
            raise ValueError(
                f"the client sent a line without '{key}' before a picture; it needs "
                f"{', '.join(KEYS)}, and for the first picture corners and angle"
            )


def _answer(served: Served, asked: Mapping[str, Any], image: Image) -> Mapping[str, object]:
    """Start the tracker on a client's first picture, RGB (H, W, 3), or find the target in a later
    one. Return the answer for the client: {} for the first picture, else the tracker's report.

    Args:
        served: The tracker.
        asked: The line before the picture; that of the first one has the target's corners.
        image: The picture.
    """
    frame = Frame(image, asked["time"], asked["index"])
    if "corners" not in asked:
        return _words(served.update(frame))
    corners = np.array(asked["corners"], dtype=float)
    width, height = (float(np.hypot(*(corners[k] - corners[0]))) for k in (1, 3))
    x, y = corners.mean(axis=0).tolist()
    served.start(frame, Region(width, height), State(x, y, asked["angle"]))
    return {}


def picture_in(requests: BinaryIO, asked: Mapping[str, Any]) -> Image:
    """Read the bytes of a picture from the client's input `requests`, and return it, RGB, uint8 (H,
    W, 3); `asked` is the line before them, with the picture's "height" and "width" [px].

    Raises:
        ValueError: The client's input ends within the picture.
    """
    shape = asked["height"], asked["width"], 3
    count = int(np.prod(shape))
    data = requests.read(count)
    if len(data) < count:
        raise ValueError(
            f"the client sent only {len(data)} of the {count} bytes of a picture, then its input "
            "ended: it must send height x width x 3 bytes"
        )
    return np.frombuffer(data, np.uint8).reshape(shape)


def _words(report: Report) -> Mapping[str, object]:
    """Return a report as a mapping that JSON can write, with "seen" only for a target that is not
    seen; what is not reported is left out.
    """
    given = {
        "box": None if report.box is None else report.box.tolist(),
        "angle": report.angle,
        "corners": None if report.corners is None else report.corners.tolist(),
        "confidence": report.confidence,
        "seen": None if report.seen else False,
    }
    return {key: value for key, value in given.items() if value is not None}


if __name__ == "__main__":
    serve("tracking.exported.program_server", run_program)
