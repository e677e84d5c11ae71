"""Odd uses of the loop without a world: each is refused in one sentence, and changes nothing."""

import re
from dataclasses import replace

import numpy as np
import pytest

import servo
import tracking
from servo.loop.episode import Episode
from servo.loop.loop import Loop
from servo.mistake import Mistake
from servo.scenario.load import load
from sim.types import Frame, Pose
from tracking.types import Region, State

NAN = float("nan")
CHANGES = ["run.duration=0.3", "estimator.kind=jump", "motion.kind=line"]


@pytest.fixture(scope="module")
def steps():
    with Episode(load("still", CHANGES, 3)) as episode:
        return list(episode)


@pytest.fixture
def loop(steps):
    return Loop(load("still", CHANGES, 3), steps[0].scene.camera, steps[0].scene.outline)


def begun(loop, steps, **more):
    return loop.start(steps[0].frame, steps[0].scene.region, steps[0].true_state, **more)


def posed(step, rotation=None, translation=None):
    pose = step.posture.T_base_camera
    rotation = pose.rotation if rotation is None else rotation
    translation = pose.translation if translation is None else translation
    return replace(step.posture, T_base_camera=Pose(rotation, translation))


def with_nan(values):
    return np.where(np.arange(np.size(values)).reshape(np.shape(values)) == 1, NAN, values)


SETUPS = {
    "a name": lambda s, c, o: ("line", c, o),
    "no scenario": lambda s, c, o: (None, c, o),
    "an empty table": lambda s, c, o: ({}, c, o),
    "a matrix as camera": lambda s, c, o: (s, np.eye(3), o),
    "a camera with nan": lambda s, c, o: (s, replace(c, fx=NAN), o),
    "a camera without an end": lambda s, c, o: (s, replace(c, cy=np.inf), o),
    "a camera that looks back": lambda s, c, o: (s, replace(c, fy=-290.0), o),
    "a camera without pixels": lambda s, c, o: (s, replace(c, width=0), o),
    "a camera with half a pixel": lambda s, c, o: (s, replace(c, width=320.5), o),
    "a camera with a float as width": lambda s, c, o: (s, replace(c, width=320.0), o),
    "a camera with a flag as height": lambda s, c, o: (s, replace(c, height=True), o),
    "a camera of huge numbers": lambda s, c, o: (s, replace(c, fx=1e300), o),
    "a tilted outline": lambda s, c, o: (s, c, o + [[0, 0, 0.01], [0, 0, 0], [0, 0, 0], [0, 0, 0]]),
    "a bent outline": lambda s, c, o: (s, c, o + [[0.01, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]]),
    "a sheared outline": lambda s, c, o: (s, c, o + np.outer(o[:, 1], [0.1, 0, 0])),
    "a crossed outline": lambda s, c, o: (s, c, o[[0, 2, 1, 3]]),
    "a huge outline": lambda s, c, o: (s, c, o * 1e300),
    "a flat outline": lambda s, c, o: (s, c, o[:, :2]),
    "no outline": lambda s, c, o: (s, c, None),
    "an empty outline": lambda s, c, o: (s, c, []),
    "an outline with nan": lambda s, c, o: (s, c, with_nan(o)),
    "a point as outline": lambda s, c, o: (s, c, np.zeros((4, 3))),
    "an outline the other way round": lambda s, c, o: (s, c, o[::-1]),
    "a line as outline": lambda s, c, o: (s, c, o * [1, 0, 1]),
}
SENTENCES = {
    "a name": "scenario: expected a Setup, got a str",
    "a camera with half a pixel": (
        "camera: sides should be whole numbers of pixels, got (320.5, 240)"
    ),
    "a camera with a flag as height": "camera: sides should be whole numbers of pixels, got (320, True)",
    "a camera of huge numbers": "camera: expected finite numbers from -1e+09 to 1e+09, got [1e+300, ",
    "a tilted outline": "outline: expected four corners of one height, got the heights [",
    "a bent outline": "outline: expected the four corners of a rectangle, clockwise",
    "a crossed outline": "outline: expected the four corners of a rectangle, clockwise",
    "an empty outline": "outline: expected numbers of shape (4, 3), got (0,)",
    "a camera with nan": "camera: expected finite numbers from -1e+09 to 1e+09, got [nan, ",
    "an outline the other way round": (
        "outline: expected the four corners of a rectangle, clockwise as seen from above, got [["
    ),
}


@pytest.mark.parametrize("name", SETUPS)
def test_a_loop_is_not_built_from(name, steps):
    scene = steps[0].scene
    with pytest.raises(ValueError) as refused:
        Loop(*SETUPS[name](load("still"), scene.camera, scene.outline))
    assert str(refused.value).startswith(SENTENCES.get(name, ""))
    assert "\n" not in str(refused.value)


STARTS = {
    "an array as picture": lambda f, r, s: (f.image, r, s),
    "a box as region": lambda f, r, s: (f, (10, 10, 50, 50), s),
    "a point as state": lambda f, r, s: (f, r, (160.0, 120.0)),
    "a grey picture": lambda f, r, s: (replace(f, image=f.image[..., 0]), r, s),
    "a picture of floats": lambda f, r, s: (replace(f, image=f.image / 255.0), r, s),
    "another camera's picture": lambda f, r, s: (replace(f, image=f.image[::2, ::2]), r, s),
    "no picture": lambda f, r, s: (None, r, s),
    "a region with nan": lambda f, r, s: (f, Region(NAN, 40.0), s),
    "a region outside": lambda f, r, s: (f, r, State(-900.0, 0.0)),
    "a state with nan": lambda f, r, s: (f, r, State(160.0, NAN)),
    "a scale of zero": lambda f, r, s: (f, r, State(160.0, 120.0, 0.0, 0.0)),
    "a stamp of nan": lambda f, r, s: (replace(f, time=NAN), r, s),
}


@pytest.mark.parametrize("name", STARTS)
def test_a_loop_is_not_started_with(name, loop, steps):
    first = steps[0]
    with pytest.raises(ValueError) as refused:
        loop.start(*STARTS[name](first.frame, first.scene.region, first.true_state))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("depth", "found"),
    [
        (np.ones((240, 320), np.uint16), "(240, 320) of uint16"),  # millimetres
        (np.ones((120, 160), np.float32), "(120, 160) of float32"),
        ([[1.0]], "(1, 1) of list"),
    ],
)
def test_a_depth_picture_that_is_none_is_refused(loop, steps, depth, found):
    first = steps[0]
    frame = replace(first.frame, depth=depth)
    with pytest.raises(ValueError) as refused:
        loop.start(frame, first.scene.region, first.true_state)
    sentence = f"frame: expected a depth picture (240, 320) of floats [m], got {found}"
    assert str(refused.value) == sentence


def test_a_goal_that_is_no_picture_is_refused(loop, steps):
    with pytest.raises(ValueError) as refused:
        begun(loop, steps, goal=np.zeros((2, 2), np.uint8))
    assert (
        str(refused.value) == "goal: expected a picture (240, 320, 3) of uint8, got (2, 2) of uint8"
    )


ODD_STEPS = {
    "an array as picture": lambda s: (s.frame.image, s.posture),
    "no picture": lambda s: (None, s.posture),
    "an empty picture": lambda s: (replace(s.frame, image=s.frame.image[:0]), s.posture),
    "a picture with alpha": lambda s: (
        replace(s.frame, image=np.dstack([s.frame.image, s.frame.image[..., :1]])),
        s.posture,
    ),
    "a larger picture": lambda s: (
        replace(s.frame, image=s.frame.image.repeat(2, axis=0)),
        s.posture,
    ),
    "the same stamp": lambda s: (replace(s.frame, time=0.0), s.posture),
    "a stamp that goes back": lambda s: (replace(s.frame, time=-1.0), s.posture),
    "a stamp of another type": lambda s: (replace(s.frame, time="1"), s.posture),
    "a stamp of nan": lambda s: (replace(s.frame, time=NAN), s.posture),
    "a stamp without an end": lambda s: (replace(s.frame, time=np.inf), s.posture),
    "a pose as posture": lambda s: (s.frame, s.posture.T_base_camera),
    "no posture": lambda s: (s.frame, None),
    "a matrix as pose": lambda s: (s.frame, replace(s.posture, T_base_camera=np.eye(4))),
    "a place of nan": lambda s: (s.frame, posed(s, translation=np.full(3, NAN))),
    "a rotation of nan": lambda s: (s.frame, posed(s, rotation=np.full((3, 3), NAN))),
    "a mirror": lambda s: (s.frame, posed(s, rotation=np.diag([1.0, 1.0, -1.0]))),
    "a rotation of zeros": lambda s: (s.frame, posed(s, rotation=np.zeros((3, 3)))),
    "a quaternion": lambda s: (s.frame, posed(s, rotation=np.array([1.0, 0.0, 0.0, 0.0]))),
    "a twist of nan": lambda s: (s.frame, replace(s.posture, twist=with_nan(s.posture.twist))),
    "a twist of three": lambda s: (s.frame, replace(s.posture, twist=np.zeros(3))),
    "no twist": lambda s: (s.frame, replace(s.posture, twist=None)),
    "a twist of words": lambda s: (s.frame, replace(s.posture, twist=np.array(list("vxyzwx")))),
    "joints of nan": lambda s: (s.frame, replace(s.posture, joints=with_nan(s.posture.joints))),
    "a joint too few": lambda s: (s.frame, replace(s.posture, joints=s.posture.joints[:-1])),
    "limits of nan": lambda s: (s.frame, replace(s.posture, lower=with_nan(s.posture.lower))),
    "limits the other way round": lambda s: (
        s.frame,
        replace(s.posture, lower=s.posture.upper, upper=s.posture.lower),
    ),
    "a Jacobian turned over": lambda s: (s.frame, replace(s.posture, jacobian=np.zeros((7, 6)))),
    "accepted nan": lambda s: (s.frame, replace(s.posture, accepted=np.full(6, NAN))),
    "asked for five": lambda s: (s.frame, replace(s.posture, asked=np.zeros(5))),
}


@pytest.mark.parametrize("name", ODD_STEPS)
def test_a_refused_step_changes_nothing(name, loop, steps):
    running = begun(loop, steps)
    for k, step in enumerate(steps):
        if k == 4:
            with pytest.raises(ValueError) as refused:
                running.step(*ODD_STEPS[name](step))
            assert not isinstance(refused.value, Mistake)  # it is no part's fault
            assert "\n" not in str(refused.value)
        twist = running.step(step.frame, step.posture).twist
        np.testing.assert_array_equal(twist, step.command.twist)


def test_sentences_say_what_was_expected(loop, steps):
    running = begun(loop, steps)
    running.step(steps[0].frame, steps[0].posture)
    expected = {
        "a twist of nan": "posture.twist: expected finite numbers from -1e+09 to 1e+09, got [",
        "a joint too few": "posture.jacobian: expected shape (6, ",
        "a stamp that goes back": "frame.time: expected a time after that of the frame before, 0.0 s, got -1.0 s",
        "a stamp of another type": "frame.time: expected a finite number [s], got '1'",
        "no posture": "posture: expected a Posture, got a NoneType",
        "an array as picture": "frame: expected a Frame, got a ndarray",
    }
    for name, sentence in expected.items():
        with pytest.raises(ValueError) as refused:
            running.step(*ODD_STEPS[name](steps[1]))
        assert str(refused.value).startswith(sentence)


def test_a_second_start_gives_the_same_run_and_ends_the_first(loop, steps):
    def follow():
        running = begun(loop, steps)
        return running, [running.step(s.frame, s.posture).twist for s in steps]

    first, twists = follow()
    _, again = follow()
    np.testing.assert_array_equal(again, twists)
    with pytest.raises(ValueError) as refused:
        first.step(Frame(steps[0].frame.image, 99.0, 99), steps[0].posture)
    assert str(refused.value) == (
        "this run is over, because its loop was started again: use the newest result of Loop.start"
    )


@pytest.mark.parametrize("given", [None, "still", 5])
def test_an_episode_of_something_else_is_a_sentence(given):
    for begin in (servo.Episode, lambda scenario: next(servo.run(scenario))):
        with pytest.raises(ValueError, match=r"^scenario: expected a Setup, got "):
            begin(given)


@pytest.mark.parametrize(
    ("region", "state", "sentence"),
    [
        ((20, 20), State(30.0, 30.0), "Tracker.start expected a Region, got (20, 20)"),
        (Region(20.0, 20.0), (30, 30), "Tracker.start expected a State, got (30, 30)"),
        (None, State(30.0, 30.0), "Tracker.start expected a Region, got None"),
    ],
)
def test_a_tuple_is_no_region_of_a_tracker_and_no_state(region, state, sentence):
    frame = Frame(np.zeros((60, 80, 3), np.uint8), 0.0, 0)
    with pytest.raises(ValueError, match=f"^{re.escape(sentence)}$"):
        tracking.create("mk_ssd").start(frame, region, state)
