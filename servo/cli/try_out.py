"""The trial of trackers of other authors before the first of many runs: a program that cannot start
would fail in each run, each time after its time limit.
"""

from collections.abc import Iterable

import numpy as np
from rich.console import Console

from servo.cli.terminal import plain
from servo.mistake import as_mistake
from sim.types import Frame
from tracking.guests.guest import GuestSettings
from tracking.guests.process import ProcessSettings
from tracking.types import Region, State


def try_out(trackers: Iterable[object], console: Console) -> None:
    """Start each tracker of another author on a picture of noise, and end it.

    Args:
        trackers: Settings of trackers; equal ones are tried once, and servobench's own trackers
            not at all.
        console: The output, which says for what the command waits.

    Raises:
        Mistake: A tracker cannot be loaded or started.
    """
    tried = list[object]()
    noise = np.random.default_rng(0).integers(0, 256, (240, 320, 3), np.uint8)
    for settings in trackers:
        if not isinstance(settings, GuestSettings) or settings in tried:
            continue
        tried.append(settings)
        if isinstance(settings, ProcessSettings):
            plain(
                console,
                f"waiting at most {settings.loading:g} s for the first answer of "
                f"'{settings.command}'",
            )
        with as_mistake():
            guest = settings.guest(seed=0)
            guest.start(Frame(noise, 0.0, 0), Region(80.0, 60.0), State(160.0, 120.0))
