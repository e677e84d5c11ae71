"""The loop without a world: pictures and postures from anywhere, the same twists."""

import numpy as np
import pytest

from servo.loop.episode import Episode
from servo.loop.loop import Loop
from servo.scenario.load import load
from tracking.types import Region, State


def test_it_asks_for_what_the_episode_asked_for():
    scenario = load("line", ["run.duration=0.5"], seed=4)
    with Episode(scenario) as episode:
        steps = list(episode)
    scene, first = steps[0].scene, steps[0]
    loop = Loop(scenario, scene.camera, scene.outline)
    running = loop.start(first.frame, scene.region, first.true_state)
    for step in steps:
        command = running.step(step.frame, step.posture)
        np.testing.assert_array_equal(command.twist, step.command.twist)
        decision = running.decision
        assert decision.estimate.state == step.estimate.state
        np.testing.assert_array_equal(decision.motion_measured, step.motion_measured)


def test_a_region_that_is_none_is_refused():
    with Episode(load("still")) as episode:
        frame = next(iter(episode)).frame
        camera, outline = episode.world.camera, episode.world.outline
    with pytest.raises(ValueError) as refused:
        Loop(load("still"), camera, outline).start(frame, Region(1.0, 9.0), State(160.0, 120.0))
    assert str(refused.value) == (
        "first frame: the region is 1 x 9 px; both sides must be at least 4 px"
    )
