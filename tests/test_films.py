"""Films: what they show and when, what a kill leaves of them, and that browsers play them."""

import re
import resource
from contextlib import nullcontext
from types import SimpleNamespace

import av
import cv2
import mujoco
import numpy as np
import pytest
from click.testing import CliRunner
from commands import PATIENCE
from matplotlib.colors import to_rgba_array
from matplotlib.figure import Figure

import servo
from servo.cli import film_command
from servo.cli.main import app
from servo.loop.episode import Episode
from servo.mistake import Mistake
from servo.output import room_view
from servo.output.film import (
    BORDER,
    FOLLOWING,
    FRUSTUM,
    PANEL,
    PANEL_OF_TWO,
    TITLE_OF_TWO,
    RunViews,
    write_film,
    write_film_of_two,
)
from servo.output.room_view import RoomView
from servo.study.run_report import RunReport
from sim.kinds import kind_of
from tracking.drawing.colours import GOAL, PARTICLES, STATUS_ON_WHITE
from tracking.drawing.film_page import (
    BELOW,
    CAPTION,
    CHART,
    HEAD,
    LEFT,
    LETTER,
    MARGIN,
    OTHERS,
    FilmPage,
    panel,
)
from tracking.drawing.running_chart import Chart, RunningChart
from tracking.drawing.video_writer import VideoWriter
from tracking.sequences.video_file import Video

CHANGES = ["run.duration=0.2", "tracker.kind=frozen", "estimator.kind=none", "start.x=-40"]


def times_of(path):
    with av.open(str(path)) as container:
        return [frame.time for frame in container.decode(video=0)]


@pytest.mark.newest
def test_frames_have_their_own_times_and_colours(tmp_path):
    times, colour = [0.0, 0.04, 0.5, 1.7, 1.75], (200, 40, 90)
    writer = VideoWriter(tmp_path / "a.mp4", 25.0, 64, 48)
    for time in times:
        writer.add(np.full((48, 64, 3), colour, np.uint8), time)
    writer.close()
    assert times_of(tmp_path / "a.mp4") == pytest.approx(times, abs=1e-4)
    for picture in Video.of(tmp_path / "a.mp4"):
        np.testing.assert_allclose(picture.image[20, 30], colour, atol=3)


def test_what_is_not_finished_can_be_played_but_for_its_last_frame(tmp_path):
    writer = VideoWriter(tmp_path / "a.mp4", 10.0, 64, 48)
    for k in range(35):
        writer.add(np.full((48, 64, 3), 7 * k, np.uint8), k / 10)
    writer.abandon()
    assert times_of(tmp_path / "a.mp4") == pytest.approx([k / 10 for k in range(34)])


@pytest.fixture
def no_file_over():
    """Refuse to let a file grow over a size [bytes], as a full disk does."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, limits)


NOISE = np.random.default_rng(0).integers(0, 255, (25, 48, 64, 3), np.uint8)


def write_noise(path):
    writer = VideoWriter(path, 10.0, 64, 48)
    try:
        for k, picture in enumerate(NOISE):
            writer.add(picture, k / 10)
    finally:
        writer.close()


@pytest.mark.parametrize(
    ("missing", "playable"),
    [(1, 24), (8, 24), (600, 24), (13_000, 20), (20_000, 17), (39_000, 10), (64_800, 0)],
)
def test_what_a_full_disk_leaves_can_be_played_or_is_not_there(
    tmp_path, no_file_over, missing, playable
):
    write_noise(tmp_path / "whole.mp4")
    assert len(times_of(tmp_path / "whole.mp4")) == 25
    no_file_over((tmp_path / "whole.mp4").stat().st_size - missing)
    path = tmp_path / "cut.mp4"
    with pytest.raises(OSError, match=r"File too large: '.*cut\.mp4'"):
        write_noise(path)
    assert path.exists() == (playable > 0)
    assert not playable or times_of(path) == pytest.approx([k / 10 for k in range(playable)])


def test_a_film_without_a_frame_is_not_there(tmp_path):
    VideoWriter(tmp_path / "a.mp4", 10.0, 64, 48).close()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.newest
def test_a_film_of_a_run_shows_camera_room_and_errors(tmp_path):
    steps = list(servo.run(servo.load("still", CHANGES)))
    write_film(steps, tmp_path / "a.mp4", "a $title$")
    assert times_of(tmp_path / "a.mp4") == pytest.approx([step.frame.time for step in steps])
    *_, last = Video.of(tmp_path / "a.mp4")
    width, height = PANEL
    assert last.image.shape == (HEAD + CAPTION + height + CHART, 3 * MARGIN + 2 * width, 3)
    pictures = last.image[HEAD + CAPTION : -CHART]
    room = RoomView(steps[-1].scene.room, width, height)
    expected = room.render(steps[-1].bodies)
    room.close()
    shown = pictures[:, -MARGIN - width : -MARGIN].astype(int)
    besides = height - height // FOLLOWING - BORDER  # the rows above the following view
    assert np.abs(shown - expected)[:besides].mean() < 3
    factor = width / steps[-1].frame.image.shape[1]
    corner = (steps[-1].goal.corners[1] * factor).round().astype(int)
    near = pictures[corner[1] - 2 : corner[1] + 3, MARGIN + corner[0] - 2 : MARGIN + corner[0] + 3]
    assert np.abs(near.astype(int) - GOAL).sum(axis=2).min() < 60


def test_points_of_the_room_are_where_they_are_drawn():
    with Episode(servo.load("line", CHANGES)) as episode:
        world = episode.world
        view = RoomView(world.model, *PANEL)
        bodies = world.bodies()
        with_target = view.render(bodies).astype(int)
        target = world.truth().T_world_target
        bodies[list(world.moving).index("target"), :, 3] += 100.0  # out of the picture
        rows, columns = np.nonzero((view.render(bodies) != with_target).any(axis=2))
        view.close()
    ((x, y),) = view.project(target.translation[None])
    assert (columns.min(), rows.min()) < (x, y) < (columns.max(), rows.max())
    assert np.hypot(x - columns.mean(), y - rows.mean()) < 5


def test_a_camera_that_looks_straight_down_has_the_worlds_x_to_its_right():
    with Episode(servo.load("line", CHANGES)) as episode:
        view = RoomView(episode.world.model, *PANEL)
    view.look(np.array([0.2, 0.1, 2.0]), np.array([0.2, 0.1, 0.0]))
    at = view.project(np.array([[0.2, 0.1, 0.0], [0.3, 0.1, 0.0], [0.2, 0.2, 0.0]]))
    view.close()
    focal = PANEL[1] / 2 / np.tan(np.radians(55) / 2)
    aside = 0.1 / 2 * focal
    middle = np.array(PANEL) / 2
    np.testing.assert_allclose(at, middle + [[0, 0], [aside, 0], [0, -aside]], atol=1e-9)


def test_the_room_shows_where_the_camera_looks_and_has_been():
    steps = list(
        servo.run(servo.load("line", [*CHANGES, "tracker.kind=truth", "run.duration=0.5"]))
    )
    camera = steps[0].scene.camera
    views = RunViews(camera, steps[0].scene.room, PANEL)
    bare = RoomView(steps[0].scene.room, *PANEL)
    besides = PANEL[1] - PANEL[1] // FOLLOWING - BORDER  # the rows above the following view
    for step in steps:
        _, room = views.draw(step)
    drawn = np.abs(room.astype(int) - bare.render(steps[-1].bodies)).sum(axis=2)[:besides] > 30
    pose = steps[-1].truth.T_world_camera
    corner = np.array([[-camera.cx / camera.fx, -camera.cy / camera.fy, 1.0]])
    ends = pose.apply(FRUSTUM * corner)[0], steps[0].truth.T_world_camera.translation
    way = np.linalg.norm(pose.translation - ends[1])
    assert way > 0.02
    for x, y in bare.project(np.array([pose.translation, *ends])).round().astype(int):
        assert drawn[y - 1 : y + 2, x - 1 : x + 2].any()
    views.close()
    bare.close()
    assert drawn.mean() < 0.01


@pytest.mark.wide
def test_one_view_follows_the_camera_and_the_corners_leave_their_ways():
    changes = [*CHANGES, "tracker.kind=truth", "start.x=60", "run.duration=1"]
    steps = list(servo.run(servo.load("line", changes)))
    views = RunViews(steps[0].scene.camera, steps[0].scene.room, PANEL)
    width, height = PANEL[0] // FOLLOWING, PANEL[1] // FOLLOWING
    cameras = []
    for step in steps:
        seen, room = views.draw(step)
        beside = room[-height:, -width:].astype(int)
        lines = np.abs(beside - PARTICLES).sum(axis=2) < 60
        cameras.append(np.nonzero(lines)[0].mean())
    views.close()
    moved = steps[-1].truth.T_world_camera.translation - steps[0].truth.T_world_camera.translation
    assert np.linalg.norm(moved) > 0.05
    assert np.ptp(cameras) < height / 10
    factor = PANEL[0] / steps[0].frame.image.shape[1]
    begins = [
        seen[y - 2 : y + 3, x - 2 : x + 3].min(axis=2).max() > 220
        for x, y in (factor * steps[0].truth.corners).round().astype(int)
    ]
    assert sum(begins) >= 2  # the outlines hide others


@pytest.mark.wide
@pytest.mark.newest
def test_two_runs_are_beside_each_other_and_the_shorter_one_stands_still(tmp_path):
    moving = [*CHANGES, "tracker.kind=truth"]
    loaded = [servo.load("still", [*moving, f"run.duration={end}"]) for end in (0.3, 0.2)]
    notes = []
    with Episode(loaded[0]) as left, Episode(loaded[1]) as right:
        write_film_of_two((left, right), ("a", "b"), tmp_path / "a.mp4", notes.append)
    errors = np.array([re.findall(r"[\d.]+", note) for note in notes], float)
    assert [note.endswith(" px (ended)") for note in notes] == 6 * [False] + 3 * [True]
    np.testing.assert_array_equal(errors[:6, 0], errors[:6, 1])
    np.testing.assert_array_equal(errors[6:, 1], errors[5, 1])
    assert errors[5, 0] - errors[-1, 0] > 2
    pictures = [picture.image for picture in Video.of(tmp_path / "a.mp4")]
    width, height = PANEL_OF_TWO
    assert len(TITLE_OF_TWO) <= (pictures[0].shape[1] - OTHERS) // LETTER  # it is not cut
    assert (len(pictures), len(notes)) == (9, 9)
    assert pictures[0].shape == (HEAD + CAPTION + 2 * height + CHART, 3 * MARGIN + 2 * width, 3)
    first, second = (
        [picture[HEAD + CAPTION : -CHART, at : at + width].astype(int) for picture in pictures]
        for at in (MARGIN, 2 * MARGIN + width)
    )
    assert np.abs(first[5] - second[5]).mean() < 3
    assert np.abs(second[-1] - second[5]).mean() < 3
    assert np.abs(first[-1] - first[5]).mean() > 3


def test_films_of_two_need_one_rate(tmp_path):
    loaded = [servo.load("still", [*CHANGES, f"camera.rate={rate}"]) for rate in (30, 60)]
    differ = pytest.raises(
        Mistake,
        match=r"^film: the cameras have different rates, 30 and 60 Hz: give both the same camera.rate$",
    )
    with Episode(loaded[0]) as left, Episode(loaded[1]) as right, differ:
        write_film_of_two((left, right), ("a", "b"), tmp_path / "a.mp4", print)


def test_a_run_with_exact_is_repeated_so():
    given = film_command.scenario_to_repeat("still --exact --set run.duration=0.1")
    assert (given.camera.renderer, given.camera.textures) == ("exact", "fine")


def test_the_command_takes_words_of_run_and_folders(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    given = "still --set run.duration=0.1 --tracker frozen --controller hold --seed 3"
    (tmp_path / "done").mkdir()
    command = f"servobench run {given} --no-rerun"
    head = {"format": RunReport.FORMAT, "kind": RunReport.KIND, "command": command}
    monkeypatch.setattr(RunReport, "read", lambda path: SimpleNamespace(**head))
    asked = []
    monkeypatch.setattr(
        film_command,
        "Episode",
        lambda loaded: asked.append(loaded) or nullcontext(SimpleNamespace(frames=3)),
    )
    monkeypatch.setattr(film_command, "write_film_of_two", lambda *given: None)
    result = CliRunner().invoke(
        app, ["film", given, "done", "--out", "b.mp4"], catch_exceptions=False
    )
    assert (result.exit_code, result.output) == (0, "b.mp4\n")
    assert [loaded.run.seed for loaded in asked] == [3, 3]
    assert [loaded.run.duration for loaded in asked] == [0.1, 0.1]
    assert {kind_of(loaded.tracker) for loaded in asked} == {"frozen"}
    assert {kind_of(loaded.controller) for loaded in asked} == {"hold"}


@pytest.mark.parametrize("runs", [["still"], ["still", "line", "--seed"], []])
def test_a_film_is_of_two_runs(runs):
    result = CliRunner().invoke(app, ["film", "--", *runs])
    assert str(result.exception) == (
        f"film: give two runs, each in quotes if it has several words; {len(runs)} were given"
    )


def test_the_room_is_as_it_was_at_the_time_of_the_frame():
    """A step's bodies, drawn later, are the world's own geoms at that time."""
    with Episode(servo.load("line", [*CHANGES, "run.latency=0"])) as episode:
        world = episode.world
        view = RoomView(world.model, 160, 120)
        for step in episode:
            if step.frame.index == 3:
                break
        later = view.render(world.bodies())
        data = mujoco.MjData(world.model)
        data.qpos[:], data.mocap_pos[:] = world.data.qpos, world.data.mocap_pos
        data.mocap_quat[:] = world.data.mocap_quat
        mujoco.mj_forward(world.model, data)
        eye = world.model.camera(room_view.CAMERA).id
        data.cam_xpos[eye], data.cam_xmat[eye] = view._data.cam_xpos[eye], view._data.cam_xmat[eye]
        np.testing.assert_array_equal(later, view._renderer.begin(data)())
        assert (view.render(step.bodies) != later).any()
        view.close()


def test_a_picture_keeps_its_shape_in_its_panel():
    wide = panel(np.full((50, 200, 3), 9, np.uint8), 400, 400)
    assert (wide[:150] == wide[0, 0]).all()
    assert (wide[150:250] == 9).all()
    assert (panel(None, 8, 6) == 0).all()


def test_a_chart_grows_with_time_and_values_and_says_the_status():
    axes = Figure((6.4, 1.9)).add_subplot()
    chart = RunningChart(axes, Chart({"error": "#c23b2e"}, "distance [px]", end=2.0))
    grown = [chart.add(0.0, [3.0], ["LOCKED"]), chart.add(1.0, [float("nan")], ["UNSURE"])]
    assert grown == [False, False]
    assert (axes.get_xlim()[1], axes.get_ylim()[1]) == (2.0, 1.02 * 5.0)
    assert chart.add(2.5, [34.0], ["LOST"])
    assert (axes.get_xlim()[1], axes.get_ylim()[1]) == (3.0, 1.02 * 50.0)
    assert not chart.add(3.0, [34.0], ["LOST"])
    line, band = chart.artists
    np.testing.assert_array_equal(line.get_data(), [[0, 1, 2.5, 3], [3, np.nan, 34, 34]])
    # Frames of one status are one piece.
    assert [segment[:, 0].tolist() for segment in band.get_segments()] == [[0, 1], [1, 3]]
    colours = [STATUS_ON_WHITE[status] for status in ("UNSURE", "LOST")]
    np.testing.assert_array_equal(band.get_colors(), to_rgba_array(colours))


def test_two_runs_have_a_band_each():
    axes = Figure((6.4, 1.9)).add_subplot()
    chart = RunningChart(axes, Chart({"a": "#c23b2e", "b": "#c23b2e"}, "error [px]", end=2.0))
    chart.add(0.0, [1.0, 1.0], ["LOCKED", "LOCKED"])
    chart.add(1.0, [1.0, 1.0], ["LOCKED", "LOST"])
    _, _, band = chart.artists
    above, below = (segment[:, 1].tolist() for segment in band.get_segments())
    np.testing.assert_allclose([above, below], [[0.0525] * 2, [0.0175] * 2])
    colours = [STATUS_ON_WHITE[status] for status in ("LOCKED", "LOST")]
    np.testing.assert_array_equal(band.get_colors(), to_rgba_array(colours))


@pytest.mark.newest
def test_a_film_shows_its_curve_and_status(tmp_path):
    film = FilmPage(
        tmp_path / "a.mp4", 10.0, "title", ["one"], (640, 64), Chart({"c": "#c23b2e"}, "c", 2.0)
    )
    for k in range(21):
        film.add(
            k / 10, [np.zeros((64, 640, 3), np.uint8)], [4.0], ["LOST" if k > 10 else "LOCKED"], ""
        )
    film.close()
    first, *_, last = Video.of(tmp_path / "a.mp4")
    band = last.image[-BELOW - 5].astype(int)
    left, right = (band[LEFT + 20], band[-MARGIN - 20])
    np.testing.assert_allclose(left, [0x1F, 0x7A, 0x3A], atol=12)
    np.testing.assert_allclose(right, [0xC2, 0x3B, 0x2E], atol=12)
    curve = last.image[-CHART:, 400].astype(int)
    assert (np.abs(curve - [0xC2, 0x3B, 0x2E]).sum(axis=1) < 60).sum() >= 8  # curve and band
    status = (slice(0, HEAD), slice(-120, None))
    assert np.abs(first.image[status].astype(int) - last.image[status]).max() > 100


@pytest.mark.processes
@pytest.mark.parametrize("whole", [True, False])
def test_a_film_plays_in_a_browser(tmp_path, browser, whole):
    writer = VideoWriter(tmp_path / "a.mp4", 25.0, 1280, 720)
    for k in range(80):
        writer.add(np.full((720, 1280, 3), (200, 40, 90), np.uint8), k / 25)
    (writer.close if whole else writer.abandon)()
    page = tmp_path / "page.html"
    page.write_text("<video src='a.mp4' muted preload='auto'></video>")
    browser.get(page.as_uri())  # from a file, as a person opens it
    browser.set_script_timeout(PATIENCE)
    state, duration, seen = browser.execute_async_script("""
        const done = arguments[0], video = document.querySelector('video');
        video.onseeked = () => done([video.readyState, video.duration, video.currentTime]);
        video.onerror = () => done([video.error.message, 0, 0]);
        const last = () => { video.currentTime = video.duration - 0.01; };
        video.readyState < 1 ? video.onloadedmetadata = last : last();
    """)
    length = 3.2 if whole else 3.16  # without its last frame
    assert state >= 2
    assert (duration, seen) == pytest.approx((length, length), abs=0.05)
    drawn = np.frombuffer(browser.get_screenshot_as_png(), np.uint8)
    colour = cv2.imdecode(drawn, cv2.IMREAD_COLOR)[200, 200, ::-1]
    np.testing.assert_allclose(colour.astype(int), (200, 40, 90), atol=6)
