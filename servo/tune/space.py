"""The settings that a search changes, with the range or the values of each."""

import re
from collections.abc import Sequence

import numpy as np

from servo.mistake import Mistake
from servo.scenario.draws import Draw, law_of
from servo.scenario.load import Scenario
from servo.scenario.toml import Table, assignment, is_table
from servo.study.plan import check_key
from servo.study.scenario_run import StudiedScenario

NUMBER = r"\s*([-+.\deE]+)\s*"
RANGE = re.compile(rf"{NUMBER}:{NUMBER}(:\s*log\s*)?")
LAWS = {"uniform": 2, "log_uniform": 2, "choice": None}
"""Forms of a range, as in [vary], and their numbers of values."""
FORMS = "KEY=LOW:HIGH, KEY=LOW:HIGH:log or KEY=A,B,C"
NOISES = {
    "kalman_cv": {"ratio": (1e-3, 10.0)},
    "jump": {"ratio": (1e-3, 10.0)},
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


def read(text: str) -> Draw:
    """Return the setting and the range or the values in a text such as "controller.gain=0.2:5:log"
    or "estimator.kind=none,imm"; a distribution is written as in a study,
    "controller.gain={log_uniform=[0.2,5]}".

    Raises:
        Mistake: The text has another form, or a number is wrong.
    """
    at = f"--settings {text}"
    key, equals, given = text.partition("=")
    if not equals or not key.strip() or not given.strip():
        raise Mistake(f"{at}: write {FORMS}, such as controller.gain=0.2:5:log")
    found = RANGE.fullmatch(given)
    if found:
        law = "log_uniform" if found[3] else "uniform"
        given = f"{{{law}=[{found[1]},{found[2]}]}}"
    parts = [given] if given.lstrip().startswith(("{", "[")) else given.split(",")
    values = [assignment(f"{key}={part}")[1] for part in parts]
    key = key.strip()
    check_key(key, at)
    draw = Draw(key, *law_of(values[0] if is_table(values[0]) else {"choice": values}, at, LAWS))
    if len(set(map(str, draw.numbers))) < len(draw.numbers):
        raise Mistake(f"{at}: a value is there twice: write {FORMS}")
    return draw


def asked(texts: Sequence[str]) -> tuple[Draw, ...]:
    """Return the settings that a command line names, those that choose a kind first.

    Raises:
        Mistake: A text is wrong, or two name one setting.
    """
    draws = sorted(map(read, texts), key=lambda draw: not draw.key.endswith(".kind"))
    keys = [draw.key for draw in draws]
    for key in keys:
        if keys.count(key) > 1:
            raise Mistake(f"--settings {key}: this setting is given twice: leave one of them out")
    return tuple(draws)


def usual(scenario: Scenario) -> tuple[Draw, ...]:
    """Return the settings that are searched where a user names none: the gain, up to where the
    delay makes the loop of an integrator unstable; the noises of the estimator; and, if commands
    act more than one frame late, whether it predicts.

    Raises:
        Mistake: The scenario has none of them.
    """
    period = 1 / scenario.camera.rate
    tracker = scenario.run.tracker_ms
    computing = 0.0 if isinstance(tracker, str) else 1e-3 * tracker / period
    late = scenario.run.frames_late(period) + computing
    settings = scenario.settings()
    kind = value_of(settings, "estimator.kind")
    gain = value_of(settings, "controller.gain")
    draws = list[Draw]()
    if late > 1 and kind not in PREDICTING:
        draws.append(Draw("estimator.kind", "choice", (kind, PREDICTS)))
    if isinstance(gain, float):
        most = max(2 * float(np.sin(np.pi / (4 * late + 2))) / period, 2 * gain)
        ends = min(most / BELOW, gain / 2), min(most, LARGEST_GAIN)
        draws.append(Draw("controller.gain", "log_uniform", ends))
    for name, ends in NOISES.get(str(kind), {}).items():
        draws.append(Draw(f"estimator.{name}", "log_uniform", ends))
    if not draws:
        raise Mistake(
            f"{scenario.name}: its law and its estimator have no usual settings to search: name "
            "some with --settings"
        )
    return tuple(draws)


def check(draws: Sequence[Draw], base: StudiedScenario, seed: int) -> None:
    """Check each end and each value of the settings that are searched in a scenario.

    Raises:
        Mistake: The scenario has no such setting, or refuses a value.
    """
    base.parsed(seed, {})
    for draw in draws:
        for value in draw.ends:
            try:
                base.parsed(seed, {draw.key: value})
            except Mistake as error:
                raise Mistake(f"--settings {draw.key} = {value}: {error}") from None


def of_kinds(settings: Table, own: Table) -> Table:
    """Return the settings of a candidate without kinds that the scenario has anyway, and without
    settings that belong to a kind which the candidate replaces.

    Args:
        settings: Values by dotted key.
        own: All settings of the scenario, by table.
    """
    kinds = {key for key in settings if key.endswith(".kind")}
    kept = {key for key in kinds if settings[key] == value_of(own, key)}
    replaced = {key.removesuffix(".kind") for key in kinds - kept}
    return {
        key: value
        for key, value in settings.items()
        if key not in kept and (key in kinds or key.partition(".")[0] not in replaced)
    }


def value_of(settings: Table, key: str) -> object:
    """Return the value of a setting by its dotted key in all settings of a scenario; None if it is
    not set, or inside of a list.
    """
    section, _, name = key.partition(".")
    return _part(settings, section).get(name)


def _part(settings: Table, name: str) -> Table:
    """Return the settings of a table of a scenario; an empty table without it."""
    part = settings.get(name)
    return part if is_table(part) else {}
