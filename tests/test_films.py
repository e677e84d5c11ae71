"""Films: what they show and when, what a kill leaves of them, and that browsers play them."""

import av
import cv2
import mujoco
import numpy as np
import pytest
from commands import PATIENCE
from matplotlib.colors import to_rgba_array
from matplotlib.figure import Figure

import servo
from servo.loop.episode import Episode
from servo.output import room_view
from servo.output.film import PANEL, write_film
from servo.output.room_view import RoomView
from tracking.drawing.colours import GOAL, STATUS_ON_WHITE
from tracking.drawing.film_page import BELOW, CAPTION, CHART, HEAD, LEFT, MARGIN, FilmPage, panel
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


def test_what_is_not_finished_can_be_played_but_for_a_second(tmp_path):
    writer = VideoWriter(tmp_path / "a.mp4", 10.0, 64, 48)
    for k in range(35):
        writer.add(np.full((48, 64, 3), 7 * k, np.uint8), k / 10)
    writer.abandon()
    assert times_of(tmp_path / "a.mp4") == pytest.approx([k / 10 for k in range(30)])


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
    assert np.abs(pictures[:, -MARGIN - width : -MARGIN].astype(int) - expected).mean() < 3
    factor = width / steps[-1].frame.image.shape[1]
    corner = (steps[-1].goal_corners[1] * factor).round().astype(int)
    near = pictures[corner[1] - 2 : corner[1] + 3, MARGIN + corner[0] - 2 : MARGIN + corner[0] + 3]
    assert np.abs(near.astype(int) - GOAL).sum(axis=2).min() < 60


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
    grown = [chart.add(0.0, [3.0], "LOCKED"), chart.add(1.0, [float("nan")], "UNSURE")]
    assert grown == [False, False]
    assert (axes.get_xlim()[1], axes.get_ylim()[1]) == (2.0, 1.02 * 5.0)
    assert chart.add(2.5, [34.0], "LOST")
    assert (axes.get_xlim()[1], axes.get_ylim()[1]) == (3.0, 1.02 * 50.0)
    assert not chart.add(3.0, [34.0], "LOST")
    line, band = chart.artists
    np.testing.assert_array_equal(line.get_data(), [[0, 1, 2.5, 3], [3, np.nan, 34, 34]])
    assert [segment[:, 0].tolist() for segment in band.get_segments()] == [
        [0, 1],
        [1, 2.5],
        [2.5, 3],
    ]
    colours = [STATUS_ON_WHITE[status] for status in ("UNSURE", "LOST", "LOST")]
    np.testing.assert_array_equal(band.get_colors(), to_rgba_array(colours))


@pytest.mark.newest
def test_a_film_shows_its_curve_and_status(tmp_path):
    film = FilmPage(
        tmp_path / "a.mp4", 10.0, "title", ["one"], (640, 64), Chart({"c": "#c23b2e"}, "c", 2.0)
    )
    for k in range(21):
        film.add(
            k / 10, [np.zeros((64, 640, 3), np.uint8)], [4.0], "LOST" if k > 10 else "LOCKED", ""
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
    length = 3.2 if whole else 3.0
    assert state >= 2
    assert (duration, seen) == pytest.approx((length, length), abs=0.05)
    drawn = np.frombuffer(browser.get_screenshot_as_png(), np.uint8)
    colour = cv2.imdecode(drawn, cv2.IMREAD_COLOR)[200, 200, ::-1]
    np.testing.assert_allclose(colour.astype(int), (200, 40, 90), atol=6)
