"""Server of the protocol of `tracking.guests.program_client` with any tracker, such as a class of
your own in a process of its own: `python -m tracking.exported.program_server module:Class`.
"""

import argparse
import json
import sys
import tomllib
from collections.abc import Mapping
from contextlib import redirect_stdout
from typing import Any, BinaryIO

import numpy as np

from sim.installed import plain
from sim.types import Frame, Image
from tracking import configured
from tracking.evaluation.warm_up import warm_up
from tracking.exported.served import Served
from tracking.guests.guest import GuestSettings
from tracking.guests.report import Report
from tracking.types import Region, State


def run_program(
    kind: str,
    preset: str | None = None,
    *,
    requests: BinaryIO,
    answers: BinaryIO,
    **settings: object,
) -> None:
    """Serve a client until its input ends. The tracker is loaded before the first answer.

    Args:
        kind: Kind of the tracker; see `tracking.create`.
        preset: "paper" for the settings in the paper that describes the tracker; None for the best
            settings known.
        requests: Stream of the client's lines and pictures.
        answers: Stream of our lines.
        **settings: Settings of the tracker.

    Raises:
        ValueError: There is no such kind or preset, a setting has a wrong value, or the client
            sends something else than the protocol has.
        TypeError: The tracker has no such setting.
    """
    config = configured(kind, preset, **settings)
    if not isinstance(config, GuestSettings):
        warm_up(config)
    served: Served | None = None
    while line := requests.readline():
        asked: Mapping[str, Any] = json.loads(line)
        if "seed" in asked:
            served = Served(config, asked["seed"])
            answer = {} if served.gives is None else {"gives": sorted(served.gives)}
        elif served is None:
            raise ValueError("the client sent a picture before its first line, which has the seed")
        else:
            answer = _answer(served, asked, _picture(requests, asked))
        answers.write(json.dumps(answer).encode() + b"\n")
        answers.flush()


def _answer(served: Served, asked: Mapping[str, Any], image: Image) -> Mapping[str, object]:
    """Return the answer to a picture (H, W, 3) and the line before it."""
    frame = Frame(image, asked["time"], asked["index"])
    if "corners" not in asked:
        return _words(served.update(frame))
    corners = np.array(asked["corners"], dtype=float)
    width, height = (float(np.hypot(*(corners[k] - corners[0]))) for k in (1, 3))
    x, y = corners.mean(axis=0).tolist()
    served.start(frame, Region(width, height), State(x, y, asked["angle"]))
    return {}


def _picture(requests: BinaryIO, asked: Mapping[str, Any]) -> Image:
    """Read the picture (H, W, 3) that follows a line.

    Raises:
        ValueError: The client's input ends within it.
    """
    shape = asked["height"], asked["width"], 3
    count = int(np.prod(shape))
    data = requests.read(count)
    if len(data) < count:
        raise ValueError(f"the client sent {len(data)} of the {count} bytes of a picture")
    return np.frombuffer(data, np.uint8).reshape(shape)


def _words(report: Report) -> Mapping[str, object]:
    """Return a report as a mapping that JSON can write; what is not known is left out."""
    given = {
        "box": None if report.box is None else report.box.tolist(),
        "angle": report.angle,
        "corners": None if report.corners is None else report.corners.tolist(),
        "confidence": report.confidence,
        "seen": None if report.seen else False,
    }
    return {key: value for key, value in given.items() if value is not None}


def main() -> None:
    """Serve the tracker that the command line names until the client ends; exit code 1 for an
    error, 2 for a wrong command line, 130 for Ctrl-C.
    """
    parser = argparse.ArgumentParser(prog="python -m tracking.exported.program_server")
    parser.add_argument("kind")
    parser.add_argument("settings", nargs="*", help="such as particles=80")
    parser.add_argument("--preset")
    given = parser.parse_args()
    if None in (sys.stdin, sys.stdout):
        parser.error("standard input or output is closed, but a client needs both")
    requests = sys.stdin.buffer
    answers = sys.stdout.buffer
    try:
        settings = tomllib.loads("\n".join(given.settings))
        with redirect_stdout(sys.stderr):  # what a tracker prints is no answer
            run_program(given.kind, given.preset, requests=requests, answers=answers, **settings)
    except KeyboardInterrupt:
        raise SystemExit(130) from None
    except (ValueError, TypeError, OSError) as error:
        raise SystemExit(f"program_server: {plain(str(error))}") from None


if __name__ == "__main__":
    main()
