"""Functions that check whether a component of yours, such as a tracker, works in servobench.

    from servo.testing import check_tracker

    def test_my_tracker():
        check_tracker(Config)

Each function takes a `Config` (class or instance), the name of a kind such as "kalman_cv", or
"module:Name", and raises `BrokenContract` with a sentence that says what to change.
"""

from servo.contracts import BrokenContract
from servo.testing.loop_parts import check_controller, check_estimator, check_features
from servo.testing.trackers import check_tracker
from servo.testing.world_parts import check_disturbance, check_motion, check_robot, check_target

__all__ = [
    "BrokenContract",
    "check_controller",
    "check_disturbance",
    "check_estimator",
    "check_features",
    "check_motion",
    "check_robot",
    "check_target",
    "check_tracker",
]
