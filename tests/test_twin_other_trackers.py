"""Other trackers on the recording of a closed loop: by how much the picture would be displaced."""

import csv

import numpy as np
import pyarrow as pa
import pytest
from click.testing import CliRunner

from servo.cli.main import app
from servo.twin.other_trackers import Answers, Tracked, recorded
from tracking.drawing.video_writer import VideoWriter
from tracking.types import Region, Status

TARGET = Region(40.0, 40.0)
TIMES = np.arange(60) / 10
"""Pictures at 10 Hz: a mean of 0.5 s is one of five."""
RECORDED = np.tile([100.0, 80.0, 0.0, 1.0], (60, 1))


def tracked(change, name="mine", statuses=Status.LOCKED):
    return Tracked(name, TIMES, RECORDED + change, [statuses] * 60)


def texts(answers):
    return [[getattr(cell, "text", cell) for cell in row] for row in answers.table.rows]


def test_a_shift_displaces_the_picture_by_as_much_after_half_a_second():
    shift = np.zeros((60, 4))
    shift[20:, 0] = 10.0
    answers = Answers(TARGET, RECORDED, None, [tracked(shift)])
    assert answers.limit == pytest.approx(4.0)  # a tenth of 40 px
    displaced = answers.displaced(answers.found[0])
    np.testing.assert_allclose(displaced[18:26], [0, 0, 2, 4, 6, 8, 10, 10])
    assert texts(answers) == [["mine", "another way", "22 of 60: until 2.20 s", "0", "0", "4.0 px"]]


def test_noise_that_averages_out_and_a_log_without_angle_and_size_displace_nothing():
    rng = np.random.default_rng(0)
    noise = np.zeros((60, 4))
    noise[:, :2] = 4 * (-1) ** np.arange(60)[:, None]
    noise[:, 2:] = rng.normal(0, 0.3, (60, 2))
    unknown = RECORDED.copy()
    unknown[:, 2:] = np.nan
    answers = Answers(TARGET, unknown, None, [tracked(noise)])
    assert answers.displaced(answers.found[0]).max() < 1.2
    assert texts(answers)[0][1:3] == ["held", "all"]


def test_a_turn_and_a_size_displace_corners_and_a_lost_target_is_not_held():
    answers = Answers(TARGET, RECORDED, None, [tracked([0, 0, np.pi, 0]), tracked([0, 0, 0, 0.5])])
    half = np.hypot(20, 20)
    assert answers.displaced(answers.found[0])[-1] == pytest.approx(2 * half)
    assert answers.displaced(answers.found[1])[-1] == pytest.approx(0.5 * half)
    lost = Answers(TARGET, RECORDED, None, [tracked(0.0, statuses=Status.LOST)])
    assert texts(lost)[0][1:4] == ["lost", "all", "60"]


@pytest.mark.parametrize(("shift", "limit"), [(1.0, 4.0), (5.0, 10.0), (30.0, 20.0)])
def test_the_limit_is_twice_the_noise_of_the_recorded_tracker_inside_a_range(shift, limit):
    own = tracked([shift, 0, 0, 0], "own")
    assert Answers(TARGET, RECORDED, own, []).limit == pytest.approx(limit)


def test_estimates_of_a_log_are_interpolated_and_unknown_outside_of_it(tmp_path):
    columns = {"time_s": [0.0, 1.0], "estimated_x_px": [0.0, 10.0], "estimated_y_px": [4.0, 4.0]}
    found = recorded(pa.table(columns), tmp_path, np.array([-0.5, 0.5]))
    np.testing.assert_array_equal(found, [[np.nan] * 4, [5.0, 4.0, np.nan, np.nan]])
    assert recorded(pa.table({"time_s": [0.0]}), tmp_path, np.zeros(1)) is None


def test_an_angle_of_a_log_that_jumps_from_pi_to_minus_pi_is_interpolated_the_short_way(tmp_path):
    columns = {"time_s": [0.0, 1.0], "estimated_x_px": [1.0, 1.0], "estimated_y_px": [2.0, 2.0]}
    table = pa.table(columns | {"estimated_theta_rad": [3.1, -3.1]})
    (state,) = recorded(table, tmp_path, np.array([0.5]))
    assert state[2] == pytest.approx(np.pi)


def test_an_estimate_in_a_runs_log_is_of_its_own_picture(tmp_path):
    """It became known later than the next picture was taken."""
    frames = np.arange(6)
    columns = {"time_s": frames / 10, "frame": frames, "picture": [0, 0, 0, 2, 2, 4]}
    place = {"estimated_x_px": [0.0, 0, 0, 20, 20, 40], "estimated_y_px": [4.0] * 6}
    found = recorded(pa.table(columns | place), tmp_path, np.array([0.0, 0.2, 0.3, 0.4]))
    np.testing.assert_allclose(found[:, 0], [0.0, 20.0, 30.0, 40.0])


@pytest.mark.wide
@pytest.mark.parametrize("shutter", [(), ("--exposure-ms", "45")])
def test_twin_says_until_when_another_tracker_would_have_seen_the_same_pictures(shutter, tmp_path):
    """A log has the time of a picture's stamp, not the middle of its exposure."""
    canvas = np.random.default_rng(0).integers(0, 255, (30, 40, 1), np.uint8)
    canvas = np.kron(canvas, np.ones((8, 8, 3), np.uint8))
    film = VideoWriter(tmp_path / "film.mp4", 20, 160, 120)
    rows = []
    for k in range(100):
        x = round(20 + 20 * np.sin(k / 10))
        film.add(np.ascontiguousarray(canvas[40:160, x : x + 160]), k / 20)
        pose = {f"hand_{n}": 0.0 for n in ("y_m", "z_m", "qx", "qy", "qz")}
        seen = {"estimated_x_px": 80.0 + 45 * (k >= 50), "estimated_y_px": 60.0}
        rows.append({"time_s": k / 20, "hand_x_m": x / 200, "hand_qw": 1.0, **pose, **seen})
    film.close()
    with (tmp_path / "log.csv").open("w") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    words = ["twin", "log.csv", "film.mp4", "--begins", "0", "--tracker", "still=frozen", *shutter]
    words += ["--region", "60,40,40,40", "--out", "out"]
    with pytest.MonkeyPatch.context() as there:
        there.chdir(tmp_path)
        done = CliRunner().invoke(app, words)
    assert done.exit_code == 1, done.output
    assert "50 of 100" in done.output
    assert "Would another tracker have held?" in (tmp_path / "out/report.html").read_text()
