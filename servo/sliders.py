"""Sliders over settings of a scenario, for notebooks (extra `notebook`)."""

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

from servo.mistake import Mistake, check_known
from servo.result import MISSING, simulate
from servo.scenario.catalogue import PLUGINS
from servo.scenario.draws import flat
from servo.scenario.keywords import of_keywords
from servo.scenario.load import Scenario, load
from servo.scenario.tables import SECTIONS, config_of

STEPS = 150
"""Steps of a slider."""
REACH = 3.0
"""A slider goes from 0 to this many times the setting's value, and as far as its name asks for."""
SPANS = {
    "_deg": (-180.0, 180.0),
    "_shift": (-50.0, 50.0),
    "_ms": (0.0, 300.0),
    "_pct": (0.0, 20.0),
    "latency": (0, 10),
    "noise": (0.0, 20.0),
    ".x": (-100.0, 100.0),
    ".y": (-100.0, 100.0),
}
"""Least range of a slider by the end of the setting's name: angles, pixels, times and shares are
often 0. What a setting may be limits it.
"""


def explore(scenario: str | Path, *keys: str) -> Any:
    """Return a box of widgets, one for each setting, and a button that runs the scenario with them.

    Args:
        scenario: Its name or its file.
        *keys: Settings, such as "controller.gain" and "controller.matrix"; "gain" alone where no
            other setting has this name.

    Returns:
        A widget, which a notebook shows; the last run is its `result`.

    Raises:
        Mistake: There is no such scenario or setting, or the extra 'notebook' is missing.
    """
    if find_spec("ipywidgets") is None:
        raise Mistake(f"explore: {MISSING}")
    loaded = load(scenario)
    values = flat(loaded.settings(), "settings")
    whole = {
        change.key: key for key in keys for change in of_keywords({key: 0}, [*SECTIONS], [*values])
    }
    check_known(list(whole), values, "explore", "setting")
    widgets: Any = import_module("ipywidgets")
    display: Any = import_module("IPython.display")

    def run(**chosen: Any) -> Any:
        result = simulate(scenario, **chosen)
        display.clear_output(wait=True)  # a widget's output cannot take the progress bar away
        display.display(result)
        return result

    shown = {key: _widget(widgets, loaded, key, values[key]) for key in whole}
    for widget in shown.values():
        widget.style.description_width = "initial"  # else a long name is cut
    return widgets.interactive(run, {"manual": True, "manual_name": "Run"}, **shown)


def _widget(widgets: Any, scenario: Scenario, key: str, value: Any) -> Any:
    """Return the widget of a setting, with the value that the scenario has."""
    choices = _choices(scenario, key)
    if choices:
        return widgets.Dropdown(options=choices, value=value, description=key)
    match value:
        case bool():
            return widgets.Checkbox(value=value, description=key)
        case int():
            least, most = map(int, _range(scenario, key, value))
            return widgets.IntSlider(value=value, min=least, max=most, description=key)
        case float():
            least, most = _range(scenario, key, value)
            step = (most - least) / STEPS
            return widgets.FloatSlider(value=value, min=least, max=most, step=step, description=key)
        case _:
            raise Mistake(f"explore: {key} = {value!r} is neither a number nor one of some words")


def _range(scenario: Scenario, key: str, value: float) -> tuple[float, float]:
    """Return the ends of a slider, which the setting's own limits cut."""
    named = next((span for end, span in SPANS.items() if key.endswith(end)), None)
    least, most = named or (0.0, 0.0 if value else 1.0)
    if named is None or not least:  # an angle goes round, and a place lies within the picture
        least, most = min(least, REACH * value), max(most, REACH * value)
    for limit in getattr(_hint(scenario, key), "__metadata__", ()):
        least = max(least, getattr(limit, "ge", getattr(limit, "gt", least)))
        most = min(most, getattr(limit, "le", getattr(limit, "lt", most)))
    return min(least, value), max(most, value)


def _choices(scenario: Scenario, key: str) -> tuple[Any, ...]:
    """Return the words that a setting may be; none for a number."""
    section, _, setting = key.partition(".")
    if setting == "kind":
        return tuple(PLUGINS[section][0].names())
    hint = _hint(scenario, key)
    return get_args(hint) if get_origin(hint) is Literal else ()


def _hint(scenario: Scenario, key: str) -> Any:
    """Return a setting's type."""
    section, _, setting = key.partition(".")
    kind = scenario.settings()[section].get("kind")
    return get_type_hints(config_of(section, kind), include_extras=True).get(setting)
