"""A camera that turns inside a recording: its pictures, its ways, and what is refused."""

import shutil
from dataclasses import replace
from fractions import Fraction
from importlib.resources import files
from itertools import pairwise, product

import av
import cv2
import mujoco
import numpy as np
import pytest
from filmed import as_folder, as_video, wide

from servo.cli.run_command import remarks
from servo.loop.episode import Episode
from servo.mistake import Mistake
from servo.scenario.load import load
from servo.scenario.named_files import digest_of
from servo.scenario.recording import recorded_of
from sim.camera.distortion import Distortion
from sim.camera.gl import is_there
from sim.geometry import exp_so3
from sim.recording.recorded import EYE, Recorded
from sim.recording.renderer import RecordingRenderer, seen_from
from sim.recording.room import room_in, turned
from sim.types import Camera

SECONDS = 1.0
FOCAL = 320 / np.tan(np.pi / 6)
"""That of 60 degrees over 640 pixels."""
RATE = 30.0
MOVES = ("motion.kind=wander", "motion.radius=0.26", "motion.period=4")
VIEW = Camera(300.0, 300.0, 160.0, 120.0, 320, 240)
TRUTH = ("tracker.kind=truth",)


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """A film of the table at twice the resolution of the views, as pictures."""
    folder = tmp_path_factory.mktemp("table")
    as_folder(folder, wide(1280, 2 * FOCAL, SECONDS, *MOVES))
    return folder


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A film of the table of twelve pictures."""
    folder = tmp_path_factory.mktemp("small")
    as_folder(folder, wide(640, FOCAL, 0.4, *MOVES))
    return folder


def run(name, *changes):
    with Episode(load(name, changes)) as episode:
        return list(episode)


def recorded(folder, *changes):
    return run("recording", f"recording.pictures={folder}", *changes)


@pytest.mark.wide
@pytest.mark.skipif(not is_there(), reason="OpenGL is missing: compares with its pictures")
@pytest.mark.parametrize("tracker", ["truth", "pf_ssd"])
def test_it_is_the_simulation_that_was_filmed(table, tracker):
    both = (f"tracker.kind={tracker}", f"camera.fx={FOCAL}", f"run.duration={SECONDS}")
    inside = recorded(table, *both)
    start = ("robot.kind=head", "goal.depth=2.0", "start.x=0", "start.y=0")
    simulated = run("line", *MOVES, *start, *both)
    assert len(inside) == len(simulated) == round(SECONDS * RATE)
    for one, other in zip(inside, simulated, strict=True):
        assert np.median(np.abs(one.frame.image.astype(int) - other.frame.image)) <= 2
        assert np.abs(one.truth.centre - other.truth.centre).max() < 0.5
        assert np.abs(one.posture.joints - other.posture.joints).max() * FOCAL < 0.5
    assert np.ptp([step.posture.joints for step in inside], axis=0).max() > np.radians(2)


def rendered(camera, picture, view, pan, tilt, later=()):
    """The view of a head inside the last picture of a recording, by default of one picture."""
    times = np.arange(1 + len(later)) / 10
    shown = list(zip(times, [picture, *later], strict=True))
    model = mujoco.MjModel.from_xml_path(str(files("scenes") / "robots" / "turning_head.xml"))
    data = mujoco.MjData(model)
    data.qpos[:] = pan, tilt
    data.time = times[-1]
    mujoco.mj_forward(model, data)
    corners = np.full((len(times), 4, 2), 100.0)
    recording = Recorded(camera, times, corners, lambda: iter(shown))
    renderer = RecordingRenderer(recording, model, "eye", view)
    image = renderer.begin(data)()
    renderer.close()
    return image


def smooth(height, width):
    """A picture whose grey levels change slowly, so that a wrong place shows as a wrong level."""
    noise = np.random.default_rng(4).integers(0, 256, (height // 40, width // 40, 3), np.uint8)
    return cv2.resize(noise, (width, height), interpolation=cv2.INTER_CUBIC)


LENSES = {
    "none": None,
    "plumb_bob": Distortion("plumb_bob", (-0.25, 0.08, 0.001, -0.002, 0.0)),
    "fisheye": Distortion("fisheye", (-0.02, 0.01, -0.003, 0.0005)),
}


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize(("pan", "tilt"), [(0.0, 0.0), (0.15, -0.1), (-0.12, 0.14)])
def test_its_pictures_are_opencvs(lens, pan, tilt):
    camera = Camera(540.0, 560.0, 330.0, 225.0, 640, 480, LENSES[lens])
    picture = smooth(480, 640)
    k_recording, k_view = (
        np.array([[c.fx, 0, c.cx - 0.5], [0, c.fy, c.cy - 0.5], [0, 0, 1.0]])
        for c in (camera, VIEW)
    )
    back = turned(pan, tilt).T
    size = VIEW.width, VIEW.height
    coefficients = np.array(LENSES[lens].coefficients if LENSES[lens] else np.zeros(5))
    maps = cv2.fisheye if lens == "fisheye" else cv2
    u, v = maps.initUndistortRectifyMap(k_recording, coefficients, back, k_view, size, cv2.CV_32FC1)
    expected = cv2.remap(picture, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    image = rendered(camera, picture, VIEW, pan, tilt)
    assert np.abs(image.astype(int) - expected).max() <= 2
    assert (np.abs(image.astype(int) - expected) > 1).mean() < 0.01


def test_an_unreadable_picture_is_replaced_by_the_one_before_it_a_first_one_by_black():
    camera = Camera(540.0, 560.0, 330.0, 225.0, 640, 480)
    seen = rendered(camera, smooth(480, 640), VIEW, 0.1, 0.0)
    again = rendered(camera, smooth(480, 640), VIEW, 0.1, 0.0, later=[None, None])
    np.testing.assert_array_equal(again, seen)
    assert np.ptp(seen) > 100
    black = rendered(camera, None, VIEW, 0.1, 0.0)
    np.testing.assert_array_equal(black, np.zeros((240, 320, 3)))


@pytest.mark.parametrize("lens", LENSES)
def test_in_its_ranges_the_view_never_leaves_the_recording(lens):
    camera = Camera(540.0, 560.0, 330.0, 225.0, 640, 480, LENSES[lens])
    pans, tilts = (np.radians(each) for each in room_in(camera, VIEW))
    u, v = np.meshgrid(np.linspace(0, 320, 33), np.linspace(0, 240, 25))
    rays = VIEW.normalise(np.stack([u, v], axis=-1))
    outside = []
    for pan in np.linspace(*pans, 9):
        for tilt in np.linspace(*tilts, 9):
            seen = seen_from(camera, turned(pan, tilt), rays)
            outside.append(max(-seen.min(), (seen - (640, 480)).max()))
    assert max(outside) < 0.1  # between the points of the border that were looked at
    assert max(outside) > -3.0  # the room is used
    assert room_in(Camera(540.0, 560.0, 160.0, 120.0, 320, 239), VIEW) is None


def test_the_corners_of_the_view_stay_in_the_recording():
    """They are no multiple of a number of pixels from the first one."""
    camera = Camera(1000.0, 1000.0, 830.0, 470.0, 1760, 1057)
    view = Camera(340.0, 340.0, 186.0, 73.0, 363, 184)
    pans, tilts = (np.radians(each) for each in room_in(camera, view))
    rays = view.normalise(np.array([[0, 0], [363, 0], [0, 184], [363, 184]]))
    for pan, tilt in product(pans, tilts):
        seen = seen_from(camera, turned(pan, tilt), rays)
        assert max(-seen.min(), (seen - (1760, 1057)).max()) < 0.1


def test_a_head_turns_right_and_up():
    right = turned(0.1, 0.0) @ (0, 0, 1)
    up = turned(0.0, 0.1) @ (0, 0, 1)
    assert right[0] > 0.09
    assert up[1] < -0.09  # y is down
    np.testing.assert_allclose(EYE.rotation @ (0, 0, 1), (0, 0, -1))
    np.testing.assert_allclose(
        turned(0.2, 0.3), exp_so3(np.array([0, 0.2, 0])) @ exp_so3(np.array([0.3, 0, 0]))
    )


def test_a_large_recording_is_averaged_before_pixels_are_skipped():
    rng = np.random.default_rng(7)
    picture = rng.integers(0, 256, (960, 1280, 3), np.uint8)
    camera = Camera(1200.0, 1200.0, 640.0, 480.0, 1280, 960)
    image = rendered(camera, picture, VIEW, 0.0, 0.0)
    assert image.std() < picture.std() / 3  # of noise a mean of 4 x 4 pixels leaves a quarter


def test_the_truth_of_the_recording_is_that_of_the_run(small):
    steps = recorded(small, *TRUTH)
    given = np.loadtxt(small / "groundtruth.txt", delimiter=",").reshape(-1, 4, 2)
    for step, corners in zip(steps, given, strict=True):
        turn = EYE.rotation.T @ step.truth.T_world_camera.rotation
        wide_camera = Camera(FOCAL, FOCAL, 320.0, 240.0, 640, 480)
        camera = step.scene.camera
        middle = seen_from(wide_camera, turn, camera.normalise(step.truth.centre))
        np.testing.assert_allclose(middle, corners.mean(axis=0), atol=1e-6)
        assert step.truth.visible == 1.0


def test_a_target_that_turns_and_grows_has_its_outline_in_each_picture(small, tmp_path):
    sides = np.array([[-30, -20], [30, -20], [30, 20], [-30, 20]]) / 2
    angles = 0.3 + 0.2 * np.arange(12)
    turns = [[[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]] for a in angles]
    growth = 1.06 ** np.arange(12)
    outlines = (300, 220) + growth[:, None, None] * (sides @ np.array(turns))
    truth = tmp_path / "truth.txt"
    np.savetxt(truth, outlines.reshape(12, 8), "%.6f", ",")
    recording = Camera(FOCAL, FOCAL, 320.0, 240.0, 640, 480)
    for step, outline in zip(
        recorded(small, f"recording.truth={truth}", *TRUTH), outlines, strict=True
    ):
        turn = EYE.rotation.T @ step.truth.T_world_camera.rotation
        seen = seen_from(recording, turn, step.scene.camera.normalise(step.truth.corners))
        np.testing.assert_allclose(seen, outline, atol=1e-4)


def test_it_is_blind_where_the_target_is_absent(small, tmp_path):
    lines = (small / "groundtruth.txt").read_text().splitlines()
    lines[4] = "nan,nan,nan,nan,nan,nan,nan,nan"
    lines[5] = "10,10,40,10,40,10,10,10"  # without an area
    truth = tmp_path / "truth.txt"
    truth.write_text("\n".join(lines))
    steps = recorded(small, f"recording.truth={truth}", *TRUTH)
    assert [step.truth.visible for step in steps] == [1, 1, 1, 1, 0, 0, *[1] * 6]
    still = [step.truth.T_world_target.translation for step in steps[3:6]]
    np.testing.assert_array_equal(still[0], still[2])


def test_a_camera_that_is_faster_sees_each_picture_twice(small):
    steps = recorded(small, "camera.rate=60", "robot.lag_ms=500", *TRUTH)
    assert len(steps) == 24
    places = [step.truth.T_world_target.translation for step in steps]
    for one, other in zip(places[::2], places[1::2], strict=True):
        np.testing.assert_array_equal(one, other)
    assert all((a != b).any() for a, b in zip(places[::2], places[2::2], strict=False))


def test_a_video_gives_its_own_times(tmp_path):
    path = tmp_path / "v.mp4"
    as_video(path, wide(640, FOCAL, 0.4, *MOVES, "camera.rate=25"))
    scenario = load("recording", [f"recording.pictures={path}"])
    assert (scenario.camera.rate, scenario.frames) == (25.0, 10)
    with Episode(scenario) as episode:
        assert len(list(episode)) == 10


def test_the_first_target_is_in_the_middle_as_far_as_the_recording_reaches(small, tmp_path):
    truth = tmp_path / "truth.txt"
    truth.write_text("\n".join(["10,10,30,20"] * 12))  # in the upper left corner
    places = f"recording.truth={truth}", "recording.truth_format=vot"
    first, *_ = recorded(small, *places, *TRUTH)
    assert (first.truth.centre < (40, 40)).all()
    assert (first.truth.centre > 0).all()
    assert recorded(small, *TRUTH)[0].servo_error < 0.2


SENTENCES = {
    "no truth": (["recording.pictures={alone}"], "{alone}: there is no truth file in it or beside"),
    "no such folder": (["recording.pictures=gone"], "recording.pictures = 'gone': no file of this"),
    "an unreadable first picture": (
        ["recording.pictures={cut}"],
        "{cut}: the first picture cannot be read (this picture cannot be decoded; known formats "
        "are JPEG, PNG, BMP, TIFF, WebP, PPM): leave out the pictures and lines before the first",
    ),
    "a short truth": (["recording.truth={short}"], "{short}: this truth has 3 lines for 12 pict"),
    "absent at first": (["recording.truth={absent}"], "{absent}: the target is not in the first"),
    "a large view": (
        ["camera.width=1000", "camera.height=700"],
        "the view of 1000 x 700 px reaches beyond the recording: set a longer focal length (a larger",
    ),
    "a longer run": (["run.duration=3"], "run.duration = 3 s is too long: set at most 0.4 s"),
    "another robot": (["robot.kind=arm"], "in a recording the camera can only turn: leave"),
    "a motion": (["motion.kind=line"], "the recording gives the motion: leave [motion] out"),
    "depth": (["camera.depth=true"], "camera.depth: a recording has no depth pictures"),
    "a standing camera": (["camera.mounted=world"], "camera.mounted: in a recording the robot"),
    "two lenses": (
        ["recording.fov_deg=50", "recording.calibration=x.yaml"],
        "fov_deg and calibration both give the lens; leave one out",
    ),
    "a stream": (["recording.pictures=rtsp://a/b"], "a camera or stream cannot be read again"),
    "a truth in doubt": (
        ["recording.truth={doubt}"],
        "give the format of this truth: otb, vot or tld (--truth-format, or truth_format in a suite "
        "or in [recording])",
    ),
    "a broken video": (
        ["recording.pictures={broken}.mp4"],
        "{broken}.mp4: this is not a video that can be read (FFmpeg: moov atom not found)",
    ),
    "a first outline without area": (
        ["recording.truth={flat}"],
        "{flat}: the target's outline in the first picture has no area: correct it",
    ),
    "a duration in words": (["run.duration=long"], "run.duration should be a number of seconds"),
    "a section that is no table": (["run=3"], "run should be a table of settings, not 3"),
    "a video that breaks off": (
        ["recording.pictures={broken}.avi"],
        "{broken}.avi: this recording breaks off after 1 of 12 pictures: leave out the rest of the",
    ),
}


@pytest.mark.parametrize("case", SENTENCES)
def test_what_cannot_be_is_refused_in_a_sentence(small, tmp_path, case):
    places = {
        name: tmp_path / name
        for name in ("alone", "short", "absent", "doubt", "flat", "broken", "cut")
    }
    places["alone"].mkdir()
    for picture in small.glob("*.png"):
        (places["alone"] / picture.name).symlink_to(picture)
    lines = (small / "groundtruth.txt").read_text().splitlines()
    places["short"].write_text("\n".join(lines[:3]))
    places["absent"].write_text("\n".join(["nan,nan,nan,nan", *lines[1:]]))
    places["flat"].write_text("\n".join(["10,10,40,10,40,10,10,10", *lines[1:]]))
    places["doubt"].write_text("\n".join(["10,10,30,20"] * 12))
    if "picture" in case:
        shutil.copytree(small, places["cut"])
        (places["cut"] / "00000.png").write_bytes(b"no picture")
    if "video" in case:
        for path in (tmp_path / "broken.mp4", tmp_path / "broken.avi"):
            as_video(path, wide(320, FOCAL / 2, 0.4, *MOVES))
            whole = path.read_bytes()
            path.write_bytes(whole[: len(whole) * 2 // 3])
    names = {name: str(path) for name, path in places.items()}
    changes, sentence = SENTENCES[case]
    given = [f"recording.pictures={small}", *(change.format(**names) for change in changes)]
    with pytest.raises(Mistake) as refused:
        load("recording", given)
    assert sentence.format(**names) in str(refused.value)


def test_what_is_assumed_is_said(small):
    assert load("still").recording.remarks(FOCAL) == []
    assert load("recording").recording.remarks(FOCAL) == []
    config = load("recording", [f"recording.pictures={small}"]).recording
    assert replace(config, fov_deg=60.0).remarks(FOCAL) == []
    assert config.remarks(FOCAL) == [
        "the recording's field of view is taken to be 60 deg: set recording.fov_deg or "
        "recording.calibration"
    ]


def test_a_small_recording_is_enlarged(tmp_path):
    as_folder(tmp_path, wide(320, FOCAL / 2, 0.2, *MOVES))
    scenario = load("recording", [f"recording.pictures={tmp_path}", "recording.fov_deg=60"])
    assert scenario.recording.remarks(scenario.camera.fx) == [
        "the recording has 320 x 240 px: its pictures are enlarged 2 times"
    ]
    assert scenario.recording.remarks(FOCAL / 2) == []  # the user's own focal length
    assert scenario.camera.fx == pytest.approx(FOCAL, rel=1e-3)
    assert recorded(tmp_path, *TRUTH)[0].frame.image.shape == (240, 320, 3)


def test_a_calibration_gives_lens_and_centre(small, tmp_path):
    path = tmp_path / "c.yaml"
    path.write_text(
        "image_width: 640\nimage_height: 480\ncamera_matrix: {rows: 3, cols: 3, data: "
        "[540, 0, 329.5, 0, 560, 224.5, 0, 0, 1]}\ndistortion_model: plumb_bob\n"
        "distortion_coefficients: {rows: 1, cols: 5, data: [-0.2, 0.05, 0, 0, 0]}\n"
    )
    places = f"recording.pictures={small}", f"recording.calibration={path}"
    scene = tmp_path / "mine.toml"
    scene.write_text('[tracker]\nkind = "truth"\n')
    steps = run(str(scene), *places)
    given = np.loadtxt(small / "groundtruth.txt", delimiter=",").reshape(-1, 4, 2)
    camera = Camera(
        540.0, 560.0, 330.0, 225.0, 640, 480, Distortion("plumb_bob", (-0.2, 0.05, 0, 0, 0))
    )
    for step, corners in zip(steps, given, strict=True):
        turn = EYE.rotation.T @ step.truth.T_world_camera.rotation
        middle = seen_from(camera, turn, step.scene.camera.normalise(step.truth.centre))
        expected = camera.to_pixels(camera.normalise(corners).mean(axis=0))
        np.testing.assert_allclose(middle, expected, atol=1e-6)
    beside = tmp_path / "film"
    shutil.copytree(small, beside)
    shutil.copy(path, beside / "camera.yaml")
    found = load(str(scene), [f"recording.pictures={beside}"]).recording
    assert recorded_of(found).camera == camera
    assert recorded_of(replace(found, fov_deg=60.0)).camera.fx == pytest.approx(FOCAL)
    path.write_text(path.read_text().replace("640", "800"))
    with pytest.raises(Mistake, match="this calibration is for 800 x 480 px"):
        load(str(scene), places)


def test_other_pictures_or_another_truth_are_another_recording(small, tmp_path):
    folder = tmp_path / "r"
    shutil.copytree(small, folder)
    before = digest_of(str(folder))
    path = folder / "groundtruth.txt"
    path.write_text(path.read_text().replace("1", "2", 1))
    between = digest_of(str(folder))
    (folder / "00003.png").write_bytes((folder / "00004.png").read_bytes())
    assert len({before, between, digest_of(str(folder))}) == 3


def test_a_scenario_finds_its_folder_beside_it(small, tmp_path, monkeypatch):
    shutil.copytree(small, tmp_path / "film")
    (tmp_path / "mine.toml").write_text('[recording]\npictures = "film"\n')
    monkeypatch.chdir(small)
    assert load(str(tmp_path / "mine.toml")).frames == 12


def test_what_is_not_drawn_has_no_effect_and_that_is_said(small):
    changes = [f"recording.pictures={small}", "clutter.number=3", "ground.kind=carpet"]
    changes.append("camera.renderer=exact")
    with Episode(load("recording", changes)) as episode:
        said = remarks(episode)
    because = "the pictures are those of a recording, in which nothing is drawn"
    for name in ("clutter.number", "ground.kind", "camera.renderer"):
        assert f"{name} has no effect: {because}" in said


def test_the_same_seed_gives_the_same_pictures(small):
    one, other = recorded(small, "tracker.kind=kams"), recorded(small, "tracker.kind=kams")
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a.frame.image, b.frame.image)
        assert a.estimate.state == b.estimate.state


def test_a_picture_stays_until_the_next_whatever_the_times(small, tmp_path):
    """A video whose pictures are 40, 40, 120, 40 ... ms apart."""
    ticks = np.cumsum([0, 1, 1, 3, 1, 1, 1, 1, 1, 1, 1, 1])
    path = tmp_path / "v.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", 25)
        stream.width, stream.height, stream.pix_fmt = 640, 480, "yuv420p"
        for tick, file in zip(ticks.tolist(), sorted(small.glob("*.png")), strict=True):
            frame = av.VideoFrame.from_ndarray(cv2.imread(str(file)), "bgr24")
            frame.pts, frame.time_base = tick, Fraction(1, 25)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    shutil.copy(small / "groundtruth.txt", path.with_suffix(".txt"))
    scenario = load("recording", [f"recording.pictures={path}", *TRUTH])
    np.testing.assert_allclose(recorded_of(scenario.recording).times, ticks / 25)
    assert (scenario.camera.rate, scenario.frames) == (25.0, 14)
    with Episode(scenario) as episode:
        places = [step.truth.T_world_target.translation for step in episode]
    same = [bool((a == b).all()) for a, b in pairwise(places)]
    assert same == [False, False, True, True, *[False] * 9]


def test_a_folder_has_the_rate_that_is_set(small):
    scenario = load("recording", [f"recording.pictures={small}", "recording.rate=20"])
    assert (scenario.camera.rate, scenario.frames) == (20.0, 12)


def test_a_wider_recording_leaves_the_head_more_room(small):
    narrow, wide_one = (
        load("recording", [f"recording.pictures={small}", f"recording.fov_deg={fov}"])
        for fov in (40, 80)
    )
    assert wide_one.robot.pan[1] > 1.4 * narrow.robot.pan[1]
    assert wide_one.camera.fx < narrow.camera.fx
