"""The tables of a scenario's file, and the dataclasses of their settings."""

from contextlib import suppress
from typing import Any

from servo.goals.faced import GoalConfig
from servo.loop.settings import (
    MeasureConfig,
    RegionConfig,
    RunConfig,
    StartConfig,
)
from servo.scenario.catalogue import LISTS, PLUGINS
from servo.sight.estimate_to_sight import SightConfig
from sim.camera.camera import CameraConfig
from sim.kinds import UnknownKind
from sim.leader import LeaderConfig
from sim.miscalibration import BelievedConfig
from sim.surroundings import ClutterConfig, GroundConfig, LightConfig
from sim.world import WorldConfig

SECTIONS: dict[str, type[Any]] = {
    "run": RunConfig,
    "world": WorldConfig,
    "camera": CameraConfig,
    "goal": GoalConfig,
    "leader": LeaderConfig,
    "start": StartConfig,
    "region": RegionConfig,
    "sight": SightConfig,
    "believed": BelievedConfig,
    "measure": MeasureConfig,
    "ground": GroundConfig,
    "clutter": ClutterConfig,
    "light": LightConfig,
}
"""Tables without a `kind`."""
TABLES = (*SECTIONS, *PLUGINS, *LISTS)
"""The tables of settings."""
SETTABLE = (*TABLES, "vary", "expect")
"""The tables that a keyword may set."""
KEYS = (*SETTABLE, "sweep")
"""All keys of a scenario's file."""


def section_of(setting: str) -> str:
    """Return the table of a setting such as "start.x"."""
    return setting.partition(".")[0]


def config_of(section: str, kind: str | None = None) -> type[Any] | None:
    """Return the dataclass of a table's settings.

    Args:
        section: The table, or the list of such tables.
        kind: Its kind; None: the default one.

    Returns:
        The class; None if the table is unknown, or its kind cannot be used, which parsing reports.
    """
    if section in SECTIONS:
        return SECTIONS[section]
    kinds, default = PLUGINS.get(section) or (LISTS.get(section), None)
    kind = kind or default
    if kinds is None or kind is None:
        return None
    with suppress(UnknownKind):
        return kinds.config_of(kind)
    return None
