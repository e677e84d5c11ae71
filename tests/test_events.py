"""Events of made-up steps."""

from dataclasses import replace

import pytest

from servo.episode import Episode
from servo.events import Event, events
from servo.scenario import load
from tracking.types import Status


@pytest.fixture(scope="module")
def step():
    with Episode(load("still", ["run.duration=0.1"])) as episode:
        return next(iter(episode))


def seen(step, status):
    return replace(step, estimate=replace(step.estimate, status=status))


@pytest.mark.parametrize(
    ("then", "now", "found"),
    [
        (Status.LOCKED, Status.UNSURE, [Event.OCCLUDED]),
        (Status.UNSURE, Status.LOST, [Event.LOST]),
        (Status.LOST, Status.LOCKED, [Event.FOUND]),
        (Status.UNSURE, Status.UNSURE, []),
    ],
)
def test_a_change_of_status_is_an_event(step, then, now, found):
    assert events(seen(step, then), seen(step, now)) == found


def test_limits_come_and_go_once(step):
    joint = replace(step, limited=True)
    speed = replace(step, command=replace(step.command, saturated=True))
    assert events(step, joint) == [Event.SATURATED]
    assert events(joint, speed) == []
    assert events(speed, step) == [Event.FREE]
    assert events(None, joint) == [Event.SATURATED]
    assert events(None, step) == []
