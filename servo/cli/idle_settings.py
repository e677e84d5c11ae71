"""Warnings about settings that a user gave and that have no effect because of other settings."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from servo.controllers._inverse import takes_own_inverse
from servo.controllers._law_settings import LawSettings
from servo.loop.episode import Episode
from servo.loop.settings import Setup, stream
from servo.parts import OwnInverse
from servo.scenario.draws import flat
from servo.scenario.load import Scenario
from servo.scenario.tables import TABLES
from servo.types import DOF, Sight
from sim.camera import gl
from sim.channels import Channel, needs_of
from sim.kinds import idle_in, kind_of
from sim.timing import Rates, exposures
from sim.types import Effect
from tracking.types import SEES_PICTURES, Trait, traits_of

OF_IMAGE = ("moments", "points", "partitioned", "polar", "segment")
"""Feature sets with values from the image alone; only their interaction matrix uses the target's
plane."""
OF_POSE = ("hybrid", "pose")
"""Feature sets that use the target's pose, and no other depth."""
LAWS = ("ibvs", "qp")
"""Shipped laws that follow an estimate of the target's motion."""


@dataclass(frozen=True, slots=True)
class Need:
    """A condition that some settings of a scenario need to have an effect, and the reason to print
    where the condition is not met.
    """

    settings: tuple[str, ...]
    """Dotted keys of the settings, or names of tables."""
    is_met: Callable[[Episode], bool]
    """Returns whether the settings have an effect in an episode."""
    otherwise: str
    """The reason why the settings have no effect."""


def idle_settings(episode: Episode) -> list[str]:
    """Return a sentence for each setting or disturbance that is set (in the scenario's file, by the
    user, or drawn for the seed) and is known to have no effect in a run, and one if the weights of
    the law let the camera stand still. The list is empty for a scenario that was built in Python,
    not loaded.
    """
    scenario = episode.scenario
    if not isinstance(scenario, Scenario):
        return []
    table = {name: part for name, part in scenario.table.items() if name in TABLES}
    given = {*flat(table, scenario.name), *scenario.drawn}
    said = {f"tracker.{name}": why for name, why in idle_in(scenario.tracker).items()}
    said = {setting: why for setting, why in said.items() if setting in given}
    for need in NEEDS:
        concerned = [s for s in given if {s, s.partition(".")[0]} & {*need.settings}]
        if concerned and not need.is_met(episode):
            said = dict.fromkeys(concerned, need.otherwise) | said
    idle = [f"{setting} has no effect: {why}" for setting, why in said.items()]
    return idle + _late(episode) + _standing(episode)


def reports_corners(scenario: Setup) -> bool:
    """Return True if the settings of a scenario's tracker declare that the tracker reports the
    target's corners; False also if they declare no properties at all.
    """
    return Trait.CORNERS in (traits_of(scenario.tracker) or ())


def _late(episode: Episode) -> list[str]:
    """Return a sentence for each disturbance that changes no picture of the run."""
    scenario = episode.scenario
    times = (np.arange(scenario.frames) / scenario.camera.rate).tolist()
    built = (
        config.build(stream(scenario.run.seed, f"disturbance {i}"))
        for i, config in enumerate(scenario.disturbances)
    )
    return [
        f"disturbances[{i}] has no effect in the {scenario.run.duration:g} s of the run"
        for i, disturbance in enumerate(built)
        if all(disturbance.at(time) == Effect() for time in times)
    ]


def _standing(episode: Episode) -> list[str]:
    """Return a list with one sentence if the law's weights let no component of the twist move,
    whatever the tracker may measure in the run; an empty list otherwise, and for a user's law or a
    robot with fewer than six joints.
    """
    law = episode.scenario.controller
    if not isinstance(law, LawSettings) or not _has_six_joints(episode):
        return []
    features = episode.loop.features
    has_weight = np.array(law.weights) > 0
    for sight in _sights(episode):
        known = features.known(sight)
        moves = law.moves_for(features, known, tilt_seen=sight.tilt_known)
        if (moves & has_weight).any():
            return []
    return [
        "the camera will stand still: controller.weights is 0 for each component of the twist that "
        "may move with the features that this tracker measures"
    ]


def _of_scenario(is_met: Callable[[Setup], object]) -> Callable[[Episode], bool]:
    """Turn a test of a scenario's settings into a test of an episode."""
    return lambda episode: bool(is_met(episode.scenario))


def _of_law(is_met: Callable[[LawSettings, Episode], object]) -> Callable[[Episode], bool]:
    """Turn a test of a shipped control law's settings into a test of an episode.

    The test is always met by a user's law, which has its own settings.
    """

    def found(episode: Episode) -> bool:
        law = episode.scenario.controller
        return not isinstance(law, LawSettings) or bool(is_met(law, episode))

    return found


def _may_see_tilt(episode: Episode) -> bool:
    """Return whether a run may measure the tilt of the target's plane: by the tracker's corners, or
    with sight.plane = "picture". A tracker that declares no traits may report corners.
    """
    s = episode.scenario
    is_known = traits_of(s.tracker) is not None
    return reports_corners(s) or s.sight.plane == "picture" or not is_known


def _sights(episode: Episode) -> list[Sight]:
    """Return copies of the desired view of the target (`Sight`), one for each combination of
    measured angle, size and tilt that a run may have; the first is for the time before the
    tracker's first report.
    """
    goal = episode.running.goal_sight
    is_seen = episode.scenario.sight.plane == "picture"
    flags = [*product((False, True), (False, True), {False, _may_see_tilt(episode)})]
    if reports_corners(episode.scenario):
        flags = [(False, False, is_seen), (True, True, True)]
    return [
        replace(goal, angle_known=angle, size_known=size, tilt_known=tilt)
        for angle, size, tilt in flags
    ]


def _dof_chooses(law: LawSettings, episode: Episode) -> bool:
    """Return whether controller.dof has an effect: the law inverts the interaction matrix (the
    feature set does not, or not while features or a tilt are unknown), or has a secondary task.
    """
    features = episode.loop.features
    if not isinstance(features, OwnInverse) or law.secondary:
        return True
    for sight in _sights(episode):
        known = features.known(sight)
        if known.any() and not takes_own_inverse(known, tilt_seen=sight.tilt_known):
            return True
    return False


def _weights_forbid(law: LawSettings, episode: Episode) -> bool:
    """Return whether some weight is 0 and so forbids a component of the twist that the law could
    use: the robot has six joints.
    """
    return 0 in law.weights and _has_six_joints(episode)


def _weights_choose(law: LawSettings, episode: Episode) -> bool:
    """Return whether controller.weights change the twist: a weight of 0 forbids a component that a
    feature needs, or more components than features may move.
    """
    features = episode.loop.features
    stands = np.array(law.weights) == 0
    for sight in _sights(episode):
        known = features.known(sight)
        moves = law.moves_for(features, known, tilt_seen=sight.tilt_known)
        has_choice = moves.sum() > known.sum() and (known.any() or law.secondary)
        if has_choice or (moves & stands).any():
            return True
    return False


def _has_six_joints(episode: Episode) -> bool:
    return len(episode.world.robot.names) >= len(DOF)


def _combines(s: Setup, features: tuple[str, ...], *laws: str) -> bool:
    """Return whether a scenario has one of these feature sets with one of these laws."""
    return kind_of(s.features) in features and kind_of(s.controller) in laws


def _takes_depth(s: Setup) -> bool:
    """Return whether the depth that the controller believes (scaled by believed.depth_factor) may
    enter an interaction matrix.
    """
    learned = _combines(s, OF_IMAGE, "broyden")
    return s.run.ego or not (learned or _combines(s, OF_POSE, "ibvs", "broyden"))


def _takes_plane(s: Setup) -> bool:
    """Return whether the target's plane may be used: the law computes the interaction matrix, the
    features are not of the image alone, a depth picture measures the plane, or run.ego is set.
    """
    return s.run.ego or bool(s.sight.needs) or not _combines(s, OF_IMAGE, "broyden")


def _lacks_corners(episode: Episode) -> bool:
    """Return whether the target's plane or depth may have to be found without the corners that a
    tracker reports.

    A feature set of which no feature is known before the first corners servoes nothing until then.
    """
    s = episode.scenario
    first, *_ = _sights(episode)
    is_used = s.run.ego or s.sight.depth == "picture"
    is_used |= kind_of(s.controller) not in (*LAWS, "broyden")
    is_used |= isinstance(s.controller, LawSettings) and bool(s.controller.secondary)
    nothing = not episode.loop.features.known(first).any()
    return is_used or not (reports_corners(s) and nothing)


def _size_is_seen(s: Setup) -> bool:
    """Return whether the size of the target that the controller believes may be used: always,
    except by a law on pixels, and there for the region of a tag, with a leader tag, or through a
    lens.
    """
    of_pixels = _combines(s, ("photometric",), *LAWS)
    is_taken = kind_of(s.target) == "tag" or s.camera.lens is not None or s.leader.id is not None
    return is_taken or not of_pixels


def _rolls(s: Setup) -> bool:
    """Return whether the rows of a picture are exposed one after the other, by a whole number of
    physics steps.
    """
    steps = Rates.of(s.world.physics_rate, s.world.drive_rate, s.camera.rate).steps
    return len(exposures(s.camera, steps)) > 1


def _blurs(s: Setup) -> bool:
    """Return whether an exposure takes a physics step or more, so that what moves is blurred."""
    steps = Rates.of(s.world.physics_rate, s.world.drive_rate, s.camera.rate).steps
    return any(len(band.steps) > 1 for band in exposures(s.camera, steps))


FEW = "the robot has fewer than six joints, and the joints decide which components can move"
INVERTS = "this feature set computes the twist from the error by an inverse of its own"
DRAWN = "the pictures are those of a recording, in which nothing is drawn"
NEEDS = (
    Need(
        (
            *("camera.renderer", "camera.textures", "camera.shadows"),
            *("ground", "walls", "clutter", "light", "at_goal"),
        ),
        _of_scenario(lambda s: s.camera.renderer != "recording"),
        DRAWN,
    ),
    Need(
        ("camera.textures", "camera.shadows"),
        _of_scenario(lambda s: s.camera.renderer == "exact" or not gl.is_there()),
        'OpenGL draws the pictures: camera.renderer = "exact" is for this setting',
    ),
    Need(
        ("recording",),
        _of_scenario(lambda s: s.camera.renderer == "recording"),
        "recording.pictures is not set, so the room is drawn",
    ),
    Need(
        ("goal.change_start", "goal.change_duration"),
        _of_scenario(lambda s: s.goal.depth_to is not None),
        "goal.depth_to is not set, so the goal does not change",
    ),
    Need(
        ("leader.size", "leader.on", "leader.beside"),
        _of_scenario(lambda s: s.leader.id is not None),
        "leader.id is not set, so there is no leader (the second tag, which [motion] moves)",
    ),
    Need(
        ("goal.tilt_towards_deg",),
        _of_scenario(lambda s: s.goal.tilt_deg),
        "goal.tilt_deg is 0, so the goal has no tilt",
    ),
    Need(
        ("at_goal",),
        lambda episode: episode.goal_picture is not None,
        "no picture is taken at the goal: only features made of pixels, and policies, use one",
    ),
    Need(
        ("at_goal.clutter_moved",),
        _of_scenario(lambda s: s.at_goal.clutter(s.clutter).number),
        "no clutter stands there when the picture at the goal is taken",
    ),
    Need(
        ("start.tilt_towards_deg",),
        _of_scenario(lambda s: s.start.tilt_deg),
        "start.tilt_deg is 0, so the camera starts without a tilt",
    ),
    Need(
        ("clutter.shape", "clutter.alike", "clutter.height", "clutter.within", "clutter.picture"),
        _of_scenario(lambda s: s.clutter.number or s.at_goal.clutter_number),
        "clutter.number is 0, so there is no clutter",
    ),
    Need(
        ("walls.tile", "walls.distance", "walls.height"),
        _of_scenario(lambda s: s.walls.picture is not None),
        "walls.picture is not set, so there are no walls",
    ),
    Need(
        ("ground.tile",),
        _of_scenario(lambda s: s.ground.kind != "wood"),
        "the texture wood covers the whole table once and is not repeated",
    ),
    Need(
        ("camera.exposure",),
        _of_scenario(lambda s: not s.camera.exposure or _blurs(s)),
        "it is shorter than half a physics step: raise world.physics_rate",
    ),
    Need(
        ("camera.readout_ms",),
        _of_scenario(lambda s: not s.camera.readout_ms or _rolls(s)),
        "it is shorter than half a physics step: raise world.physics_rate",
    ),
    Need(
        ("camera.bands",),
        _of_scenario(lambda s: s.camera.readout_ms),
        "camera.readout_ms is 0, so there is no rolling shutter",
    ),
    Need(
        ("sight.table_height",),
        _of_scenario(lambda s: "known" in (s.sight.plane, s.sight.depth)),
        'neither sight.plane nor sight.depth is "known", so the height of the table is not used',
    ),
    Need(
        ("sight.plane", "sight.depth", "sight.table_height"),
        lambda episode: not episode.loop.law.uses_pictures,
        "the controller acts on pixels, and uses no plane or depth of the target",
    ),
    Need(
        ("run.ego",),
        _of_scenario(lambda s: Channel.EGO_MOTION in needs_of(s.tracker, SEES_PICTURES)),
        "this tracker does not use the motion of the camera",
    ),
    Need(
        ("believed.ignore_distortion",),
        _of_scenario(lambda s: s.camera.lens is not None),
        "camera.distortion and camera.coefficients give no distortion",
    ),
    Need(
        ("believed.goal",),
        lambda episode: episode.world.camera_believed is not episode.world.camera,
        "the believed camera is the true one, so all values give the same goal",
    ),
    Need(
        ("controller.gain_slope",),
        _of_law(lambda law, _: law.gain_far not in (None, law.gain)),
        "controller.gain_far is not set or equals controller.gain, so the gain is constant",
    ),
    Need(
        ("controller.secondary_gain",),
        _of_law(lambda law, _: law.secondary),
        "controller.secondary is not set, so there is no secondary task",
    ),
    Need(
        ("controller.search_speed",),
        _of_law(lambda law, _: law.search_after is not None),
        "controller.search_after is not set, so the camera never searches for a lost target",
    ),
    Need(
        ("controller.feed_forward",),
        _of_law(lambda _, episode: kind_of(episode.scenario.estimator) != "none"),
        'estimator.kind is "none", so the motion of the target is not estimated',
    ),
    Need(
        ("controller.dof",),
        _of_law(lambda _, episode: _has_six_joints(episode)),
        FEW,
    ),
    Need(
        ("controller.weights",),
        _of_law(lambda _, episode: _has_six_joints(episode)),
        FEW,
    ),
    Need(
        ("controller.dof",),
        _of_law(_dof_chooses),
        INVERTS,
    ),
    Need(
        ("controller.weights",),
        _of_law(lambda law, episode: _dof_chooses(law, episode) or _weights_forbid(law, episode)),
        INVERTS,
    ),
    Need(
        ("controller.weights",),
        _of_law(_weights_choose),
        "no more components of the twist may move than features need, so weights decide nothing",
    ),
    Need(
        ("features.border",),
        lambda episode: _may_see_tilt(episode) or kind_of(episode.scenario.features) != "weighted",
        'the tracker reports no corners, and sight.plane is not "picture": no corners are weighted',
    ),
    Need(
        ("estimator",),
        _of_scenario(lambda s: kind_of(s.controller) != "broyden"),
        "the law broyden does not use the estimated motion of the target",
    ),
    Need(
        ("believed.depth_factor",),
        _of_scenario(_takes_depth),
        "this law and these features compute no interaction matrix with the believed depth",
    ),
    Need(
        ("sight.plane", "sight.depth", "sight.table_height"),
        _of_scenario(_takes_plane),
        "the law broyden learns the interaction matrix, and these features need no plane or depth",
    ),
    Need(
        ("sight.plane", "sight.depth", "sight.table_height"),
        _lacks_corners,
        "plane and depth are computed from the tracker's corners from the second picture on",
    ),
    Need(
        ("believed.size_factor",),
        _of_scenario(_size_is_seen),
        "the controller acts on pixels at goal.depth, whatever size of the target is believed",
    ),
    Need(
        ("goal.depth_to", "goal.change_start", "goal.change_duration"),
        _of_scenario(
            lambda s: (
                s.goal.depth_to is None
                or s.goal.change_start < max(s.run.duration, s.frames / s.camera.rate)
            )
        ),
        "the run ends before goal.change_start",
    ),
)
"""The conditions; if several that concern a setting are not met, the sentence of the first is
printed."""
