"""The trial of trackers and policies of other authors before the first of many runs: a program that
cannot start would fail in each run, each time after its time limit.
"""

from collections.abc import Iterable

import numpy as np
from rich.console import Console

from servo.cli.terminal import plain
from servo.controllers.program import Config as PolicySettings
from servo.mistake import as_mistake
from sim.types import Frame
from tracking.guests.guest import GuestSettings
from tracking.guests.process import ProcessSettings
from tracking.types import Region, State


def try_out(parts: Iterable[object], console: Console) -> None:
    """Start each tracker of another author on a picture of noise, and each policy that is a
    program, to see whether it works before many runs depend on it.

    Args:
        parts: Settings of trackers and controllers; equal ones are tried once, and servobench's own
            ones not at all.
        console: The output, which says for what the command waits.

    Raises:
        Mistake: A tracker or policy cannot be loaded or started.
    """
    tried = list[object]()
    noise = np.random.default_rng(0).integers(0, 256, (240, 320, 3), np.uint8)
    for settings in parts:
        if not isinstance(settings, GuestSettings | PolicySettings) or settings in tried:
            continue
        tried.append(settings)
        if isinstance(settings, ProcessSettings | PolicySettings):
            plain(
                console,
                f"waiting at most {settings.loading:g} s for the first answer of "
                f"'{settings.command}'",
            )
        with as_mistake():
            if isinstance(settings, PolicySettings):
                settings.build(np.random.default_rng(0))
                continue
            guest = settings.guest(seed=0)
            guest.start(Frame(noise, 0.0, 0), Region(80.0, 60.0), State(160.0, 120.0))
