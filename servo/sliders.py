"""Sliders over settings of a scenario, for notebooks (extra `notebook`)."""

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

from servo.mistake import Mistake, check_known
from servo.result import MISSING, simulate
from servo.scenario.catalogue import PLUGINS
from servo.scenario.draws import flat
from servo.scenario.load import Scenario, load
from servo.scenario.tables import config_of

STEPS = 150
"""Steps of a slider."""
REACH = 3.0
"""A slider goes from 0 to this many times the setting's value; from 0 to 1 where that is 0."""


def explore(scenario: str | Path, *keys: str) -> Any:
    """Return a box of widgets, one for each setting, and a button that runs the scenario with them.

    Args:
        scenario: Its name or its file.
        *keys: Settings, such as "controller.gain" and "controller.matrix".

    Returns:
        A widget, which a notebook shows; the last run is its `result`.

    Raises:
        Mistake: There is no such scenario or setting, or the extra 'notebook' is missing.
    """
    if find_spec("ipywidgets") is None:
        raise Mistake(f"explore: {MISSING}")
    loaded = load(scenario)
    values = flat(loaded.settings(), "settings")
    check_known(keys, values, "explore", "setting")
    widgets: Any = import_module("ipywidgets")
    display: Any = import_module("IPython.display")

    def run(**chosen: Any) -> Any:
        result = simulate(scenario, **chosen)
        display.clear_output(wait=True)  # a widget's output cannot take the progress bar away
        display.display(result)
        return result

    shown = {key: _widget(widgets, loaded, key, values[key]) for key in keys}
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
            most = int(REACH * value) or 1
            return widgets.IntSlider(value=value, min=0, max=most, description=key)
        case float():
            most = REACH * abs(value) or 1.0
            least = -most if value < 0 else 0.0
            step = most / STEPS
            return widgets.FloatSlider(value=value, min=least, max=most, step=step, description=key)
        case _:
            raise Mistake(f"explore: {key} = {value!r} is neither a number nor one of some words")


def _choices(scenario: Scenario, key: str) -> tuple[Any, ...]:
    """Return the words that a setting may be; none for a number."""
    section, _, setting = key.partition(".")
    if setting == "kind":
        return tuple(PLUGINS[section][0].names())
    kind = scenario.settings()[section].get("kind")
    hint = get_type_hints(config_of(section, kind)).get(setting)
    return get_args(hint) if get_origin(hint) is Literal else ()
