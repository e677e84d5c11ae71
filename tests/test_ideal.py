"""What a simulation knows beside the pictures: accepted twists, and the target's true motion."""

import numpy as np
import pytest

from servo.loop.episode import Episode
from servo.loop.loop import Loop
from servo.scenario.load import load


def test_the_robot_reports_what_its_drives_accept():
    with Episode(load("still", ["robot.kind=gantry"])) as episode:
        world = episode.world
        assert not world.step(np.array([0.0, 0.0, 0.05, 0.0, 0.0, 0.1]))
        accepted = world.posture().accepted
        np.testing.assert_allclose(accepted, [0.0, 0.0, 0.05, 0.0, 0.0, 0.1], atol=1e-3)
        assert world.step(np.array([50.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
        assert 0 < world.posture().accepted[0] < 5


def test_ideal_feed_forward_knows_the_motion_while_its_command_acts():
    scenario = load("sine", ["estimator.kind=true", "run.duration=1.0", "motion.frequency=0.5"])
    with Episode(scenario) as episode:
        steps = list(episode)
    assert scenario.run.latency == 1
    for now, later in zip(steps, steps[2:], strict=False):
        np.testing.assert_allclose(
            now.prediction.motion[:2], later.target_motion_true[:2], atol=3e-3
        )
    scene, first = steps[0].scene, steps[0]
    loop = Loop(scenario, scene.camera, scene.outline)
    with pytest.raises(ValueError) as refused:
        loop.start(first.frame, scene.region, first.true_state)
    assert str(refused.value) == (
        "estimator: this kind needs the true motion of the target (true_motion), which only a "
        "simulation knows: with a real camera choose another kind, such as kalman_cv"
    )
