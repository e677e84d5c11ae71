"""Each limit of the world and the loop: the last value that passes, and the first that does not."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from servo.controllers._bounds import inverse_of
from servo.controllers._inverse import Inverse
from servo.controllers._limits import Limits
from servo.controllers._target_loss import TargetLoss
from servo.estimators.jump import Cusum
from servo.loop import run_measures
from servo.loop.columns import FINAL_SPAN
from servo.loop.run_measures import Outcome
from servo.scenario.load import load
from servo.study.bounds import missed_bounds, missed_by_cells
from servo.types import Mode
from sim.disturbances import KINDS as DISTURBANCES
from sim.geometry import inverse_if_strong
from sim.timing import Rates
from tracking.types import Status as Tracked


@pytest.mark.parametrize(
    ("rate", "fits"),
    [
        (480.0, True),
        (480.1, False),
        (120.0, True),
        (119.0, False),
        (120.0 * (1 + 5e-10), True),
        (120.0 * (1 + 2e-9), False),
    ],
)
def test_whole_steps(rate, fits):
    assert (Rates.of(480.0, 120.0, rate).physics == 480.0) is fits


def effect(kind, time, **settings):
    config = DISTURBANCES.config_of(kind)(**settings)
    return config.build(np.random.default_rng(0)).at(time)


def test_disturbances_begin_and_end_at_their_times():
    board = {"start": 4.0, "duration": 0.5}  # it slides for 0.2 s
    assert [effect("board", t, **board).board is None for t in (3.79, 3.81, 4.69, 4.71)] == [
        True,
        False,
        False,
        True,
    ]
    car = {"start": 3.0, "duration": 6.0}
    assert [effect("second_target", t, **car).second is None for t in (2.99, 3.0, 9.0, 9.01)] == [
        True,
        False,
        False,
        True,
    ]
    drop = {"share": 1.0}  # from 0.5 s on
    assert [effect("dropped_frames", t, **drop).dropped for t in (0.49, 0.5)] == [False, True]


def test_an_inverse_as_large_as_allowed_is_taken():
    """Four singular values of 1/2: the inverse's norm is 4."""
    assert inverse_if_strong(np.eye(4) / 2, 0.25) is not None
    assert inverse_if_strong(np.eye(4) / 2, 0.2501) is None


def test_a_singular_value_at_the_tolerance_is_none():
    for small, inverse in ((1e-6, 0.0), (1.1e-6, 1 / 1.1e-6)):
        L = np.diag([1.0, small, 0, 0, 0, 0])[:2]
        found = Inverse.of(L, np.full(2, True), np.full(6, True), np.ones(6)).pseudo
        np.testing.assert_allclose(found, np.diag([1, inverse, 0, 0, 0, 0])[:, :2])


def test_a_weak_direction_of_a_robot_is_one_below_a_share_of_its_strongest():
    for scale in (1.0, 3.0, 100.0):
        kept = inverse_of(scale * np.diag([1, 1, 1, 1, 1, 0.0101]))
        left = inverse_of(scale * np.diag([1, 1, 1, 1, 1, 0.0099]))
        np.testing.assert_allclose(scale * kept, np.diag([1, 1, 1, 1, 1, 1 / 0.0101]))
        np.testing.assert_allclose(scale * left, np.diag([1, 1, 1, 1, 1, 0]), atol=1e-12)


def test_a_twist_at_the_limits_is_not_shortened():
    twist = np.array([0.6, 0, 0, 0, 0, 0])
    assert not Limits(0.6, 2.0, None, None).apply(twist, 1.0)[1]
    assert not Limits(0.6, 2.0, 1.2, None).apply(twist, 0.5)[1]
    assert Limits(0.6, 2.0, 1.2, None).apply(twist, 0.4999)[1]
    assert Limits(0.6, 2.0, 1.19, None).apply(twist, 0.5)[1]


def test_a_loss_goes_on_to_the_end_of_each_time():
    C, H, S = Mode.COASTING, Mode.HOLDING, Mode.SEARCHING
    loss = TargetLoss(1.0, 0.5, 0.1)
    assert [loss.wait(0.25) for _ in range(7)] == [C, C, C, C, H, H, S]
    assert loss.seen() is Mode.SERVOING
    assert loss.wait(1.0) is C
    assert [TargetLoss(0.0, None, 0.1).wait(t) for t in (0.0, 9.0)] == [C, H]


def test_a_sum_at_the_threshold_is_no_jump():
    assert Cusum(1.0, 4.0).jumped(np.array([5.0, -5.0, 5.01])).tolist() == [False, False, True]


@dataclass
class Step:
    """What measures look at."""

    time: float = 0.0
    servo_error: float = 0.0
    centre: tuple[float, float] = (5.0, 5.0)
    limited: bool = False
    joint_limits: tuple[str, ...] = ()
    turned_deg: float = 0.0
    size: float = 1.0
    servoed: tuple[bool, bool] = (True, True)
    tells_front_from_back: bool = False
    servoes_pose: bool = False
    rotation_error: float = 0.0

    @property
    def frame(self):
        return SimpleNamespace(time=self.time, image=np.zeros((30, 40, 3)))

    @property
    def truth(self):
        theta = np.radians(self.turned_deg)
        return SimpleNamespace(centre=np.array(self.centre), depth=1.0, theta=theta, size=self.size)

    @property
    def estimate(self):
        return SimpleNamespace(status=Tracked.LOCKED)

    @property
    def goal(self):
        return SimpleNamespace(theta=0.0, size=1.0)

    @property
    def goal_sight(self):
        return SimpleNamespace(picture=None)


@pytest.mark.parametrize(
    ("steps", "outcome"),
    [
        ([Step(servo_error=10.0)], Outcome.CONVERGED),
        ([Step(servo_error=10.01)], Outcome.TIMED_OUT),
        ([Step(0.0, 99.0), Step(1.0)], Outcome.CONVERGED),  # the last second has begun after it
        ([Step(0.01, 99.0), Step(1.0)], Outcome.TIMED_OUT),
        ([Step(turned_deg=-19.99)], Outcome.CONVERGED),
        ([Step(turned_deg=20.01)], Outcome.TIMED_OUT),
        ([Step(turned_deg=161.0)], Outcome.CONVERGED),  # moments take front for back
        ([Step(turned_deg=161.0, tells_front_from_back=True)], Outcome.TIMED_OUT),
        ([Step(turned_deg=89.0, servoed=(False, True))], Outcome.CONVERGED),
        ([Step(size=1.25)], Outcome.CONVERGED),
        ([Step(size=0.7499)], Outcome.TIMED_OUT),
        ([Step(size=2.0, servoed=(True, False))], Outcome.CONVERGED),
        ([Step(servoes_pose=True, rotation_error=0.349)], Outcome.CONVERGED),
        ([Step(servoes_pose=True, rotation_error=0.3491)], Outcome.TIMED_OUT),
        ([Step(rotation_error=2.0)], Outcome.CONVERGED),  # a tilt that nothing servoes
        ([Step(0.0, 99.0, (0.0, 0.0))], Outcome.TIMED_OUT),
        ([Step(0.0, 99.0, (40.0, 30.0))], Outcome.TIMED_OUT),
        ([Step(0.0, 99.0, (-0.1, 5.0))], Outcome.DIVERGED),
        ([Step(0.0, 99.0, (5.0, 30.1))], Outcome.DIVERGED),
        ([Step(0.0, 99.0, limited=True)], Outcome.LIMIT_HIT),
    ],
)
def test_outcomes(steps, outcome):
    final = [step for step in steps if step.time > steps[-1].time - FINAL_SPAN]
    assert run_measures._outcome(final) is outcome


@pytest.mark.parametrize(
    ("error", "turned", "grown", "off"),
    [
        (2.0, 1.0, 2.0, False),
        (2.01, 0, 0, True),
        (0, 1.01, 0, True),
        (0, -1.01, 0, True),
        (0, 0, 2.01, True),
        (0, 0, -2.01, True),
    ],
)
def test_settling(error, turned, grown, off):
    given = (
        np.array([first, then]) for first, then in ((0, 1), (error, 0), (turned, 0), (grown, 0))
    )
    time = run_measures._settling_time(*given)
    assert time == (1.0 if off else 0.0)


def test_a_measure_at_its_bound_keeps_it():
    assert missed_bounds("CONVERGED", {"lost_pct": 2.0}, {"lost_pct": 2.0}) == ()
    assert len(missed_bounds("CONVERGED", {"lost_pct": 2.0}, {"lost_pct": 1.99})) == 1
    rows = [{"lost_pct": 2.0, "success": s, "seed": k} for k, s in enumerate((True, False))]
    assert missed_by_cells([({}, rows)], {"lost_pct": 2.0, "success_rate": 0.5}) == []
    assert len(missed_by_cells([({}, rows)], {"lost_pct": 1.99, "success_rate": 0.51})) == 2


@pytest.mark.parametrize(("duration", "frames"), [(0.001, 1), (0.04, 1), (0.06, 2), (10.0, 300)])
def test_frames_of_a_run(duration, frames):
    assert load("still", [f"run.duration={duration}"]).frames == frames
