"""What a run leaves behind: table, recording, report, plots; also when it is killed."""

import json
import os
import signal
import time
from collections import Counter
from importlib import metadata

import cv2
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from commands import frames_in
from preloaded import Command
from servoing import METRIC

from servo.cli import run_command
from servo.cli.outputs import Outputs
from servo.loop.episode import Episode
from servo.output.recording import log
from servo.output.recording.destination import RecordingFile
from servo.output.steps_table import STREAM, quantities
from servo.scenario.load import load, parse

SHORT = ["run.duration=2.0", "disturbances.0.start=1.0", "goal.angle_deg=30.0"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("run") / "out"
    changes = [*SHORT, "expect={}", "vary={}"]
    assert run_command.run("occlusion", changes, 1, path, quiet=True) == 0
    return path


def recorded(path):
    """Rows of each entity's component in a recording."""
    from rerun.chunk import RrdReader

    rows = Counter()
    for chunk in RrdReader(str(path)).stream():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if ":" in name:
                rows[chunk.entity_path, name] += batch.num_rows - batch.column(name).null_count
    return rows


def test_a_run_writes_exactly_these_files(folder):
    assert sorted(p.name for p in folder.iterdir()) == [
        "errors.png",
        "report.json",
        "run.rrd",
        "steps.parquet",
        "target_motion.png",
    ]


def test_the_table_has_a_documented_row_for_each_frame(folder):
    table = pq.read_table(folder / "steps.parquet")
    assert table.num_rows == 60
    assert table["frame"].to_pylist() == list(range(60))
    robot = ("x", "y", "z", "yaw", "pitch", "roll"), ("m",) * 3 + ("rad",) * 3
    names = [column.name for quantity in quantities(METRIC, *robot) for column in quantity.columns]
    assert table.column_names == names
    assert len(set(names)) == len(names)
    assert all(table.schema.field(n).metadata[b"meaning"] for n in names)
    for name in (
        "true_x_px",
        "joint_yaw_rad",
        "measured_vx_m_s",
        "error_theta_rad",
        "seconds_render",
    ):
        assert name in names
    assert {"LOCKED", "UNSURE"} <= set(table["status"].to_pylist())


def test_the_report_tells_what_ran_and_what_came_out(folder):
    report = json.loads((folder / "report.json").read_text())
    assert report["scenario"] == "occlusion"
    assert report["seed"] == 1
    assert report["outcome"] == "CONVERGED"
    assert report["settings"]["tracker"]["kind"] == "pf_ssd"
    assert report["settings"]["run"]["duration"] == 2.0
    assert report["settings"]["disturbances"][0]["kind"] == "board"
    again = parse(report["settings"] | {"expect": report["expect"]}, "occlusion", "report.json")
    ran = load("occlusion", [*SHORT, "expect={}", "vary={}"], seed=1)
    assert report["settings"]["target"] == {"kind": "car"}
    assert again.settings() == ran.settings()
    assert again.disturbances == ran.disturbances
    assert report["versions"]["mujoco"] == metadata.version("mujoco")
    assert report["measures"]["unseen_pct"] > 20


@pytest.mark.parametrize("name", ["errors.png", "target_motion.png"])
def test_the_plots_are_pictures_with_something_on_them(folder, name):
    image = cv2.imread(str(folder / name))
    assert image.shape[0] > 600
    assert image.shape[1] > 900
    assert 5 < image.std() < 100


@pytest.mark.newest
def test_the_recording_holds_every_entity_for_every_frame(folder):
    rows = recorded(folder / "run.rrd")
    image = "/world/eye/image"
    assert rows[image, "EncodedImage:blob"] == 60
    for name in ("truth", "goal", "estimate"):
        assert rows[f"{image}/{name}", "LineStrips2D:strips"] == 60
    assert rows[f"{image}/particles", "Points2D:positions"] == 60  # the first cloud is empty
    for name in (
        "error",
        "features",
        "motion/xn",
        "motion/theta",
        "twist/linear",
        "twist/angular",
        "joints",
        "range",
        "distance",
        "ess",
        "ms",
    ):
        assert rows[f"/plots/{name}", "Scalars:scalars"] == 60, name
        assert rows[f"/plots/{name}", "SeriesLines:names"] == 1, name
    for body in (
        "eye",
        "robot/bridge",
        "robot/carriage",
        "robot/column",
        "robot/yaw_link",
        "robot/pitch_link",
        "robot/roll_link",
        "board",
        "target",
    ):
        assert rows[f"/world/{body}", "Transform3D:translation"] == 60, body
    assert rows["/world/fixed/mesh/table", "Mesh3D:vertex_positions"] == 1
    assert rows["/world/target/box", "Boxes3D:half_sizes"] == 1
    assert rows["/events", "TextLog:text"] >= 2


@pytest.mark.newest
def test_the_recording_shows_what_the_steps_say(folder):
    """One frame decoded: colours, poses and rectangles as they are in the table."""
    from rerun.chunk import RrdReader

    frame, found = 30, {}
    for chunk in RrdReader(str(folder / "run.rrd")).stream():
        batch = chunk.to_record_batch()
        if "frame" in batch.schema.names and frame in batch.column("frame").to_pylist():
            row = batch.column("frame").to_pylist().index(frame)
            for name in batch.schema.names:
                value = batch.column(name)[row].as_py()
                if ":" in name and value is not None:
                    found[chunk.entity_path, name] = value
    row = pq.read_table(folder / "steps.parquet").slice(frame, 1).to_pylist()[0]
    blob = np.frombuffer(bytes(found["/world/eye/image", "EncodedImage:blob"][0]), np.uint8)
    image = cv2.imdecode(blob, cv2.IMREAD_COLOR)
    blue, _, red = image.reshape(-1, 3).mean(axis=0)
    assert red > blue + 30  # a wooden table is brown, in BGR order
    position = found["/world/eye", "Transform3D:translation"][0]
    matrix = np.array(found["/world/eye", "Transform3D:mat3x3"][0]).reshape(3, 3).T
    # The camera looks down, its x axis turned from world x by the wrist: by 30 degrees.
    yaw = row["joint_yaw_rad"]
    np.testing.assert_allclose(matrix[:, 0], [np.cos(yaw), np.sin(yaw), 0.0], atol=2e-3)
    np.testing.assert_allclose(matrix[:, 2], [0.0, 0.0, -1.0], atol=2e-3)
    wrist = np.array(found["/world/robot/yaw_link", "Transform3D:mat3x3"][0]).reshape(3, 3).T
    np.testing.assert_allclose(wrist[:, 0], [np.cos(yaw), np.sin(yaw), 0.0], atol=2e-3)
    np.testing.assert_allclose(wrist[:, 1], [-np.sin(yaw), np.cos(yaw), 0.0], atol=2e-3)
    np.testing.assert_allclose(position[:2], [row["joint_x_m"], row["joint_y_m"]], atol=2e-3)
    for name, (x, y) in {
        "goal": (row["goal_x_px"], row["goal_y_px"]),
        "truth": (row["true_x_px"], row["true_y_px"]),
        "estimate": (row["estimated_x_px"], row["estimated_y_px"]),
    }.items():
        ring = np.array(found[f"/world/eye/image/{name}", "LineStrips2D:strips"][0][:4])
        np.testing.assert_allclose(ring.mean(axis=0), [x, y], atol=0.3, err_msg=name)


@pytest.mark.newest
def test_the_paths_are_recorded_in_pieces_of_bounded_size(tmp_path, monkeypatch):
    """A path in one entity would be written whole each second; its copies would grow in memory."""
    from rerun.chunk import RrdReader

    monkeypatch.setattr(log, "PIECE", 5)
    path = tmp_path / "a.rrd"
    with Episode(load("still", ["tracker.kind=truth", "run.duration=0.4"])) as episode:
        recording = log.RerunLog(RecordingFile(path), episode, every=0.0)
        steps = list(episode)
        for step in steps:
            recording.add(step)
        recording.close()
    pieces = {}
    for chunk in RrdReader(str(path)).stream():
        if chunk.entity_path.startswith("/world/path/"):
            column = chunk.to_record_batch().column("LineStrips3D:strips")
            pieces[chunk.entity_path] = np.array(column.to_pylist()[-1][0])
    assert [len(piece) for piece in pieces.values()] == [5, 5, 4]
    first, second, third = pieces.values()
    whole = np.concatenate([first, second[1:], third[1:]])  # each begins where the last one ends
    assert np.array_equal(second[0], first[-1])
    camera = [step.truth.T_world_camera.translation for step in steps]
    np.testing.assert_allclose(whole, camera, atol=1e-6)


def test_the_table_pairs_commands_with_the_frames_they_act_in(folder):
    table = pq.read_table(folder / "steps.parquet").to_pydict()
    assert table["acting_vx_m_s"][1:] == table["command_vx_m_s"][:-1]
    # The car drives at 0.1 m/s along its nose, which the goal has at 30 degrees; xn is in metres.
    np.testing.assert_allclose(table["motion_true_xn_m_s"][5:], 0.1 * np.cos(np.pi / 6), atol=2e-3)
    np.testing.assert_allclose(table["motion_true_yn_m_s"][5:], 0.1 * np.sin(np.pi / 6), atol=2e-3)


@pytest.mark.processes
@pytest.mark.newest
def test_a_killed_run_keeps_its_recording_and_its_rows_to_the_last_second(tmp_path):
    out = tmp_path / "out"
    words = ["run", "reversal", "--quiet", "--out", out, "--set", "run.duration=600"]
    process = Command(words, stdout=os.devnull, stderr=os.devnull)
    stream, deadline = out / STREAM, time.monotonic() + 120
    while len(frames_in(stream)) < 90:
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.05)
    before = len(frames_in(stream))
    time.sleep(2.0)  # both files are written once a second, each at moments of its own
    process.send_signal(signal.SIGKILL)
    process.wait()
    rows = recorded(out / "run.rrd")
    images = rows["/world/eye/image", "EncodedImage:blob"]
    frames = frames_in(stream)
    # What came in these two seconds, and a few images more, which the recorder's own buffer may hold back.
    lag = (len(frames) - before) + 40
    assert list(out.rglob(".*.part")) == []
    assert pa.ipc.open_stream(str(stream)).read_all()["frame"].to_pylist() == frames
    assert frames == list(range(len(frames)))
    assert images >= 60
    assert len(frames) > images - lag
    assert rows["/plots/error", "Scalars:scalars"] > images - lag
    assert images > len(frames) - lag


@pytest.mark.parametrize(("speed", "pace"), [(None, 1.0), (2.5, 2.5)])
def test_a_viewer_shows_real_time_unless_a_speed_is_given(speed, pace):
    assert Outputs(live=True, speed=speed).pace == pace
