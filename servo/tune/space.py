"""The settings that `servobench tune` searches, with the range or the values of each."""

import re
from collections.abc import Sequence

import numpy as np

from servo.mistake import Mistake
from servo.scenario.draws import LAWS, Draw, law_of
from servo.scenario.load import Scenario
from servo.scenario.toml import Table, assignment
from servo.study.plan import check_key
from servo.study.scenario_run import StudiedScenario

NUMBER = r"([-+]?\d*\.?\d+(?:e[-+]?\d+)?)"
RANGE = re.compile(rf"{NUMBER}:{NUMBER}(:log)?")
NOISES = {
    "kalman_cv": {"ratio": (1e-3, 10.0)},
    "kalman_ca": {"ratio": (1e-3, 10.0), "acceleration_ratio": (1e-4, 10.0)},
    "integral": {"gain": (0.1, 50.0)},
}
"""Settings of estimators that are searched by default, and their ranges: those tuned for cameras of
30 and of 5 Hz are inside."""
PREDICTS = "error_kalman"
"""The estimator that predicts the error for the time at which a late command acts."""
PREDICTING = (PREDICTS, "imm", "true")
BELOW = 50.0
"""The smallest gain that is searched is this many times below the largest."""
LARGEST_GAIN = 1000.0


def asked(texts: Sequence[str]) -> list[Draw]:
    """Return the settings that a user names to be searched, each with its range or values.

    Args:
        texts: Texts such as "controller.gain=0.2:5:log" or "estimator.kind=none,imm".

    Raises:
        Mistake: A text has another form, a setting cannot be searched (such as run.seed), a range
            is wrong, or two texts name one setting. Whether the setting exists is not checked.
    """
    draws = list(map(_read, texts))
    if len({draw.key for draw in draws}) < len(draws):
        raise Mistake("--settings: one setting is given twice: leave one of them out")
    return draws


def _read(text: str) -> Draw:
    at = f"--settings {text}"
    key, _, given = map(str.strip, text.partition("="))
    found = RANGE.fullmatch(given)
    parts = given.split(",")
    if not key or (found is None and len(set(parts)) < 2):
        raise Mistake(
            f"{at}: write KEY=LOW:HIGH, KEY=LOW:HIGH:log or KEY=A,B,C, such as "
            "controller.gain=0.2:5:log"
        )
    check_key(key, at)
    if found is None:
        return Draw(key, "choice", tuple(assignment(f"{key}={part}")[1] for part in parts))
    low, high = float(found[1]), float(found[2])
    if low >= high:
        raise Mistake(f"{at}: write the lower end of the range first: {high:g}:{low:g}")
    law = "log_uniform" if found[3] else "uniform"
    return Draw(key, *law_of({law: [low, high]}, at, LAWS))


def usual(scenario: Scenario, own: Table) -> list[Draw]:
    """Return the settings that are searched if the user names none, each with its range or values:
    controller.gain [1/s], up to where the delay makes a loop with an integrator unstable or to
    twice its own value, whichever is more, but at most to 1000; the noise ratios or the gain of the
    estimator; and, if commands act more than one frame late and the estimator does not predict the
    error, estimator.kind: the scenario's own or "error_kalman".

    Args:
        scenario: The scenario.
        own: All settings of the scenario by dotted key.

    Raises:
        Mistake: The scenario has none of these settings.
    """
    rate = scenario.camera.rate
    tracker = scenario.run.tracker_ms
    late = scenario.run.frames_late(1 / rate)
    late += 0.0 if isinstance(tracker, str) else 1e-3 * tracker * rate
    kind = str(own["estimator.kind"])
    gain = own.get("controller.gain")
    noises = NOISES.get(kind, {}).items()
    draws = [Draw(f"estimator.{name}", "log_uniform", ends) for name, ends in noises]
    if isinstance(gain, float):
        most = max(2 * rate * float(np.sin(np.pi / (4 * late + 2))), 2 * gain)
        ends = min(most / BELOW, gain / 2), min(most, LARGEST_GAIN)
        draws.insert(0, Draw("controller.gain", "log_uniform", ends))
    if late > 1 and kind not in PREDICTING:
        draws.append(Draw("estimator.kind", "choice", (kind, PREDICTS)))
    if not draws:
        raise Mistake(
            f"{scenario.name}: its law and its estimator have no usual settings to search: name "
            "some with --settings"
        )
    return draws


def check(draws: Sequence[Draw], base: StudiedScenario, seed: int, own: Table) -> None:
    """Check that a scenario accepts each end of the ranges, and each value, of the settings to
    search.

    Args:
        draws: The settings with their ranges or values.
        base: The scenario.
        seed: Seed of the run for which settings are checked.
        own: All settings of the scenario by dotted key.

    Raises:
        Mistake: The scenario has no such setting, or refuses a value.
    """
    for key, value in [(draw.key, value) for draw in draws for value in draw.ends]:
        try:
            base.parsed(seed, finished({key: value}, own))
        except Mistake as error:
            raise Mistake(f"--settings {key} = {value}: {error}") from None


def finished(proposed: Table, own: Table) -> Table:
    """Return the settings of a candidate (by dotted key) from proposed values: without kinds that
    the scenario has anyway, without settings of a component whose kind is replaced, and rounded
    where the scenario has whole numbers.

    Args:
        proposed: Proposed values by dotted key.
        own: All settings of the scenario by dotted key.
    """
    kinds = {k: v for k, v in proposed.items() if k.endswith(".kind") and v != own.get(k)}
    replaced = tuple(key.removesuffix("kind") for key in kinds)
    return kinds | {
        key: round(value) if isinstance(value, float) and type(own.get(key)) is int else value
        for key, value in proposed.items()
        if not key.endswith(".kind") and not key.startswith(replaced)
    }
