"""A camera of any rate: physics is fitted to it, and the run says so."""

import json

import numpy as np
import pytest
from measured import measured_run

from servo.cli import run_command
from servo.loop.episode import Episode
from servo.scenario.load import load
from sim.timing import Rates

ASKED = 480.0, 120.0


@pytest.mark.parametrize(
    ("rate", "fitted", "changed"),
    [
        (30.0, Rates(480.0, 16, 4), {}),
        (5.0, Rates(480.0, 96, 4), {}),
        (25.0, Rates(500.0, 20, 4), {"world.physics_rate": 500.0, "world.drive_rate": 125.0}),
        (29.97, Rates(599.4, 20, 5), {"world.physics_rate": 599.4, "world.drive_rate": 119.88}),
        (50.0, Rates(500.0, 10, 5), {"world.physics_rate": 500.0, "world.drive_rate": 100.0}),
        (480.0, Rates(480.0, 1, 4), {}),  # the drives once a frame
        (1000.0, Rates(1000.0, 1, 1), {"world.physics_rate": 1000.0}),
    ],
)
def test_physics_is_fitted_to_the_cameras_rate(rate, fitted, changed):
    found = Rates.of(*ASKED, rate)
    assert found == fitted
    assert found.changed(*ASKED, rate) == changed


@pytest.mark.parametrize("drive", [0.1, 7.0, 100.0, 120.0, 500.0, 100_000.0])
@pytest.mark.parametrize("rate", [0.5, 7.0, 24.0, 29.97, 59.94, 333.3, 1000.0])
def test_physics_never_gets_slower_and_a_frame_is_whole_steps(rate, drive):
    found = Rates.of(480.0, drive, rate)
    assert found.physics >= 480.0 * (1 - 1e-9)
    assert found.steps * rate == pytest.approx(found.physics)
    assert found.drive_steps >= 1
    if found.physics != 480.0:
        assert found.steps % found.drive_steps == 0
        assert found.physics < 2 * max(480.0, rate)


@pytest.mark.parametrize("rate", [25.0, 29.97, 50.0])
def test_a_camera_of_any_rate_stays_in_step_with_the_world(rate):
    changes = ["motion.x=0", "motion.speed=0.1", "controller.kind=hold", f"camera.rate={rate}"]
    with Episode(load("line", changes)) as episode:
        world, twist = episode.world, np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])
        for k in range(1, 8):
            world.step(twist)
            assert world.data.time == pytest.approx(k / rate, rel=1e-12)
            assert world.truth().T_world_target.translation[0] == pytest.approx(0.1 * k / rate)
        steps = Rates.of(*ASKED, rate).steps
        assert world.model.opt.timestep * steps == pytest.approx(1 / rate, rel=1e-12)
        assert world.posture().twist[0] == pytest.approx(0.1, rel=0.05)


@pytest.mark.wide
@pytest.mark.parametrize("rate", [25.0, 29.97, 50.0])
def test_the_loop_converges_at_any_rate(rate):
    changes = [
        "tracker.kind=mean_shift",
        "run.duration=3.0",
        "measure.after=2.5",
        "start.x=30",
        f"camera.rate={rate}",
    ]
    steps, report = measured_run(load("still", changes))
    assert len(steps) == round(3 * rate)
    assert report.measures["servo_rms_px"] < 2.0


def test_the_report_and_the_command_say_which_rates_were_used(tmp_path, capsys):
    changes = ["run.duration=0.2", "camera.rate=25", "tracker.kind=frozen", "expect={}"]
    assert run_command.run("still", changes, 0, tmp_path, quiet=False, no_rerun=True) == 0
    said = capsys.readouterr().out
    assert "world.physics_rate = 500 Hz was used, to fit camera.rate\n" in said
    assert "world.drive_rate = 125 Hz was used, to fit camera.rate\n" in said
    rates = json.loads((tmp_path / "report.json").read_text())["rates"]
    assert rates == {"world.physics_rate": 500.0, "world.drive_rate": 125.0}


def test_where_the_rate_divides_nothing_is_said(tmp_path, capsys):
    changes = ["run.duration=0.2", "tracker.kind=frozen", "expect={}"]
    assert run_command.run("still", changes, 0, tmp_path, quiet=False, no_rerun=True) == 0
    assert "Hz was used" not in capsys.readouterr().out
    assert json.loads((tmp_path / "report.json").read_text())["rates"] == {}


@pytest.mark.parametrize("rate", [80.0, 96.0, 160.0, 240.0, 480.0])
def test_an_acceleration_limit_holds_for_the_time_until_the_next_update_of_the_drives(rate):
    """The drives are updated at each frame, also where that is earlier than their own rate."""
    changes = ["controller.kind=hold", "robot.acceleration=0.5", f"camera.rate={rate}"]
    with Episode(load("still", changes)) as episode:
        world = episode.world
        for k in range(1, 10):
            assert world.step(np.array([9.0, 0.0, 0.0, 0.0, 0.0, 0.0]))[0] == "x (acceleration)"
            assert world.data.ctrl[0] == pytest.approx(0.5 * k / rate)
        # What the command reaches on average over a frame's updates, each for as long as it holds.
        ends = np.append(world.ticks, world.period)
        during = 0.5 * (9 - 1) / rate + 0.5 * ends[1:]
        expected = during @ np.diff(ends) / world.period
        posture = world.posture()
        accepted = np.linalg.solve(posture.jacobian, posture.accepted)
        assert accepted[0] == pytest.approx(expected, rel=1e-3)
