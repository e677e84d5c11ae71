"""A run to its end, and what was measured in it."""

from __future__ import annotations

from collections.abc import Callable

from servo.loop.episode import run
from servo.loop.run_measures import Summary, summarise
from servo.loop.step import Step
from servo.scenario.load import Scenario


def measured_run(
    scenario: Scenario, each: Callable[[Step], None] | None = None
) -> tuple[list[Step], Summary]:
    """Run a scenario to its end; its steps without pictures, and what was measured.

    Args:
        scenario: Which.
        each: Called with every step while it has its picture.

    Raises:
        Mistake: As for `Episode`.
    """
    steps: list[Step] = []
    for step in run(scenario):
        if each is not None:
            each(step)
        steps.append(step.light())
    return steps, summarise(steps, scenario.measure, 1 / scenario.camera.rate)
