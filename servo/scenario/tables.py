"""Names of the tables in a scenario's TOML file, and the dataclass of the settings in each."""

from contextlib import suppress
from typing import Any

from servo.goals.faced import GoalConfig
from servo.goals.picture_world import AtGoalConfig
from servo.loop.settings import (
    MeasureConfig,
    RegionConfig,
    RunConfig,
    StartConfig,
)
from servo.scenario.catalogue import LISTS, PLUGINS
from servo.scenario.recording import SECTION as RECORDING
from servo.scenario.recording import RecordingConfig
from servo.sight.estimate_to_sight import SightConfig
from sim.camera.camera import CameraConfig
from sim.kinds import UnknownKind
from sim.leader import LeaderConfig
from sim.miscalibration import BelievedConfig
from sim.surroundings import ClutterConfig, GroundConfig, LightConfig, WallsConfig
from sim.world import WorldConfig

SECTIONS: dict[str, type[Any]] = {
    "run": RunConfig,
    "world": WorldConfig,
    "camera": CameraConfig,
    "goal": GoalConfig,
    "at_goal": AtGoalConfig,
    "leader": LeaderConfig,
    "start": StartConfig,
    "region": RegionConfig,
    "sight": SightConfig,
    "believed": BelievedConfig,
    "measure": MeasureConfig,
    "ground": GroundConfig,
    "walls": WallsConfig,
    "clutter": ClutterConfig,
    "light": LightConfig,
    RECORDING: RecordingConfig,
}
"""Tables without a `kind`, and their dataclasses."""
TABLES = (*SECTIONS, *PLUGINS, *LISTS)
"""Names of all tables with settings of a run."""
SETTABLE = (*TABLES, "vary", "expect")
"""Names of the tables that keywords of Python may change."""
KEYS = (*SETTABLE, "sweep")
"""Names of all tables in a scenario's file."""


def section_of(setting: str) -> str:
    """Return the name of the scenario's table that has a setting, the part before the first dot:
    "start" for "start.x".
    """
    return setting.partition(".")[0]


def config_of(section: str, kind: str | None = None) -> type[Any] | None:
    """Return the dataclass of the settings in a table of a scenario; None if there is no such
    table, or if its kind is unknown or cannot be imported.

    Args:
        section: Name of the table, or of a list of tables such as "disturbances".
        kind: Kind of the component that the table describes, which tables such as "run" do not
            have; None: the default kind, and for lists, which have no default, the result is None.
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
