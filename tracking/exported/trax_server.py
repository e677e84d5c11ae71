"""Server of the TraX protocol with a tracker of any kind, such as for the VOT toolkit: `python -m
tracking.exported.trax_server KIND`.
"""

import sys
from collections.abc import Iterable, Iterator
from typing import TextIO

from sim.files.bit_depth import BitDepth
from sim.kinds import PartConfig
from sim.types import Array, Frame
from tracking import configured
from tracking.evaluation.warm_up import warm_up
from tracking.exported.command_line import serve
from tracking.exported.served import Served
from tracking.guests.guest import GuestSettings
from tracking.guests.report import Report, box_around
from tracking.guests.trax_messages import (
    CONFIDENCE,
    CORNERS,
    NOT_SEEN,
    SEEN,
    Message,
    message_in,
    picture_in,
    region_in,
    region_text,
)
from tracking.sequences.quadrilateral import corners_of, placement
from tracking.sequences.sources import RATE
from tracking.types import Tracker

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
    preset: str | None = None,
    *,
    requests: TextIO | None = None,
    answers: TextIO | None = None,
    **settings: object,
) -> None:
    """Serve a TraX client: receive pictures and send the target's regions, until the client quits
    or its input ends.

    The tracker is compiled and loaded before the first message (hello), because clients limit the
    time of each answer: the VOT toolkit ends a server after 30 s.

    Args:
        kind: Kind of the tracker; see `tracking.create`.
        seed: Seed of the tracker's random draws.
        rate: Rate of the pictures [1/s].
        preset: Name of one of the kind's presets, such as "paper" for the settings of the
            tracker's paper; None for the defaults, the best settings known.
        requests: Stream of the client's messages; None: standard input.
        answers: Stream of our messages; None: standard output.
        **settings: Settings of the tracker.

    Raises:
        ValueError: There is no such kind or preset, or a setting has a wrong value; the client
            sends a region or picture that cannot be used, or a message that is not expected, such
            as a picture before a region; or the tracker cannot be loaded, or fails.
        TypeError: The tracker has no such setting.
    """
    out = answers or sys.stdout
    config = configured(kind, preset, **settings)
    if not isinstance(config, GuestSettings):
        warm_up(config)
    for message in _conversation(kind, config, seed, rate, requests or sys.stdin):
        out.write(message.line())
        out.flush()


def _conversation(
    kind: str, config: PartConfig[Tracker], seed: int, rate: float, requests: Iterable[str]
) -> Iterator[Message]:
    """Yield our messages: a hello, then the answer to each picture that a client sends.

    Raises:
        ValueError: The client sends a region or picture that cannot be used, or a message that is
            not expected; or the tracker cannot be loaded, or fails.
    """
    served = Served(config, seed)
    declared = {} if served.gives is None else {"trax.gives": ";".join(sorted(served.gives))}
    yield Message("hello", named=ABOUT | {"trax.name": kind} | declared)
    given: Array | None = None  # a region, until its first picture comes
    region: Array | None = None
    count = 0
    depth = BitDepth()
    for message in filter(None, map(message_in, requests)):
        match (message.type, *message.arguments):
            case ("quit", *_):
                return
            case ("initialize", text) if given is None:
                given = _region(text)
                continue
            case ("initialize", picture, *_, text) if given is None:
                given = _region(text)
            case ("frame", picture, *_) if given is not None or region is not None:
                pass
            case _:
                raise ValueError(
                    f"the client sent {message.line().strip()[:60]!r}, but one region is expected, "
                    "then its pictures"
                )
        image = picture_in(picture, depth)
        if given is not None:
            if region is not None:
                served = Served(config, seed)  # a target is given anew
            region = given
            given = None
            count = 0
            exact = region.ndim == 1 or len(region) == CORNERS
            numbers = region.ravel() if exact else box_around(region)
            served.start(Frame(image, 0.0, 0), *placement(corners_of(numbers), turned=True))
            yield _answer(region, Report(confidence=1.0))
        else:
            count += 1
            report = served.update(Frame(image, count / rate, count))
            is_box = region is not None and region.ndim == 1
            outline = box_around(served.outline) if is_box else served.outline
            yield _answer(outline, report)


def _region(text: str) -> Array:
    """Return the client's region: a box (4,) x, y, width, height, or a polygon (n, 2) [px].

    Raises:
        ValueError: The text is not a region, or the box or mask in it has no area.
    """
    try:
        region = region_in(text)
    except ValueError as error:
        raise ValueError(f"the client's region {text[:40]!r} cannot be used: {error}") from None
    if region is None or (region.ndim == 1 and region[2:].min() <= 0):
        raise ValueError(f"the client's region {text[:40]!r} has no area: send one that has")
    return region


def _answer(region: Array, report: Report) -> Message:
    """Return the message that answers a picture: a box (4,) or an outline (n, 2) [px], with the
    confidence and whether the target is seen, both from a report.
    """
    named = {} if report.confidence is None else {CONFIDENCE: f"{report.confidence:.6f}"}
    return Message(
        "state", [region_text(region)], named | ({} if report.seen else {SEEN: NOT_SEEN})
    )


if __name__ == "__main__":
    serve("tracking.exported.trax_server", run_trax, seeded=True)
