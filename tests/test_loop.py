"""The loop without a world: pictures and postures from anywhere, the same twists."""

from dataclasses import replace

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


@pytest.fixture(scope="module")
def tagged():
    """The twist for a tag that is given by a size over its own, an angle and a place off it."""
    settings = ["tracker.kind=tag", "features.kind=hybrid", "start.angle_deg=12"]
    scenario = load("tag_still", settings)
    with Episode(scenario) as episode:
        frame, posture, truth = (
            episode.world.look(),
            episode.world.posture(),
            episode.world.truth(),
        )
        camera, outline = episode.world.camera, episode.world.outline

    def twist(size=1.0, theta=truth.theta, shift=0.0, whole=1.0):
        side = size * truth.size * np.sqrt(np.prod(np.ptp(outline[:, :2], axis=0)))
        x, y = truth.centre
        loop = Loop(scenario, camera, whole * outline)
        running = loop.start(frame, Region(side, side), State(x + shift, y, theta))
        for k in range(3):
            command = running.step(replace(frame, time=k / 30, index=k), posture)
        return command.twist

    return twist


@pytest.mark.parametrize(
    "given", [{"theta": 0.0}, {"theta": 1.8}, {"size": 1.5}, {"shift": 20.0}, {"size": 0.6}]
)
def test_a_tag_says_itself_how_large_it_is_and_how_it_lies(tagged, given):
    right = tagged()
    np.testing.assert_allclose(tagged(**given), right, atol=2e-3)
    assert right[5] > 0.15


def test_of_another_outline_the_region_says_where_it_is_in_the_plane_of_the_tag(tagged):
    """A plate with a margin around its tag."""
    np.testing.assert_allclose(tagged(size=1.25, whole=1.25), tagged(), atol=0.01)


def test_a_region_that_is_none_is_refused():
    with Episode(load("still")) as episode:
        frame = next(iter(episode)).frame
        camera, outline = episode.world.camera, episode.world.outline
    with pytest.raises(ValueError) as refused:
        Loop(load("still"), camera, outline).start(frame, Region(1.0, 9.0), State(160.0, 120.0))
    assert str(refused.value) == (
        "first frame: the region is 1 x 9 px; both sides must be at least 4 px"
    )
