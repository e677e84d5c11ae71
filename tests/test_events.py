"""Events of made-up steps."""

from dataclasses import replace

import pytest

from servo.loop.episode import Episode
from servo.loop.events import Event, events
from servo.scenario.load import load
from servo.types import Mode
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


def test_a_view_that_cannot_be_kept_is_an_event(step):
    leaving = replace(step, command=replace(step.command, violated=("view left",)))
    assert events(step, leaving) == events(None, leaving) == [Event.LEAVING]
    assert events(leaving, leaving) == []


def doing(step, mode):
    return replace(step, command=replace(step.command, mode=mode))


def test_what_the_controller_begins_to_do_is_an_event(step):
    coasting, holding, searching = (
        doing(step, m) for m in (Mode.COASTING, Mode.HOLDING, Mode.SEARCHING)
    )
    assert events(step, coasting) == [Event.COASTING]
    assert events(coasting, coasting) == []
    assert events(coasting, holding) == [Event.HOLDING]
    assert events(holding, searching) == [Event.SEARCHING]
    assert events(searching, step) == []
    assert Event.SEARCHING.value == Mode.SEARCHING.value


def test_a_dropped_frame_is_an_event_and_no_occlusion(step):
    dropped = replace(doing(step, Mode.COASTING), frame=replace(step.frame, fresh=False))
    assert events(step, dropped) == [Event.DROPPED]
    assert events(dropped, dropped) == []
    assert events(dropped, step) == []  # nothing was lost, so nothing is found
    lost = seen(dropped, Status.LOST)
    assert events(lost, step) == [Event.FOUND]
