"""Every plugin found in its folder keeps the contract of its kind."""

import inspect

import cv2
import numpy as np
import pytest
from servoing import begun, own, posture_of

import servo
from servo import Mistake, contracts, controllers, estimators, features
from servo.scenario.catalogue import LISTS, PLUGINS
from sim import kinds
from sim.channels import View
from sim.types import Frame
from tracking import trackers
from tracking.types import Estimate, Region, State, Status, goes_around, unknown_covariance

FOLDERS = [folder for folder, _ in PLUGINS.values()] + list(LISTS.values())
EVERY = [(folder, kind) for folder in FOLDERS for kind in folder.names()]
TRACKERS = [
    kind for kind in trackers.KINDS.names() if kind not in ("program", "tag", "trax", "truth")
]
"""Those that follow any target by themselves; `test_trax.py` and `test_guests_programs.py` have programs, and
`test_tag_tracker.py` a tag."""
WITH_COVARIANCE = {
    "annealed",
    "condensation",
    "hybrid",
    "kams",
    "kernel_pf",
    "mk_pf",
    "mk_ssd",
    "pf_ssd",
    "texture_pf",
}
"""Trackers with particles or a descent; the others have no covariance."""
ESTIMATORS = estimators.KINDS.names()
OF_FILES = ("onnx", "program")  # they need a network or a program
CONTROLLERS = [kind for kind in controllers.KINDS.names() if kind not in OF_FILES]
FIRST = State(80.0, 60.0, 0.3, 1.0)
STILL = posture_of(np.zeros(6))


def build(folder, kind, seed=0):
    return folder.config_of(kind)().build(np.random.default_rng(seed))


def frames(count=6, gone_after=None):
    """A textured target that drifts over a textured ground, and is gone later if asked."""
    rng = np.random.default_rng(3)
    ground = cv2.GaussianBlur(rng.integers(60, 140, (120, 160, 3)).astype(np.uint8), (0, 0), 2)
    for k in range(count):
        image = ground.copy()
        if gone_after is None or k < gone_after:
            box = cv2.boxPoints(((79.5 + k, 59.5), (40, 20), np.degrees(0.3)))
            cv2.fillConvexPoly(image, np.round(box).astype(int), (30, 60, 220))
            cv2.circle(image, (86 + k, 62), 5, (240, 240, 60), -1)
        image.setflags(write=False)
        yield Frame(image, k * 0.1, k)


def track(kind, seed=0, **options):
    tracker, sequence = build(trackers.KINDS, kind, seed), list(frames(**options))
    tracker.start(sequence[0], Region(40.0, 20.0), FIRST)
    return [tracker.update(frame) for frame in sequence[1:]]


@pytest.mark.parametrize(("folder", "kind"), EVERY)
def test_every_kind_documents_itself_and_its_settings(folder, kind):
    assert folder.summary(kind).endswith((".", ")"))
    docs = kinds.field_docs(folder.config_of(kind))
    assert all(docs.values()), docs


@pytest.mark.parametrize("kind", TRACKERS)
def test_trackers_give_finite_estimates_and_leave_the_frame_alone(kind):
    for estimate in track(kind):
        assert np.all(np.isfinite(estimate.state.vector))
        variances = np.diag(estimate.covariance)
        if kind in WITH_COVARIANCE:
            np.testing.assert_array_equal(np.isfinite(variances), [True, True, *estimate.follows])
        else:
            assert np.isnan(estimate.covariance).all()
        assert 0.0 <= estimate.distance <= 1.0


def jerked(kind, told, jump=(24, -16), count=8):
    """Largest error of the centre where the camera jerks to and fro [px]."""
    tracker, worst, before = build(trackers.KINDS, kind), 0.0, np.zeros(2, int)
    for k, frame in enumerate(frames(count)):
        shift = np.array(jump) * (k % 2)
        image = np.roll(frame.image, (shift[1], shift[0]), axis=(0, 1))
        image.setflags(write=False)
        moved, before = shift - before, shift
        if k == 0:
            tracker.start(Frame(image, 0.0, 0), Region(40.0, 20.0), FIRST)
            continue
        ego = np.array([*moved, 0.0, 0.0]) if told else None
        state = tracker.update(Frame(image, k * 0.1, k), ego).state
        true = np.array([FIRST.x + k, FIRST.y]) + shift
        worst = max(worst, float(np.hypot(*(true - [state.x, state.y]))))
    return worst


@pytest.mark.parametrize("kind", [k for k in TRACKERS if k not in ("cv_mil", "frozen", "opencv")])
def test_told_how_the_camera_jerked_trackers_stay_on_the_target(kind):
    assert jerked(kind, told=True) < 6.0


@pytest.mark.parametrize("kind", ["pf_ssd", "mk_ssd", "mk_pf", "mean_shift"])
def test_not_told_they_do_worse(kind):
    assert jerked(kind, told=False) > 2 * jerked(kind, told=True)


@pytest.mark.parametrize("kind", [k for k in TRACKERS if k not in ("frozen", "opencv")])
def test_a_target_that_is_gone_is_lost_not_an_exception(kind):
    """OpenCV's MIL always says that it sees its target, and its own word is final."""
    assert track(kind, count=30, gone_after=8)[-1].status is Status.LOST


@pytest.mark.parametrize("kind", TRACKERS)
def test_trackers_refuse_an_empty_region(kind):
    with pytest.raises(ValueError, match="both sides must be at least 4 px"):
        build(trackers.KINDS, kind).start(next(frames()), Region(0.0, 20.0), FIRST)


@pytest.mark.parametrize("kind", [k for k in ESTIMATORS if k != "integral"])  # it sums errors
def test_estimators_begin_at_zero_and_bridge_a_gap_with_what_they_know(kind):
    estimator, rng = begun(build(estimators.KINDS, kind)), np.random.default_rng(1)
    rest, speed = own(np.zeros(4)), np.array([0.1, -0.1, 0.05, 0.2])
    first = estimator.update(np.zeros(4), rest, 0.1)
    assert first.motion.tolist() == [0.0] * 4
    if kind == "true":
        estimator.see(View(true_motion=speed))
    for k in range(1, 60):
        estimator.update(0.1 * k * speed + rng.normal(0, 1e-5, 4), rest, 0.1)
    known = np.zeros(4) if kind == "none" else speed
    for _ in range(5):
        predicted = estimator.skip(rest, 0.1)
        np.testing.assert_allclose(predicted.motion, known, atol=0.01)
        assert np.all(np.isfinite(predicted.error))
        assert np.all(np.isnan(predicted.innovation))
    after = estimator.update(0.1 * 65 * speed, rest, 0.1)
    np.testing.assert_allclose(after.motion, known, atol=0.01)
    assert np.all(np.isfinite(after.error))


@pytest.mark.parametrize("kind", ESTIMATORS)
def test_estimators_that_have_seen_nothing_foretell_nothing(kind):
    predicted = begun(build(estimators.KINDS, kind)).skip(own(np.full(4, 0.3)), 0.1)
    assert predicted.motion.tolist() == [0.0] * 4
    assert predicted.error.tolist() == [0.0] * 4
    assert np.all(np.isnan(predicted.innovation))
    assert np.all(np.isnan(predicted.nis))


def test_an_unknown_kind_lists_what_there_is():
    with pytest.raises(kinds.UnknownKind) as refused:
        estimators.KINDS.config_of("magic")
    assert str(refused.value) == (
        "there is no kind 'magic'; there is difference, error_kalman, imm, integral, jump, "
        "kalman_ca, kalman_cv, none, true"
    )


SQUARE = np.array([[10.0, 10.0], [50.0, 12.0], [48.0, 40.0], [12.0, 38.0]])
"""The corners of a target that is seen from its front, in the order of `Region.corners`."""


@pytest.mark.parametrize(
    ("corners", "sentence"),
    [
        (np.zeros((4, 2)), "they should lie around an area in the order of Region.corners"),
        (np.ones((4, 2)) * 7, "they should lie around an area"),
        (SQUARE[[0, 2, 1, 3]], "they should lie around an area"),  # crossed
        (SQUARE[::-1], "they should lie around an area"),
        (SQUARE * [-1, 1], "they should lie around an area"),  # in a mirror
        (SQUARE * [1, 0], "they should lie around an area"),
        (np.array([*SQUARE[:3], [45.0, 30.0]]), "they should lie around an area"),  # a dent
        (SQUARE * 1e-9, "they should lie around an area"),  # OpenCV finds no pose of it
        (
            SQUARE * 1e300,
            "it should be an array of four points (4, 2) of finite numbers up to 1e+09",
        ),
        (SQUARE * np.nan, "it should be an array of four points (4, 2) of finite numbers"),
        (SQUARE[:3], "it should be an array of four points (4, 2)"),
        (SQUARE.tolist(), "it should be an array of four points (4, 2)"),
    ],
)
def test_corners_that_no_picture_of_a_rectangle_has_are_refused(corners, sentence):
    class Mine:
        def start(self, frame, region, state):
            self._state = state

        def update(self, frame, ego=None):
            seen = Status.LOCKED
            return Estimate(self._state, unknown_covariance(), 0.0, seen, corners=corners)

    with pytest.raises(Mistake) as refused:
        list(servo.run(servo.load("plate_still", ["run.duration=0.2"], tracker=Mine)))
    assert str(refused.value).startswith("tracker '")
    assert sentence in str(refused.value)


@pytest.mark.parametrize("turn", np.radians([0.0, 37.0, 90.0, 179.0, -120.0]))
def test_corners_may_be_turned_and_in_perspective(turn):
    rotation = [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
    assert goes_around(SQUARE @ rotation)
    assert goes_around(Region(40.0, 20.0).corners(State(1.0, 2.0, turn)).astype(np.float32))


def test_a_noisy_truth_whose_corners_cross_is_not_seen():
    """The noise is larger than the target."""
    noisy = ["tracker.corners=true", "tracker.noise=100", "run.duration=1.0"]
    steps = list(servo.run(servo.load("still", ["tracker.kind=truth", *noisy])))
    statuses = {step.estimate.status for step in steps[1:]}
    assert Status.UNSURE in statuses
    assert all(step.estimate.corners is None or step.seen for step in steps[1:])


@pytest.mark.parametrize("kind", ["partitioned", "weighted"])
def test_a_checked_part_shows_its_methods_to_isinstance_of_every_python(kind):
    """From Python 3.12 on `isinstance` with a protocol looks at attributes without calling
    `__getattr__`: the law would not find the inverse that these features bring.
    """
    outline = np.array([[-0.1, 0.1, 0.0], [0.1, 0.1, 0.0], [0.1, -0.1, 0.0], [-0.1, -0.1, 0.0]])
    found = contracts.guarded(features.KINDS.config(kind).build(outline), "features")
    assert inspect.getattr_static(found, "inverse", None) is not None
