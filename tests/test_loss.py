import numpy as np
import pytest

from tracking.loss import LossJudge, LossLimits
from tracking.search.velocity import Velocity
from tracking.types import State, Status


def feed(lock, distances, start=0.0, dt=0.1):
    return [lock.judge(d, start + k * dt) for k, d in enumerate(distances)]


def test_the_threshold_follows_the_good_frames_between_floor_and_cap():
    lock = LossJudge(LossLimits(floor=0.1, cap=0.5))
    feed(lock, [0.2, 0.22, 0.18, 0.24, 0.16] + [0.2, 0.22, 0.18, 0.24])
    assert lock.threshold == 0.5  # too few to judge by
    feed(lock, [0.16])
    assert abs(lock.threshold - (0.2 + 3 * 1.4826 * 0.02)) < 1e-12
    feed(lock, [0.01] * 60)
    assert lock.threshold == 0.1


def test_a_large_distance_is_unsure_at_once_and_lost_after_its_patience():
    lock = LossJudge(LossLimits(patience=0.35))
    assert feed(lock, [0.1] * 5) == [Status.LOCKED] * 5
    after = feed(lock, [0.9] * 6, start=0.5)
    assert after == [Status.UNSURE] * 4 + [Status.LOST] * 2


def test_hysteresis_wants_a_clearly_better_distance_to_believe_again():
    lock = LossJudge(LossLimits(floor=0.3, hysteresis=0.8))
    feed(lock, [0.1] * 15)
    assert lock.judge(0.29, 1.0) is Status.LOCKED
    assert lock.judge(0.31, 1.1) is Status.UNSURE
    assert lock.judge(0.29, 1.2) is Status.UNSURE
    assert lock.judge(0.23, 1.3) is Status.LOCKED
    assert lock.judge(0.29, 1.4) is Status.LOCKED


def test_bad_frames_do_not_move_the_threshold():
    lock = LossJudge(LossLimits(floor=0.2))
    feed(lock, [0.1] * 10)
    before = lock.threshold
    feed(lock, [0.95] * 50, start=1.0)
    assert lock.threshold == before


def test_a_found_target_starts_its_patience_anew():
    lock = LossJudge(LossLimits(patience=0.25))
    feed(lock, [0.1] * 3)
    assert feed(lock, [0.9, 0.9, 0.1, 0.9, 0.9], start=1.0)[-1] is Status.UNSURE


def test_a_sudden_rise_with_a_jump_is_doubted_for_a_while():
    """The usual distance is 0.05; 0.2 is below the floor."""
    lock = LossJudge(LossLimits(sudden=1.5))
    feed(lock, [0.05, 0.05, 0.051] * 5)
    ends = [lock.judge(0.2, 2.0 + k / 8, jump) for k, jump in enumerate((0.1, 0, 0, 0, 0.1))]
    assert ends == [Status.UNSURE] * 3 + [Status.LOCKED] * 2


@pytest.mark.parametrize(
    ("distance", "jump", "settings"),
    [(0.2, 0.03, {}), (0.079, 0.1, {}), (0.2, 0.1, {"sudden": 5.0}), (0.2, 0.1, {"sudden": 0.0})],
)
def test_a_rise_alone_a_jump_alone_or_a_small_rise_is_believed(distance, jump, settings):
    lock = LossJudge(LossLimits(**{"sudden": 1.5} | settings))
    feed(lock, [0.05, 0.05, 0.051] * 5)
    assert lock.judge(distance, 2.0, jump) is Status.LOCKED


def test_a_rise_within_the_usual_spread_is_believed():
    """0.2 is 1.7 times the median, and 2.7 robust standard deviations of 0.03 above it."""
    lock = LossJudge(LossLimits(sudden=1.5))
    feed(lock, [0.1, 0.12, 0.14] * 5)
    assert lock.judge(0.2, 2.0, 0.1) is Status.LOCKED


def test_what_comes_out_of_hiding_is_doubted_anew():
    """Half covered before and after it was hidden."""
    lock = LossJudge(LossLimits(sudden=1.5))
    feed(lock, [0.05, 0.05, 0.051] * 5)
    distances = [0.19, 0.9, 0.9, 0.9, 0.9, 0.9, 0.19, 0.05]
    ends = [lock.judge(d, 2.0 + k / 10, 0.1) for k, d in enumerate(distances)]
    assert ends == [Status.UNSURE] * 7 + [Status.LOCKED]


def test_where_a_tracker_predicts_nothing_the_rise_alone_is_doubted():
    lock = LossJudge(LossLimits(sudden=1.5))
    feed(lock, [0.05, 0.05, 0.051] * 5)
    assert lock.judge(0.2, 2.0) is Status.UNSURE


def test_a_jump_is_what_the_velocity_did_not_expect():
    """10 px a frame at first, then 12: 2 px of a target of 40 px, at twice its size."""
    state = State(100.0, 50.0, 0.0, 2.0)
    velocity = Velocity(state, 0.0)
    velocity.learn(state.moved(np.array([10.0, 0, 0, 0])), seen=True)
    velocity.step(np.array([5.0, 0, 0, 0]))
    assert velocity.jump(State(127.0, 50.0, 0.0, 2.0), 40.0) == 2 / 80
    assert abs(velocity.jump(State(127.0, 50.0, 0.0, 2.2), 40.0) - np.log(1.1)) < 1e-12


def test_a_distance_that_is_no_number_is_no_target():
    judge = LossJudge(LossLimits(patience=0.5))
    assert judge.judge(0.1, 0.0) is Status.LOCKED
    assert judge.judge(float("nan"), 0.1) is Status.UNSURE
    assert judge.judge(float("nan"), 0.6) is Status.LOST
