"""Logs and films that a pre-flight reads: which columns it takes, what it refuses, whose clock the film
has, and the commands `preflight` and `twin` on a film that has nothing to do with its log.
"""

import csv
from pathlib import Path

import cv2
import numpy as np
import pyarrow as pa
import pytest
from click.testing import CliRunner
from rich.console import Console
from scipy.spatial.transform import Rotation

from servo import Mistake
from servo.cli import main
from servo.cli.main import app
from servo.cli.preflight_command import Given, camera_for, followed, made, stated_mount
from servo.cli.twin_command import left_out, toml
from servo.loop.episode import Episode
from servo.scenario.load import load
from servo.twin import offset
from servo.twin.corrections import Kind, Smooth, motion
from servo.twin.readings import (
    clock_of,
    command_log,
    film,
    hand_log,
    is_camera,
    kinematics,
    log_table,
)
from sim.models.quaternion import quaternion_of
from sim.types import Camera

POSES = ("hand_x_m", "hand_y_m", "hand_z_m", "hand_qx", "hand_qy", "hand_qz", "hand_qw")
TWISTS = ("vx_m_s", "vy_m_s", "vz_m_s", "wx_rad_s", "wy_rad_s", "wz_rad_s")
HINT = (
    "hand_x_m, hand_y_m, hand_z_m, hand_qw, hand_qx, hand_qy, hand_qz (or camera_...), or joint_NAME_m "
    "and joint_NAME_rad with --scenario, or measured_vx_m_s ... measured_wz_rad_s"
)
EVEN = np.arange(401) / 50
"""Times of a log of 8 s [s]."""


def poses(times=EVEN, **changes):
    """The columns of a log whose hand slides along x at 0.01 m/s."""
    found = {"time_s": times, "hand_x_m": 0.01 * times}
    found |= dict.fromkeys(POSES[1:6], 0.0 * times)
    return found | {"hand_qw": 0.0 * times + 1} | changes


def written(folder, columns, name="log.csv"):
    path = folder / name
    with path.open("w") as file:
        rows = csv.writer(file)
        rows.writerow(columns)
        rows.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
    return path


def read(path, scenario):
    return hand_log(log_table(path, scenario, None, None), path, scenario)


def refused(folder, columns, scenario=None):
    with pytest.raises(Mistake) as caught:
        read(written(folder, columns), scenario)
    return str(caught.value).removeprefix(f"{folder / 'log.csv'}: ")


def test_a_log_of_poses_is_read_on_an_even_grid(tmp_path):
    columns = poses()
    columns["hand_y_m"] = np.where(EVEN == 2, np.nan, 0.5)
    columns["hand_qw"] = np.where(EVEN < 4, 1.0, -1.0)
    log = read(written(tmp_path, columns), None)
    assert (log.smooth.kind, log.smooth.names, log.smooth.poses_of) == (Kind.POSES, POSES, None)
    assert log.interval == pytest.approx(0.02)
    np.testing.assert_allclose(log.smooth.times, np.arange(0, 8, 0.005), atol=1e-9)
    np.testing.assert_allclose(log.smooth.values[:, 0], 0.01 * log.smooth.times, atol=1e-9)
    np.testing.assert_allclose(log.smooth.values[:, 1:], [[0.5, 0, 0, 0, 0, 1]] * 1600, atol=1e-9)


def test_a_log_may_have_the_cameras_poses_or_twists(tmp_path):
    columns = {name.replace("hand", "camera"): column for name, column in poses().items()}
    path = written(tmp_path, columns)
    assert read(path, None).smooth.names[0] == "camera_x_m"
    assert is_camera(log_table(path, None, None, None), path, None)
    path = written(tmp_path, poses())
    assert not is_camera(log_table(path, None, None, None), path, None)
    twists = {f"measured_{name}": np.sin(EVEN) for name in TWISTS}
    smooth = read(written(tmp_path, {"time_s": EVEN} | twists), None).smooth
    assert (smooth.kind, smooth.names) == (Kind.TWISTS, tuple(twists))
    np.testing.assert_allclose(smooth.values[800], np.sin([4.0] * 6), atol=1e-3)


NEAR = np.append(np.arange(39) / 16, 4.0)
"""As few rows, and as short a time, as a log may have."""


def test_a_log_may_be_as_short_as_40_rows_and_4_s_and_as_long_as_600_s(tmp_path):
    for times in (NEAR, np.append(EVEN, 600.0), np.arange(100) * 0.0999):
        assert read(written(tmp_path, poses(times)), None).smooth.times[0] == 0
    at_limits = poses(hand_x_m=np.where(EVEN == 2, 1e6, 0.0), hand_qw=0.0 * EVEN + 1.09)
    assert read(written(tmp_path, at_limits), None).smooth.values[0, 6] == pytest.approx(1)


@pytest.mark.parametrize(
    ("columns", "sentence"),
    [
        (
            {"stamp": EVEN},
            f"this log has no column time_s; it needs time_s and {HINT}; this one has stamp",
        ),
        (
            {"time_s": EVEN, "x": EVEN},
            "the motion of the hand does not follow from this log: a log needs time_s and "
            f"{HINT}; this one has time_s, x",
        ),
        (
            {"time_s": EVEN, "joint_a_rad": EVEN},
            "the motion of the hand does not follow from this log: give --scenario, the scenario "
            "whose robot has these joints",
        ),
        (
            poses(np.delete(NEAR, 5)),
            "39 rows of this log have a motion (hand_x_m and others); record at least 40",
        ),
        (
            poses(np.where(EVEN == 2, EVEN - 0.02, EVEN)),
            "time_s does not increase from row to row: sort or correct the rows",
        ),
        (
            poses(np.append(NEAR[:-1], 3.9)),
            "this log is 3.9 s long: record 4 to 600 s, best 30 s of the motion that --wiggle writes",
        ),
        (
            poses(np.append(EVEN, 600.5)),
            "this log is 600.5 s long: record 4 to 600 s, best 30 s of the motion that --wiggle "
            "writes",
        ),
        (
            poses(np.arange(80) * 0.11),
            "the rows of this log are more than 0.1 s apart: record one each 20 ms",
        ),
        (
            poses(hand_x_m=np.where(EVEN == 2, -1000001.0, 0.0)),
            "a number in hand_x_m ... is beyond +-10^6: correct or leave out its row",
        ),
        (
            poses(hand_qw=np.where(EVEN < 4, 1.0, 0.89)),
            "the quaternion is no unit quaternion: its length is 0.89 to 1; log qw, qx, qy, qz of the "
            "hand",
        ),
        (
            poses(hand_x_m=0.0 * EVEN),
            "the hand does not move in this log: play the motion that `servobench preflight --wiggle "
            "FILE` writes, and record it",
        ),
    ],
)
def test_a_log_that_cannot_be_used_is_a_sentence(tmp_path, columns, sentence):
    assert refused(tmp_path, columns) == sentence


def test_joints_become_the_cameras_poses_by_the_scenarios_robot(tmp_path):
    with Episode(load("line"), seen=False) as episode:
        robot, posture = episode.world.robot, episode.world.posture()
    names = [f"joint_{name}_{unit}" for name, unit in zip(robot.names, robot.units, strict=True)]
    poses_of = kinematics("line", names[::-1], tmp_path)
    [pose] = poses_of(posture.joints[None, ::-1])
    w, *vector = quaternion_of(posture.T_base_camera.rotation)
    np.testing.assert_allclose(pose, [*posture.T_base_camera.translation, *vector, w], atol=1e-9)
    columns = dict.fromkeys(names, 0.01 * EVEN) | {"time_s": EVEN}
    path = written(tmp_path, columns)
    smooth = read(path, "line").smooth
    assert (smooth.kind, smooth.names) == (Kind.JOINTS, tuple(names))
    assert is_camera(log_table(path, "line", None, None), path, "line")
    given = Given(path, "", "line")
    np.testing.assert_array_equal(stated_mount(given, given.table()).rotation, np.eye(3))
    # A gripper's joint does not move the camera, and may have a row in seven.
    gripper = np.where(np.arange(len(EVEN)) % 7 == 0, EVEN, np.nan)
    with_gripper = written(tmp_path, {"joint_gripper_rad": gripper} | columns)
    again = read(with_gripper, "line").smooth
    assert again.names == tuple(names)
    np.testing.assert_array_equal(again.times, smooth.times)
    del columns[names[0]]
    assert refused(tmp_path, columns, "line") == (
        f"the robot of 'line' has joints that the log lacks: {names[0]}"
    )


def test_joints_become_the_hands_poses_if_the_camera_stands_where_the_scenario_says(tmp_path):
    scenario = tmp_path / "stands.toml"
    scenario.write_text(
        'robot.kind = "arm"\ntarget.kind = "plate"\ngoal.depth = 0.9\n[camera]\nmounted = "world"\n'
        "pose = [0.0, -0.9, 0.75, -100.0, 0.0, 0.0]\nheld = [0.0, 0.0, 0.05, 0.0, 0.0, 0.0]\n"
    )
    with Episode(load(str(scenario)), seen=False) as episode:
        robot, posture = episode.world.robot, episode.world.posture()
        target = episode.world.target_at(0.0)
    names = [f"joint_{name}_{unit}" for name, unit in zip(robot.names, robot.units, strict=True)]
    [pose] = kinematics(str(scenario), names, tmp_path)(posture.joints[None])
    turn = Rotation.from_quat(pose[3:])
    np.testing.assert_allclose(pose[:3] + turn.apply([0, 0, 0.05]), target.translation, atol=1e-9)
    path = written(tmp_path, dict.fromkeys(names, 0.01 * EVEN) | {"time_s": EVEN})
    given = Given(path, "", str(scenario), eye_to_hand=True)
    stated = stated_mount(given, given.table())
    np.testing.assert_allclose(stated.lever, [0, -0.9, 0.75], atol=1e-12)
    assert stated_mount(Given(path, "", eye_to_hand=True), given.table()) is None
    assert stated_mount(Given(path, "", "line", eye_to_hand=True), given.table()) is None


def test_a_log_of_poses_and_commands_gets_its_measured_twists(tmp_path):
    columns = poses(hand_x_m=0.02 * np.sin(2 * EVEN))
    columns |= {f"command_{name}": 0.0 * EVEN for name in TWISTS}
    columns["command_vx_m_s"] = 0.04 * np.cos(2 * EVEN)
    path = written(tmp_path, columns)
    log = command_log(log_table(path, None, None, None), path, motion(read(path, None).smooth))
    [channel] = [each for each in log.channels if each.name == "vx"]
    np.testing.assert_allclose(channel.command.values[100], 0.04 * np.cos(4), atol=1e-6)
    np.testing.assert_allclose(log.interval, 0.02)


def test_a_film_has_the_logs_clock_if_it_begins_inside_the_log_or_a_second_before():
    log = Smooth(Kind.POSES, np.array([10.0, 20.0]), np.zeros((2, 7)), ())
    for stamp, begins in ((9.0, None), (20.0, None), (15.0, None), (8.9, 3.5)):
        clock = clock_of(round(1e9 * stamp), log, begins)
        assert clock.is_known
        assert clock.begins == pytest.approx(begins or stamp)
    for first in (None, 8_900_000_000, 20_100_000_000):
        clock = clock_of(first, log, None)
        assert (clock.begins, clock.is_known) == (10.0, False)


def pictures(folder, count, seed=0, size=(160, 120)):
    """Write pictures of a textured wall that is pushed about at random; return the folder."""
    rng = np.random.default_rng(seed)
    wall = cv2.GaussianBlur(rng.uniform(0, 255, (400, 400)).astype(np.float32), (0, 0), 2)
    wall = np.clip(128 + 6 * (wall - 128), 0, 255).astype(np.uint8)
    folder.mkdir()
    place = np.array([100, 100])
    for k in range(count):
        place += rng.integers(-2, 3, 2)
        x, y = place
        cv2.imwrite(str(folder / f"{k:03d}.png"), wall[y : y + size[1], x : x + size[0]])
    return folder


def test_a_file_of_stamps_gives_a_film_its_times(tmp_path):
    folder = pictures(tmp_path / "film", 3)
    source, taken = film(str(folder), 10.0, None, None)
    assert source.count == 3
    assert [each.time for each in taken] == pytest.approx([0, 0.1, 0.2])
    stamps = written(tmp_path, {"time_s": np.array([7.0, 7.5, 9.0])}, "stamps.csv")
    _, taken = film(str(folder), 10.0, None, stamps)
    assert [(each.time, each.stamp) for each in taken] == [
        (0.0, 7_000_000_000), (0.5, 7_500_000_000), (2.0, 9_000_000_000)
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("times", "sentence"),
    [
        (
            [],
            "the column time_s is empty, has an empty cell or does not increase: "
            "sort or correct its rows",
        ),
        (
            [1.0, 1.0, 2.0],
            "the column time_s is empty, has an empty cell or does not increase: "
            "sort or correct its rows",
        ),
        (
            [1.0, 2.0],
            "there are 2 stamps for 3 pictures of {folder}: give one stamp for each picture",
        ),
    ],
)
def test_stamps_that_do_not_fit_are_refused(tmp_path, times, sentence):
    folder = pictures(tmp_path / "film", 3)
    stamps = written(tmp_path, {"time_s": np.array(times)}, "stamps.csv")
    with pytest.raises(Mistake) as caught:
        film(str(folder), 10.0, None, stamps)
    assert str(caught.value) == f"{stamps}: {sentence.format(folder=folder)}"


def test_the_camera_is_that_of_the_calibration_or_of_a_field_of_view(tmp_path):
    given = Given(tmp_path / "log.csv", "film.mp4")
    camera = camera_for(given, 640, 480)
    assert camera.fx == camera.fy == pytest.approx(320 * np.sqrt(3))
    assert (camera.cx, camera.cy, camera.width, camera.height) == (320, 240, 640, 480)
    assert camera_for(Given(tmp_path, "", fov=90.0), 640, 480).fx == pytest.approx(320)
    path = tmp_path / "camera.yaml"
    path.write_text(
        "image_width: 640\nimage_height: 480\ndistortion_model: plumb_bob\n"
        "camera_matrix: {rows: 3, cols: 3, data: [500, 0, 320, 0, 510, 240, 0, 0, 1]}\n"
        "distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n"
    )
    given = Given(tmp_path, "", calibration=path)
    assert (camera_for(given, 640, 480).fx, camera_for(given, 640, 480).fy) == (500, 510)
    for size in ((640, 240), (320, 480)):
        with pytest.raises(Mistake) as caught:
            camera_for(given, *size)
        assert str(caught.value) == (
            f"{path}: this calibration is for 640 x 480 px, and the film has {size[0]} x {size[1]} "
            "px: give the calibration of this film"
        )


def test_the_page_says_which_command_repeats_it(tmp_path):
    given = Given(tmp_path / "log.csv", "film.mp4", mount=[0.5, 0, 0, 90, 0, 1.5], begins=2.0)
    words = f"{tmp_path / 'log.csv'} film.mp4"
    assert made(given).command == (
        f"servobench preflight {words} --begins 2.0 --mount 0.5,0,0,90,0,1.5"
    )
    slow = Given(tmp_path / "log.csv", "film.mp4", rate=10.0)
    assert made(slow).command == f"servobench preflight {words} --rate 10.0"
    assert made(Given(tmp_path / "log.csv", "film.mp4"), "twin", on="line").command == (
        f"servobench twin {words} --on line"
    )
    mount = stated_mount(given, pa.table({}))
    np.testing.assert_allclose(mount.lever, [0.5, 0, 0], atol=1e-12)
    np.testing.assert_allclose(mount.rotation[2], [0, 1, 0], atol=1e-9)


def test_the_wiggle_is_a_file_of_twists(tmp_path):
    path = tmp_path / "wiggle.csv"
    done = CliRunner().invoke(app, ["preflight", "--wiggle", str(path)])
    assert done.exit_code == 0, done.output
    head, *rows = csv.reader(path.read_text().splitlines())
    assert head == ["time_s", *(f"command_{name}" for name in TWISTS)]
    numbers = np.array(rows, float)
    np.testing.assert_allclose(numbers[:, 0], np.arange(1501) / 50)
    np.testing.assert_allclose(numbers[:, 1:].sum(axis=0), 0, atol=1e-3)
    spans = np.ptp(np.cumsum(numbers[:, 1:], axis=0), axis=0) / 50
    x, y, z, turn, *_ = spans * [1e3, 1e3, 1e3, *[180 / np.pi] * 3]
    said = " ".join(done.output.split())
    assert f"it moves by vx {x:.0f} mm, vy {y:.0f} mm, vz {z:.0f} mm, wx {turn:.1f} deg, wy" in said
    assert "30 s of rates, from rest to rest, where it began; " in said


@pytest.fixture
def unrelated(tmp_path, monkeypatch):
    """A log of 8 s, and a film of another motion from 3 s of it to 8.9 s."""
    monkeypatch.setattr(offset, "DRAWS", 2)  # the offset, whose curve takes seconds, is refused
    monkeypatch.setattr(offset, "OFFSETS", offset.OFFSETS[::20])
    folder = tmp_path
    x = 0.02 * np.sin(3 * EVEN)
    log = written(folder, poses(hand_x_m=x, hand_y_m=0.02 * np.sin(4 * EVEN)))
    film = pictures(folder / "film", 60)
    stamps = written(folder, {"time_s": 3.0 + np.arange(60) / 10}, "stamps.csv")
    return folder, [str(log), str(film), "--rate", "10", "--stamps", str(stamps)]


def test_a_preflight_of_another_film_refuses_all_numbers(unrelated):
    folder, words = unrelated
    out = folder / "page"
    done = CliRunner().invoke(app, ["preflight", *words, "--fov", "77", "--out", str(out)])
    assert done.exit_code == 1, done.output
    said = " ".join(done.output.replace("│", " ").split())
    assert "83 % of the film is inside the log's time; the rest is left out" in said
    for part in ("clock offset refused", "mount: rotation refused", "mount: lever refused"):
        assert part in said
    page = (out / "report.html").read_text()
    for text in (
        "5.9 s",
        "60 pictures, 160 x 120 px",
        "robot moves by its camera: 2.",
        "not ready",
    ):
        assert text in page, text


def test_a_twin_of_another_film_has_its_size_and_rate_and_no_replay(unrelated):
    folder, words = unrelated
    out = folder / "twin"
    done = CliRunner().invoke(app, ["twin", *words, "--fov", "77", "--out", str(out)])
    assert done.exit_code == 1, done.output
    assert "no replay: the mount is refused" in done.output
    scenario = load(out / "twin.toml")
    assert (scenario.camera.width, scenario.camera.height, scenario.camera.rate) == (160, 120, 10)
    assert scenario.camera.fx == pytest.approx(80 / np.tan(np.radians(38.5)), abs=0.006)
    assert scenario.believed.clock_offset_ms == 0
    lines = (out / "twin.toml").read_text().splitlines()
    assert lines[:2] == [
        "# the robot of a recording, on the scenario line",
        "# left out: [vary], [expect] of line, which were for its own robot; add your own: "
        "without [vary] all seeds start alike",
    ]
    assert "# hand_eye: not known; it needs a mount that is not refused, and --mount" in lines
    assert "# mistakes in the recording: none found" in lines
    assert lines[lines.index(f"fx = {scenario.camera.fx}") - 1] == "# given"
    assert not (out / "replay.mp4").exists()


@pytest.mark.parametrize(
    ("words", "begins"), [({}, 3.0), ({"exposure_ms": 8.0}, 2.996), ({"readout_ms": 20.0, "exposure_ms": 8.0}, 2.986)]
)  # fmt: skip
def test_a_known_exposure_and_readout_are_taken_off_the_stamps(unrelated, words, begins):
    _, (log, film, *_, stamps) = unrelated
    given = Given(Path(log), film, rate=10.0, stamps=Path(stamps), **words)
    smooth = hand_log(given.table(), given.log, None).smooth
    tracks, *_ = followed(given, smooth, Console(), None)
    assert tracks.times[0] == pytest.approx(begins, abs=1e-9)


@pytest.mark.parametrize(
    ("count", "level", "sentence"),
    [
        (
            40,
            None,
            "this film is 3.9 s long: record 4 s or more, best 30 s of the motion that --wiggle",
        ),
        (41, 90, "no points can be followed in this film: record a well lit scene with texture"),
    ],
)
def test_a_film_that_is_short_or_plain_is_refused(tmp_path, count, level, sentence):
    folder = pictures(tmp_path / "film", count)
    for path in folder.iterdir() if level else ():
        cv2.imwrite(str(path), np.full((120, 160), level, np.uint8))
    words = [str(written(tmp_path, poses())), str(folder), "--rate", "10"]
    done = CliRunner().invoke(app, ["preflight", *words, "--out", str(tmp_path / "out")])
    assert sentence in f"{done.output} {done.exception}"


def test_a_mount_in_millimetres_is_refused_before_points_are_followed(tmp_path, monkeypatch):
    def follow(*_):
        raise AssertionError("points are followed")

    monkeypatch.setattr("servo.cli.preflight_command.follow", follow)
    words = [str(written(tmp_path, poses())), str(pictures(tmp_path / "film", 3))]
    done = CliRunner().invoke(app, ["preflight", *words, "--mount", "5,40,0,0,0,0"])
    assert str(done.exception) == (
        "--mount: 40 m is too far from the hand, at most 5: give x, y, z in m"
    )
    at_limit = CliRunner().invoke(app, ["preflight", *words, "--mount", "5,-5,0,0,0,0"])
    assert str(at_limit.exception) == "points are followed"


def test_a_mount_of_the_cameras_own_poses_and_a_distance_beside_a_focal_length_are_refused(
    tmp_path,
):
    table = poses()
    own = {name.replace("hand_", "camera_"): values for name, values in table.items()}
    words = [str(written(tmp_path, own)), str(pictures(tmp_path / "film", 3))]
    done = CliRunner().invoke(app, ["preflight", *words, "--mount", "0,0,0,0,0,0"])
    assert str(done.exception) == (
        f"--mount: {words[0]} has the camera's own poses (columns camera_..., or joints with "
        "--scenario), in which the mount should be zero: leave --mount out"
    )
    done = CliRunner().invoke(app, ["preflight", *words, "--fov", "60", "--along", "0.1"])
    assert str(done.exception) == (
        "--along has no effect where --fov or --calibration gives the focal length, as the film "
        "then shows this distance: leave --along out"
    )


def test_a_scenario_that_does_not_exist_is_one_sentence_though_the_log_needs_none(
    tmp_path, monkeypatch, capfd
):
    log = written(tmp_path, poses())
    words = ["servobench", "preflight", str(log), "film", "--scenario", "linee"]
    monkeypatch.setattr("sys.argv", words)
    with pytest.raises(SystemExit) as ended:
        main.main()
    assert ended.value.code == 2
    sentence = "there is no scenario 'linee'; did you mean 'line'? (or give a .toml file)"
    assert capfd.readouterr() == ("", f"servobench: {sentence}\n")


def test_a_twins_scenario_has_its_changes_and_their_comments():
    changes = {"camera.rate": 25, "robot.lag_ms": 40.0}
    dropped = left_out(load("line").table, "line")
    notes = {"0": dropped, "robot.lag_ms": "+- 3 ms", "3": "mistakes: none"}
    text = toml("line", changes, notes)
    lines = text.splitlines()
    assert lines[:3] == [
        "# the robot of a recording, on the scenario line",
        "# left out: [vary], [expect] of line, which were for its own robot; add your own: "
        "without [vary] all seeds start alike",
        "# mistakes: none",
    ]
    assert lines[lines.index("lag_ms = 40.0") - 1] == "# +- 3 ms"
    assert "rate = 25" in text
    assert "[expect]" not in lines
    assert text.endswith("\n")


@pytest.mark.parametrize("name", ["barrel", "fisheye", "still"])
@pytest.mark.parametrize("own", ["", "fovy_deg = 50.0", "fx = 300.0\ncx = 150.0"])
def test_a_twins_scenario_has_the_lens_of_the_recording_alone(tmp_path, name, own):
    base = name
    if own:
        base = str(tmp_path / "mine.toml")
        Path(base).write_text(f"[camera]\n{own}\n")
    changes = {"camera.width": 1280, "camera.height": 720, "camera.fx": 1108.51}
    (tmp_path / "twin.toml").write_text(toml(base, changes, {}))
    with Episode(load(str(tmp_path / "twin.toml")), seen=False) as episode:
        assert episode.world.camera == Camera(1108.51, 1108.51, 640.0, 360.0, 1280, 720)


def test_a_twins_scenario_has_one_delay(tmp_path):
    (tmp_path / "mine.toml").write_text("run.latency = 3\n")
    text = toml(str(tmp_path / "mine.toml"), {"run.latency_ms": 55.0}, {})
    assert "latency_ms = 55.0" in text
    assert "latency = 3" not in text
