"""Settings that are given and change nothing, because of other settings: a sentence each."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from servo.controllers._law_settings import LawSettings
from servo.loop.episode import Episode
from servo.loop.settings import Setup
from servo.parts import OwnInverse
from servo.scenario.draws import flat
from servo.scenario.load import Scenario
from servo.scenario.tables import TABLES
from servo.types import DOF
from sim.kinds import kind_of

WITHOUT_EGO = ("cv_mil", "opencv", "trax")
"""Trackers of others, which are given pictures only."""


@dataclass(frozen=True, slots=True)
class Need:
    """What some settings need to have an effect."""

    settings: tuple[str, ...]
    """Dotted keys."""
    is_met: Callable[[Episode], bool]
    """Whether they have one in an episode."""
    otherwise: str
    """Why they have none."""


def idle_settings(episode: Episode) -> list[str]:
    """Return a sentence for each setting that is given, and has no effect in an episode."""
    scenario = episode.scenario
    if not isinstance(scenario, Scenario):
        return []
    table = {name: part for name, part in scenario.table.items() if name in TABLES}
    given = {*flat(table, scenario.name), *scenario.drawn}
    return [
        f"{setting} has no effect: {need.otherwise}"
        for need in NEEDS
        for setting in need.settings
        if setting in given and not need.is_met(episode)
    ]


def _of_scenario(is_met: Callable[[Setup], object]) -> Callable[[Episode], bool]:
    """Return what looks at the settings alone."""
    return lambda episode: bool(is_met(episode.scenario))


def _of_law(is_met: Callable[[LawSettings], object]) -> Callable[[Episode], bool]:
    """Return what looks at the settings of a law of ours; others have their own."""

    def found(episode: Episode) -> bool:
        law = episode.scenario.controller
        return not isinstance(law, LawSettings) or bool(is_met(law))

    return found


def _has_six_joints(episode: Episode) -> bool:
    return len(episode.world.robot.names) >= len(DOF)


def _law_inverts(episode: Episode) -> bool:
    return not isinstance(episode.loop.features, OwnInverse)


def _weights_choose(episode: Episode) -> bool:
    """Return whether a part of the twist stands, or several could move a feature."""
    law = episode.scenario.controller
    if not isinstance(law, LawSettings):
        return True
    features = len(episode.loop.features.names)
    moves = law.moves(six=features >= len(DOF))
    return bool((np.array(law.weights)[moves] == 0).any() or moves.sum() > features)


def _sight_is_servoed(episode: Episode) -> bool:
    return not episode.loop.uses_pictures


NEEDS = (
    Need(
        ("goal.change_start", "goal.change_duration"),
        _of_scenario(lambda s: s.goal.depth_to is not None),
        "the goal stays without goal.depth_to",
    ),
    Need(
        ("leader.size", "leader.on", "leader.beside"),
        _of_scenario(lambda s: s.leader.id is not None),
        "there is no leader without leader.id",
    ),
    Need(
        ("start.tilt_towards_deg",),
        _of_scenario(lambda s: s.start.tilt_deg),
        "the start is level without start.tilt_deg",
    ),
    Need(
        ("clutter.shape", "clutter.alike"),
        _of_scenario(lambda s: s.clutter.number),
        "there is no clutter without clutter.number",
    ),
    Need(
        ("ground.tile",),
        _of_scenario(lambda s: s.ground.kind != "wood"),
        "wood lies once on the whole table",
    ),
    Need(
        ("camera.bands",),
        _of_scenario(lambda s: s.camera.readout_ms),
        "there is no rolling shutter without camera.readout_ms",
    ),
    Need(
        ("sight.table_height",),
        _of_scenario(lambda s: "known" in (s.sight.plane, s.sight.depth)),
        'nothing is taken from the table without sight.plane or sight.depth = "known"',
    ),
    Need(
        ("sight.plane", "sight.depth", "sight.table_height"),
        _sight_is_servoed,
        "pixels are servoed",
    ),
    Need(
        ("run.ego",),
        _of_scenario(lambda s: kind_of(s.tracker) not in WITHOUT_EGO),
        "this tracker takes no motion of the camera",
    ),
    Need(
        ("believed.ignore_distortion",),
        _of_scenario(lambda s: s.camera.lens is not None),
        "the camera's lens does not distort",
    ),
    Need(
        ("believed.goal",),
        lambda episode: episode.world.camera_believed is not episode.world.camera,
        "the camera is believed as it is, so all of them are the same",
    ),
    Need(
        ("controller.gain_slope",),
        _of_law(lambda law: law.gain_far not in (None, law.gain)),
        "the gain does not adapt without another controller.gain_far",
    ),
    Need(
        ("controller.secondary_gain",),
        _of_law(lambda law: law.secondary),
        "there is no task without controller.secondary",
    ),
    Need(
        ("controller.search_speed",),
        _of_law(lambda law: law.search_after is not None),
        "the camera never searches without controller.search_after",
    ),
    Need(
        ("controller.dof", "controller.weights"),
        _has_six_joints,
        "the robot has fewer than six joints, and these decide what moves",
    ),
    Need(
        ("controller.weights",),
        _weights_choose,
        "there are no more parts of the twist to move than features, so none has a choice",
    ),
    Need(
        ("controller.dof", "controller.weights"),
        _law_inverts,
        "these features bring their own way from the error to the twist",
    ),
)
"""In the order in which they are said."""
