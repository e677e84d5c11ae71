"""Refusal of bounds on what does not exist, before hours of running."""

from __future__ import annotations

from typing import Any

from servo.loop.run_measures import MEANINGS, Outcome
from servo.mistake import Mistake, unknown
from servo.scenario.catalogue import PLUGINS
from servo.scenario.expected import ANY
from servo.scenario.load import Scenario
from servo.scenario.toml import is_number


def check_expect(scenario: Scenario) -> None:
    """Refuse bounds on things that do not exist.

    Raises:
        Mistake: An unknown measure or outcome, or a bound that is no number.
    """
    place = f"{scenario.name}: expect"
    bounds = scenario.bounds
    known = PLUGINS["tracker"][0].names()
    for kind, expect in bounds.others.items():
        if kind not in (*known, ANY) and ":" not in kind:
            raise Mistake(f"{place}.tracker: {unknown(kind, known, 'tracker')}")
        _check_bounds(expect, f"{place}.tracker.{kind}")
    _check_bounds(bounds.expect | scenario.expect, place)


def _check_bounds(expect: dict[str, Any], place: str) -> None:
    for name, bound in expect.items():
        if name == "outcome":
            if not isinstance(bound, str) or bound not in Outcome.__members__:
                raise Mistake(
                    f"{place}.outcome = {bound!r}: one of {', '.join(Outcome.__members__)}"
                )
        elif name not in MEANINGS:
            raise Mistake(f"{place}: {unknown(name, (*MEANINGS, 'outcome'))}")
        elif not is_number(bound):
            raise Mistake(f"{place}.{name} = {bound!r}: a bound is a finite number")
