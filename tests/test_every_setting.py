"""Every setting changes a run where it should; where it cannot, it is refused, or a line says so."""

import functools
import json
from dataclasses import astuple, replace

import numpy as np
import pytest
from every_setting import KINDS, settings_of

from servo.cli import main
from servo.cli.run_command import remarks
from servo.loop.episode import Episode
from servo.loop.measure import TIMED
from servo.loop.run_measures import summarise
from servo.mistake import Mistake
from servo.output import steps_table
from servo.scenario.catalogue import LISTS
from servo.scenario.load import load
from sim.camera import gl

HAND = "a leader needs a camera that stands: test_eye_to_hand"
PLAIN = (
    "run.duration=0.14",
    "camera.width=64",
    "camera.height=48",
    "tracker.kind=truth",
    "motion.kind=wander",
    "start.x=5",
    "start.y=-4",
    "start.angle_deg=8",
    "measure.after=0",
    "expect={}",
)
"""Four pictures of a target that moves, by a camera that is not at its goal."""
VALUES = {
    "run.duration": 0.2,
    "camera.noise": 10.0,
    "camera.readout_ms": 20.0,
    "camera.fovy_deg": 60.0,
    "camera.fx": 80.0,
    "camera.fy": 60.0,
    "camera.coefficients": [-0.1, 0.01, 0.0, 0.0, 0.0],
    "camera.depth_nearest": 0.83,
    "camera.depth_farthest": 0.83,
    "goal.depth_to": 2.0,
    "sight.plane": "known",
    "sight.depth": "known",
    "measure.above": 100.0,
    "ground.kind": "checker",
    "walls.picture": "brick",
    "walls.height": 0.1,
    "clutter.number": 50,
    "clutter.alike": 0.9,
    "clutter.picture": "brick",
    "clutter.within": 0.2,
    "goal.tilt_deg": 20.0,
    "features.blur": 5.0,
    "at_goal.clutter_number": 60,
    "at_goal.camera_noise": 10.0,
    "at_goal.light_strength": 0.3,
    "light.colour": [1.0, 0.5, 0.5],
    "target.colour": "#c03020",
    "target.picture": "pebbles",
    "motion.go": 0.2,
    "motion.stop": 0.2,
    "features.border": 0.9,
    "disturbances.share": 1.0,
    "start.pose": [0.02, 0.01, 1.1, 5.0, 0.0, 10.0],
    "controller.dof": ["vx", "vy"],
    "controller.weights": [1.0, 1.0, 1.0, 1.0, 1.0, 0.1],
    "controller.secondary": ["level"],
    "controller.feed_forward": ["an"],
    "controller.probe_time": 0.03,
    "controller.coast": 0.03,
    "controller.search_after": 0.03,
    "controller.fastest": 0.01,
    "controller.fastest_turn": 0.01,
    "controller.margin": 20.0,
    "tracker.tolerance": 1000.0,
    "tracker.occluded": 0.0,
    "tracker.trust": 0.0,
    "tracker.confidence": 1.0,
    "tracker.steps": 1,
}
"""Values of settings that the range does not suggest."""
LENS = ('camera.distortion="plumb_bob"', "camera.coefficients=[-0.2,0.02,0.0,0.0,0.0]")
SIX = ('controller.dof=["vx","vy","vz","wx","wy","wz"]',)
UNSEEN = ("disturbances=[{kind='dropped_frames',share=1.0}]", "run.duration=0.6")
CHANGE = ("goal.depth_to=2", "goal.change_start=0.02", "goal.change_duration=0.1")
STOPS = ("motion.go=0.1", "motion.stop=0.1", "run.duration=0.4")
PROBED = ("controller.probe_time=0.04", "run.duration=0.6")
TILTED = ("robot.kind=free", "start.tilt_deg=65", "camera.fovy_deg=80")
CORNERED = ("tracker.corners=true",)
LIT = tuple(f"at_goal.light_{name}" for name in ("strength", "azimuth_deg", "elevation_deg"))
MATTERS = {
    "walls.picture": TILTED,
    **dict.fromkeys(
        ("walls.tile", "walls.distance", "walls.height"), (*TILTED, "walls.picture=brick")
    ),
    "run.ego": ("tracker.kind=frozen",),
    "camera.fy": ("camera.fx=80",),
    "camera.coefficients": LENS,
    "camera.bands": ("camera.readout_ms=20",),
    "camera.textures": ('camera.renderer="exact"', 'ground.kind="checker"'),
    "camera.shadows": ('camera.renderer="exact"',),
    "camera.auto_gain": ("disturbances=[{kind='brightness',start=0.0,ramp=0.05}]",),
    **dict.fromkeys(("camera.depth_noise", "camera.depth_holes"), ("camera.depth=true",)),
    **dict.fromkeys(("camera.depth_nearest", "camera.depth_farthest"), ("camera.depth=true",)),
    "goal.depth_to": CHANGE[1:],
    "goal.change_start": CHANGE,
    "goal.change_duration": CHANGE,
    "start.tilt_towards_deg": ("start.tilt_deg=10",),
    "start.pose": ("start={}",),
    "sight.table_height": ('sight.plane="known"', 'sight.depth="known"'),
    "believed.ignore_distortion": LENS,
    "believed.goal": ("believed.fx_factor=1.2",),
    "clutter.shape": ("clutter.number=50",),
    **dict.fromkeys(
        ("clutter.alike", "clutter.height", "clutter.within", "clutter.picture"),
        ("clutter.number=50",),
    ),
    "goal.tilt_deg": CORNERED,
    "goal.tilt_towards_deg": (*CORNERED, "goal.tilt_deg=20"),
    **dict.fromkeys(
        ("at_goal.camera_brightness", "at_goal.camera_noise", "at_goal.clutter_number", *LIT),
        ("features.kind=photometric",),
    ),
    "at_goal.clutter_moved": ("features.kind=photometric", "clutter.number=50"),
    "ground.tile": ('ground.kind="checker"',),
    "motion.go": STOPS,
    "motion.stop": STOPS,
    "features.border": ("tracker.corners=true",),
    "disturbances.share": ("run.duration=0.6",),
    "broyden.gain": PROBED,
    "broyden.fastest_turn": PROBED,
    "controller.gain_slope": ("controller.gain_far=0.5",),
    "controller.weights": SIX,
    "controller.secondary": (*SIX, "start.tilt_deg=10"),
    "controller.secondary_gain": (*SIX, "start.tilt_deg=10", 'controller.secondary=["level"]'),
    "controller.coast": UNSEEN,
    "controller.search_after": (*UNSEEN, "controller.coast=0.03"),
    "controller.search_speed": (
        *UNSEEN,
        "controller.coast=0.03",
        "controller.search_after=0.03",
    ),
}
"""What a setting needs to have an effect."""
UNSAID = {
    "run.ego": "a tracker that is given the truth needs no prediction",
    "camera.auto_gain": "the gain changes where the light does",
    "controller.secondary": "an optical axis that is level needs no task",
    "motion.go": "a target that has not stopped yet",
    "motion.stop": "a target that has not stopped yet",
    "disturbances.share": "no frame is dropped in the first half second",
    "broyden.gain": "a law that still probes",
    "broyden.fastest_turn": "a law that has not turned yet",
    "controller.coast": "it acts where the target is not seen",
    "controller.search_after": "it acts where the target is not seen",
}
"""Settings that need more than others to have an effect: what happens in the run."""
OF_EXACT = {"camera.textures", "camera.shadows"}
"""Settings of the exact renderer, which draws anyway on a machine without OpenGL."""
EARLY = {"start": 0.02, "ramp": 0.01, "duration": 0.03, "y": 0.0}
"""Settings of a disturbance with which it acts within a short run, and in the picture."""
LEFT_OUT = {
    **dict.fromkeys(("leader.id", "leader.size", "leader.on", "leader.beside"), HAND),
    "camera.pose": HAND,
    "camera.held": HAND,
    "camera.distortion": "with its coefficients: test_lens",
    "camera.mounted": "another robot and another task: test_eye_to_hand",
    "tracker.scatter": "a cloud that has lost the target: test_pf_ssd",
    "tracker.witness": "something of the target's colours: test_witness",
    "tracker.sudden": "something that begins to hide the target: test_loss",
    "tracker.least_texture": "a target without texture: test_texture",
    "features.method": "pictures that are large enough: test_goal_picture",
    "camera.renderer": "the same pictures, but for shadows: test_exact",
    "robot.home": "the same posture is found from everywhere: test_mjcf_robots",
    **dict.fromkeys(
        ("recording.rate", "recording.truth_format", "recording.fov_deg"),
        "a recording: test_recording_world",
    ),
    **dict.fromkeys(("controller.file", "controller.timeout"), "a network: test_onnx_policy"),
    "controller.loading": "of a program: test_policy_program",
}
"""Settings that other tests change."""


@functools.cache
def seen(changes, name="still"):
    """All that a run's steps say, with their pictures and measures, and the lines before it."""
    scenario = load(name, [*PLAIN, *changes])
    with Episode(scenario) as episode:
        said = " ".join(remarks(episode))
        steps = list(episode)
        table = steps_table.table_of(steps, steps_table.quantities_of(episode))
    columns = [c for c in table.column_names if not c.startswith(steps_table.TIMED)]
    pictures = [
        of.tobytes() for s in steps for of in (s.frame.image, s.frame.depth) if of is not None
    ]
    measures = summarise(steps, scenario.measure, 1 / scenario.camera.rate).measures
    measures.pop(TIMED)
    return repr((table.select(columns).to_pydict(), pictures, measures)), said


def said_or_refused(changes):
    """The lines before a run with these changes, or why there is none."""
    try:
        return seen(changes)[1]
    except Mistake as refused:
        return str(refused)


def another(default, values):
    """A value of a setting that is not its default, well inside its range."""
    low, high, *_ = *values, values[-1]
    if isinstance(low, list) and len(low) == len(high):
        parts = default or [None] * len(low)
        return [another(*each) for each in zip(parts, zip(low, high, strict=True), strict=True)]
    if isinstance(low, bool) or not isinstance(low, int | float):
        return next(v for v in values if v != getattr(default, "value", default))
    wanted = 1.3 * default if default else 0.1
    if not low <= wanted <= high:
        wanted = 0.7 * default if default else low
    return type(low)(np.ceil(wanted) if isinstance(low, int) else wanted)


def given(place, kind, settings):
    """The changes of a scenario that give a part, or a disturbance, these settings."""
    if place not in LISTS:
        chosen = () if kind is None else (f"{place}.kind={kind}",)
        return chosen + tuple(f"{place}.{k}={json.dumps(v)}" for k, v in settings.items())
    early = {k: v for k, v in EARLY.items() if k in LISTS[place].config_of(kind).__slots__}
    table = {"kind": kind} | early | settings
    inside = ", ".join(f"{k}={json.dumps(v)}" for k, v in table.items())
    return (f"{place}=[{{{inside}}}]",)


def cases():
    """Every setting of the tables and of the kinds that are not trackers, with another value."""
    found = set()
    for place, kind, config in KINDS:
        if place == "tracker":
            continue
        for owner, name, values in settings_of(config):
            setting = f"{place}.{name}"
            if (owner, name) in found or setting in LEFT_OUT or not values:
                continue
            found.add((owner, name))
            default = functools.reduce(getattr, name.split("."), config())
            value = VALUES[setting] if setting in VALUES else another(default, values)
            yield pytest.param(place, kind, name, value, id=f"{kind or place}-{name}")


@pytest.mark.parametrize(("place", "kind", "name", "value"), [*cases()])
def test_every_setting_changes_a_run(place, kind, name, value):
    setting = f"{place}.{name}"
    own = f"{kind}.{name}"
    needs = MATTERS.get(own, MATTERS.get(setting, ()))
    before = given(place, kind, {}) + needs
    after = given(place, kind, {name: value})
    is_met = setting in OF_EXACT and not gl.is_there()
    if needs and not is_met and not {own, setting} & UNSAID.keys():
        assert name in said_or_refused(after)
    assert (seen((*before, *after))[0] == seen(before)[0]) is False


NOT_HERE = ("opencv", "program", "trax", "tag", "truth")
"""Trackers of others, and those that this target is nothing for."""


@functools.cache
def shown():
    """Four pictures of a target that moves, and where it is in the first."""
    changes = [*PLAIN, "camera.width=160", "camera.height=120", "motion.kind=line"]
    with Episode(load("still", [*changes, "controller.kind=hold"])) as episode:
        return episode.shown[1:], [step.frame for step in episode]


@functools.cache
def estimates(config):
    """All that a tracker reports of these pictures."""
    target, (first, *frames) = shown()
    tracker = config.build(np.random.default_rng(1))
    tracker.start(first, *target)
    found = []
    for frame in frames:
        e = tracker.update(frame)
        numbers = *astuple(e.state), e.distance, e.ess, e.evaluations, *e.covariance.ravel()
        found.append((numbers, e.status, e.follows, np.asarray(e.corners).tolist()))
    return repr(found)


def tracker_cases():
    """Every setting of every tracker, with another value; what several have, in the first."""
    found = set()
    for place, kind, config in KINDS:
        if place != "tracker" or kind in NOT_HERE:
            continue
        for owner, name, values in settings_of(config):
            setting = f"{place}.{name}"
            if (owner, name) in found or setting in LEFT_OUT or not values:
                continue
            found.add((owner, name))
            value = (
                VALUES[setting] if setting in VALUES else another(getattr(config(), name), values)
            )
            yield pytest.param(config, name, value, id=f"{kind}-{name}")


@pytest.mark.parametrize(("config", "name", "value"), [*tracker_cases()])
def test_every_setting_changes_what_a_tracker_reports(config, name, value):
    given = tuple(value) if isinstance(value, list) else value
    changed = replace(config(), **{name: given})
    assert (estimates(changed) == estimates(config())) is False


TWO_JOINTS = (
    "robot.kind=mjcf",
    "robot.model=pan_tilt",
    "robot.base=[0.0, -0.9, 0.0, 90.0]",
    "robot.camera=eye",
    "start={}",
)
FEW = "the robot has fewer than six joints, and the joints decide which components can move"
NO_SIZE = "this tracker does not follow the size, so the surroundings are not compared"
INVERTS = "this feature set computes the twist from the error by an inverse of its own"
BROYDEN = ("controller.kind=broyden",)
POSE = ("features.kind=pose", "tracker.corners=true")
LEARNS = "the law broyden learns the interaction matrix, and these features need no plane or depth"
CORNERS = "plane and depth are computed from the tracker's corners from the second picture on"
NO_MATRIX = "this law and these features compute no interaction matrix with the believed depth"
NO_ESTIMATE = "the law broyden does not use the estimated motion of the target"
PIXELS = ("features.kind=photometric", "estimator.kind=none")


@pytest.mark.parametrize(
    ("changes", "setting", "why"),
    [
        (TWO_JOINTS, 'controller.dof=["vx"]', FEW),
        (TWO_JOINTS, "controller.weights=[1, 1, 1, 0, 1, 1]", FEW),
        ((*TWO_JOINTS, "controller.kind=qp"), 'controller.dof=["wx"]', FEW),
        (("features.kind=weighted", "tracker.corners=true"), 'controller.dof=["vx"]', INVERTS),
        (("features.kind=partitioned", "tracker.corners=true"), 'controller.dof=["vx"]', INVERTS),
        (
            ("features.kind=partitioned", "tracker.corners=true"),
            "controller.weights=[1, 1, 1, 1, 1, 0.2]",
            INVERTS,
        ),
        (
            PIXELS,
            "sight.depth=known",
            "the controller acts on pixels, and uses no plane or depth of the target",
        ),
        (
            PIXELS,
            "believed.size_factor=1.25",
            "the controller acts on pixels at goal.depth, whatever size of the target is believed",
        ),
        (
            PIXELS,
            'controller.feed_forward=["z"]',
            'estimator.kind is "none", so the motion of the target is not estimated',
        ),
        (("features.kind=hybrid",), "believed.depth_factor=1.3", NO_MATRIX),
        (POSE, "believed.depth_factor=1.3", NO_MATRIX),
        (BROYDEN, "believed.depth_factor=1.3", NO_MATRIX),
        (BROYDEN, "estimator.kind=none", NO_ESTIMATE),
        ((*BROYDEN, "estimator.kind=kalman_ca"), "estimator.acceleration_ratio=0.1", NO_ESTIMATE),
        (BROYDEN, "sight.depth=known", LEARNS),
        (POSE, "sight.plane=known", CORNERS),
        (("features.kind=points", POSE[1]), "sight.depth=known", CORNERS),
        (("tracker.kind=sok",), "tracker.contrast=5.0", NO_SIZE),
        (("tracker.kind=mean_shift",), "tracker.contrast=5.0", NO_SIZE),
        *(
            ((), setting, "it is shorter than half a physics step: raise world.physics_rate")
            for setting in ("camera.readout_ms=0.5", "camera.exposure=0.02")
        ),
        (("goal.depth_to=0.7",), "goal.change_start=2", "the run ends before goal.change_start"),
        (
            ("tracker.kind=cv_mil",),
            "run.ego=true",
            "this tracker does not use the motion of the camera",
        ),
        ((), "recording.fov_deg=50.0", "recording.pictures is not set, so the room is drawn"),
        (
            ('camera.distortion="plumb_bob"', "camera.coefficients=[0.0, 0.0, 0.0, 0.0, 0.0]"),
            "believed.ignore_distortion=true",
            "camera.distortion and camera.coefficients give no distortion",
        ),
    ],
)
def test_what_other_settings_leave_without_effect_is_said(changes, setting, why):
    alone, said = seen((*changes, setting))
    name = setting.partition("=")[0]
    assert f"{name} has no effect: {why}" in said
    assert (alone == seen(changes)[0]) is True
    assert f"{name} has no effect" not in seen(changes)[1]


@pytest.mark.parametrize("kind", ["kams", "annealed"])
def test_gamma_is_said_to_cancel_in_the_schedule_of_survival(kind):
    said = 'tracker.gamma has no effect: with tracker.schedule = "survival" the exponents'
    given = f"tracker.kind={kind}", "tracker.gamma=5"
    assert said in seen(given)[1]
    assert said not in seen((*given, "tracker.schedule=fixed"))[1]


FREE = ("robot.kind=free", "controller.feed_forward=[]", "run.duration=0.3")


@pytest.mark.parametrize(
    ("changes", "setting"),
    [
        ((*FREE, "features.kind=weighted"), 'controller.dof=["vx", "vy"]'),
        ((*FREE, "features.kind=decoupled"), 'controller.dof=["vx", "vy"]'),
        (("features.kind=partitioned",), 'controller.dof=["vx", "vy"]'),
        (("features.kind=hybrid",), "sight.depth=known"),
        ((*POSE, "camera.depth=true"), "sight.depth=picture"),
        (PIXELS, "believed.depth_factor=1.3"),
        (("tracker.kind=kams", "tracker.schedule=fixed"), "tracker.gamma=5.0"),
        (("tracker.kind=mean_shift", "tracker.scale=true"), "tracker.contrast=5.0"),
    ],
)
def test_what_has_an_effect_is_not_said_to_have_none(changes, setting):
    changed, said = seen((*changes, setting))
    assert f"{setting.partition('=')[0]} has no effect" not in said
    assert (changed == seen(changes)[0]) is False


@pytest.mark.parametrize(
    ("features", "tracker", "stands"),
    [
        ("pose", "frozen", True),
        ("partitioned", "frozen", True),
        ("pose", "homography", False),
        ("decoupled", "homography", False),
    ],
)
def test_weights_that_let_nothing_move_are_said(features, tracker, stands):
    changes = (f"features.kind={features}", f"tracker.kind={tracker}")
    said = said_or_refused((*changes, "controller.weights=[0, 0, 0, 1, 1, 0]"))
    assert ("the camera will stand still: controller.weights is 0 for each" in said) is stands
    assert "stand still" not in said_or_refused(changes)


@pytest.mark.parametrize(
    "disturbance",
    [
        "kind='board', start=5",
        "kind='brightness', start=5",
        "kind='spot'",
        "kind='dropped_frames'",
    ],
)
def test_a_disturbance_after_the_run_is_said(disturbance):
    said = said_or_refused((f"disturbances=[{{{disturbance}}}]",))
    assert "disturbances[0] has no effect in the 0.14 s of the run" in said
    said = said_or_refused(("disturbances=[{kind='board', start=0.3}]",))
    assert "disturbances[0]" not in said


@pytest.mark.parametrize("kind", ["arm", "free"])
@pytest.mark.parametrize("setting", ["robot.backlash", "believed.joint_offsets"])
def test_errors_of_drives_and_joints_act_on_a_free_camera_too(kind, setting):
    robot = (f"robot.kind={kind}",)
    assert (seen((*robot, f"{setting}=0.02"))[0] == seen(robot)[0]) is False


def test_a_run_says_it_before_it_begins(tmp_path, capsys, monkeypatch):
    changes = [*PLAIN, "believed.ignore_distortion=true"]
    sets = [word for change in changes for word in ("--set", change)]
    words = ["servobench", "run", "still", "--no-rerun", "--out", str(tmp_path / "run"), *sets]
    monkeypatch.setattr("sys.argv", words)
    with pytest.raises(SystemExit):
        main.main()
    found = "believed.ignore_distortion has no effect: camera.distortion and camera.coefficients give no distortion"
    assert found in " ".join(capsys.readouterr().out.split())
