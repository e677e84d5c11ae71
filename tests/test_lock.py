from tracking.lock import Lock, LockConfig
from tracking.types import Status


def feed(lock, distances, start=0.0, dt=0.1):
    return [lock.judge(d, start + k * dt) for k, d in enumerate(distances)]


def test_the_threshold_follows_the_good_frames_between_floor_and_cap():
    lock = Lock(LockConfig(floor=0.1, cap=0.5))
    feed(lock, [0.2, 0.22, 0.18, 0.24, 0.16] + [0.2, 0.22, 0.18, 0.24])
    assert lock.threshold == 0.5  # too few to judge by
    feed(lock, [0.16])
    assert abs(lock.threshold - (0.2 + 3 * 1.4826 * 0.02)) < 1e-12
    feed(lock, [0.01] * 60)
    assert lock.threshold == 0.1


def test_a_large_distance_is_unsure_at_once_and_lost_after_its_patience():
    lock = Lock(LockConfig(patience=0.35))
    assert feed(lock, [0.1] * 5) == [Status.LOCKED] * 5
    after = feed(lock, [0.9] * 6, start=0.5)
    assert after == [Status.UNSURE] * 4 + [Status.LOST] * 2


def test_hysteresis_wants_a_clearly_better_distance_to_believe_again():
    lock = Lock(LockConfig(floor=0.3, hysteresis=0.8))
    feed(lock, [0.1] * 15)
    assert lock.judge(0.29, 1.0) is Status.LOCKED
    assert lock.judge(0.31, 1.1) is Status.UNSURE
    assert lock.judge(0.29, 1.2) is Status.UNSURE
    assert lock.judge(0.23, 1.3) is Status.LOCKED
    assert lock.judge(0.29, 1.4) is Status.LOCKED


def test_bad_frames_do_not_move_the_threshold():
    lock = Lock(LockConfig(floor=0.2))
    feed(lock, [0.1] * 10)
    before = lock.threshold
    feed(lock, [0.95] * 50, start=1.0)
    assert lock.threshold == before


def test_a_found_target_starts_its_patience_anew():
    lock = Lock(LockConfig(patience=0.25))
    feed(lock, [0.1] * 3)
    assert feed(lock, [0.9, 0.9, 0.1, 0.9, 0.9], start=1.0)[-1] is Status.UNSURE
