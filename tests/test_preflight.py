"""A robot's log against the film of its camera: offset, mount, mistakes, refusals, the twin."""

import csv
import re
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from hidden_robot import CAMERA, SIZE, Film, Robot, played
from rerun.chunk import RrdReader
from scipy.spatial.transform import Rotation

from servo.cli.main import app
from servo.scenario.load import load
from servo.twin.compare import compare
from servo.twin.corrections import Kind, Smooth
from servo.twin.corrections import motion as motion_of
from servo.twin.robot_motion import REACH, of_twists, smoothed
from servo.twin.tracks import Tracks
from servo.twin.verdict import Trust, cubes
from servo.twin.wiggle import rates
from tracking.drawing.video_writer import VideoWriter

ROBOT = Robot(0.06, Rotation.from_rotvec([0.2, -0.1, 0.3]), np.array([0.02, -0.03, 0.01]))
SECONDS = 14.0
POINTS = 40


def points(film):
    """The points of a film, as exact as 0.2 px, without a picture."""
    times = np.arange(round(film.seconds * 15)) / 15
    R, t = film.pose(times)
    rng = np.random.default_rng(0)
    first = np.repeat(np.arange(len(times) - 3), 2)
    second = first + np.tile([1, 3], len(times) - 3)
    before = CAMERA.normalise(rng.uniform(0, SIZE, (len(first), POINTS, 2)))
    rays = np.insert(before, 2, 1.0, axis=2) @ R[first].transpose(0, 2, 1)
    places = t[first][:, None] - rays * (t[first][:, None, 2:] / rays[..., 2:])
    seen = (places - t[second][:, None]) @ R[second]
    after = seen[..., :2] / seen[..., 2:] + rng.normal(0, 0.2 / CAMERA.fx, before.shape)
    known = np.ones(before.shape[:2], bool)
    return Tracks(times, first, second, before, after, known, CAMERA.fx, 0.0, [], SIZE, [])


def smooth(film, spoil=lambda v: v, robot=ROBOT):
    times, poses = robot.log(film)
    return Smooth(Kind.POSES, *smoothed(times, spoil(poses)), ())


def compared(film, spoil=lambda v: v, tracks=None):
    trust = Trust(focal=True)
    return compare(smooth(film, spoil), tracks or points(film), trust, lambda _: None)


def test_offset_and_mount_are_inside_their_intervals():
    found = compared(Film(3, SECONDS))
    errors = ROBOT.errors(found.fits.mount)
    assert np.all(abs(errors) < found.fits.mount.halves[:7]), errors
    assert abs(errors[0]) < 1e-3
    assert np.degrees(found.fits.mount.halves[1:4].max()) < 1.0
    assert found.verdict.is_good, found.verdict.findings
    assert abs(found.fits.offset.value - ROBOT.offset) < found.fits.offset.half


@pytest.mark.wide
def test_a_mistake_is_named_with_what_to_change_and_the_mount_is_found_all_the_same():
    found = compared(Film(3, SECONDS), lambda v: v * (-1000, 1000, 1000, 1, 1, 1, 1))
    names = [each.found for each in found.verdict.findings if each.what == "mistake"]
    assert names == ["the sign of x of the position is wrong", "lengths are in millimetres"]
    assert "over 1000" in found.verdict.findings[1].change
    assert np.degrees(abs(ROBOT.errors(found.fits.mount)[1:4])).max() < 0.5


@pytest.mark.wide
def test_a_mirrored_film_and_slides_of_the_other_sign_are_the_same_without_a_mount():
    film = Film(3, SECONDS)
    tracks = points(film)
    flipped = replace(tracks, before=tracks.before * (-1, 1), after=tracks.after * (-1, 1))
    found = compared(film, tracks=flipped)
    [tie] = [each.found for each in found.verdict.findings if each.what == "mistake"]
    assert tie.startswith("cannot tell (the film is mirrored) from (")
    assert not found.verdict.has_rotation


FIXED = Rotation.from_rotvec([0.5, -0.4, 0.8])
"""How the hand is turned in the base when the log begins."""


def in_frames(of_v, of_w, begin=FIXED, seconds=SECONDS):
    """A log of twists whose parts are in the hand's or the base's frame."""
    film = Film(3, seconds)
    quiet = replace(ROBOT, position_noise=0.0, turn_noise=0.0, jitter=0.0)
    motion = motion_of(smooth(film, robot=quiet))
    times = motion.times[:-1]
    turns, _ = motion.at(times)
    base = begin * Rotation.from_matrix(turns[0].T @ turns)
    parts = np.split(motion.twists(times, motion.times[1:]), 2, axis=1)
    values = np.hstack(
        [base.apply(x) if of == "base" else x for of, x in zip((of_v, of_w), parts, strict=True)]
    )
    return compare(
        Smooth(Kind.TWISTS, times, values, ()), points(film), Trust(focal=True), lambda _: None
    )


@pytest.mark.wide
@pytest.mark.parametrize(("of_v", "of_w"), [("base", "hand"), ("hand", "base")])
def test_parts_of_a_twist_in_two_frames_are_named_and_no_mount_is_claimed(of_v, of_w):
    verdict = in_frames(of_v, of_w).verdict
    [mistake] = [each.found for each in verdict.findings if each.what == "mistake"]
    assert f"v is in the {of_v}'s frame, and w in the {of_w}'s" in mistake
    assert verdict.offset is not None
    assert not verdict.has_rotation


@pytest.mark.wide
def test_a_small_turn_between_the_frames_of_a_twist_is_no_mount_either():
    verdict = in_frames("base", "hand", Rotation.from_rotvec([0.15, 0, 0]), 24.0).verdict
    [mistake] = [each.found for each in verdict.findings if each.what == "mistake"]
    assert mistake.startswith("the hand's slides are turned against its turns by ")
    assert not verdict.has_rotation


@pytest.mark.wide
def test_twists_in_one_frame_are_clean_or_named_as_the_base_s():
    assert in_frames("hand", "hand").verdict.is_good
    assert in_frames("base", "base").verdict.mistakes == ["v and w are in the base's frame"]


@pytest.mark.wide
@pytest.mark.parametrize("angle", [0.2, 1.0])
def test_a_position_in_a_frame_of_its_own_is_no_mount(angle):
    def turned(poses):
        return np.hstack([Rotation.from_rotvec([0, angle, 0]).apply(poses[:, :3]), poses[:, 3:]])

    verdict = compared(Film(3, 24.0), turned).verdict
    assert len(verdict.mistakes) == 1
    assert not verdict.has_rotation


@pytest.mark.wide
def test_a_position_that_alone_is_inverse_is_named():
    def inverse(poses):
        place = -Rotation.from_quat(poses[:, 3:]).inv().apply(poses[:, :3])
        return np.hstack([place, poses[:, 3:]])

    assert compared(Film(3, SECONDS), inverse).verdict.mistakes == [
        "the position is that of the base in the hand's frame, the orientation is not inverse"
    ]


@pytest.mark.wide
@pytest.mark.parametrize(
    ("moves", "has"),
    [((1, 0, 0, 0, 0, 0), (False, False)), ((1, 1, 1, 0, 0, 0), (True, False))],
)
def test_motion_that_does_not_show_a_mount_is_refused(moves, has):
    verdict = compared(Film(3, SECONDS, moves=moves)).verdict
    assert (verdict.has_rotation, verdict.has_lever) == has
    assert not verdict.is_good


@pytest.mark.wide
def test_a_film_of_another_motion_shows_no_offset():
    found = compared(Film(3, SECONDS), tracks=points(Film(4, SECONDS)))
    assert found.verdict.offset is None
    assert not found.verdict.has_rotation
    assert "depth of the curve" in found.verdict.findings[0].found


def test_smoothing_keeps_a_parabola_and_twists_add_up_to_poses():
    times = np.sort(np.random.default_rng(0).uniform(0, 2, 200))
    grid, values = smoothed(times, np.stack([times**2, 3 * times], axis=1))
    inside = (grid > REACH) & (grid < 2 - REACH)
    np.testing.assert_allclose(values[inside, 0], grid[inside] ** 2, atol=1e-9)
    turning = np.tile([0.1, 0, 0, 0, 0, np.pi / 2], (201, 1))
    moved = of_twists(np.arange(201) * 0.005, turning)
    R, t = moved.at(np.array([1.0]))
    np.testing.assert_allclose(R[0], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-3)
    np.testing.assert_allclose(t[0], [0.2 / np.pi, 0.2 / np.pi, 0], atol=1e-3)


def test_the_wiggle_ends_where_it_began_and_there_are_24_turns_by_right_angles():
    times, values = rates(("m", "rad"))
    assert times[-1] == 30
    np.testing.assert_allclose(values.sum(axis=0), 0, atol=1e-9)
    assert abs(values[[0, -1]]).max() < 2e-3
    assert len({turn.tobytes() for turn in cubes()}) == 24


@pytest.mark.wide
def test_the_wiggle_of_a_robot_is_a_file_of_its_joints(tmp_path):
    path = tmp_path / "wiggle.csv"
    done = CliRunner().invoke(app, ["preflight", "--wiggle", str(path), "--scenario", "line"])
    assert done.exit_code == 0, done.output
    head, first, *_ = csv.reader(path.read_text().splitlines())
    assert head[:2] == ["time_s", "command_x_m_s"]
    assert len(head) == len(first) == 7


@pytest.mark.wide
def test_a_small_recording_becomes_a_page_and_a_scenario_that_runs(tmp_path):
    pictures, rows = played(["robot.lag_ms=40"], 14.0)
    film = VideoWriter(tmp_path / "film.mp4", 30, *SIZE)
    for picture in pictures:
        film.add(picture.image, picture.time)
    film.close()
    with (tmp_path / "log.csv").open("w") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    words = [tmp_path / "log.csv", tmp_path / "film.mp4", "--fov", "57.82", "--on", "still"]
    out = tmp_path / "twin"
    done = CliRunner().invoke(app, ["twin", *map(str, words), "--no-replay", "--out", str(out)])
    assert done.exit_code in (0, 1), done.output
    assert "clock offset" in done.output
    assert re.search(r"commands +ok +followed \d+ ms later", done.output)
    assert f"ready. Next: servobench tune {out / 'twin.toml'}" in done.output.replace("\n", "")
    scenario = load(out / "twin.toml")
    assert scenario.robot.lag_ms == pytest.approx(40, abs=12)
    assert scenario.camera.fx == pytest.approx(289.7, abs=0.5)
    assert abs(scenario.believed.clock_offset_ms) < 8
    page = (out / "report.html").read_text()
    assert page.count("<section") == 1
    assert "--no-replay" in page
    assert sorted(path.name for path in out.iterdir()) == ["report.html", "twin.toml"]


@pytest.mark.wide
def test_a_bag_is_log_and_film_and_its_replay_is_a_recording_for_rerun(tmp_path):
    bags = pytest.importorskip("bags", reason="rosbags and mcap are not installed")
    pictures, rows = played(["robot.lag_ms=40"], 14.0)
    frames = [(bags.START + each.time, each.image[..., ::-1]) for each in list(pictures)[::3]]

    def images(store):
        return [(time, bags.COMPRESSED, bags.jpeg(store, time, image)) for time, image in frames]

    def made(store, name, header, row, begin, linear, angular):
        kinds = store.types
        parts = (
            kinds[f"geometry_msgs/msg/{kind}"](**{x[-1]: row[f"{begin}_{x}{unit}"] for x in names})
            for kind, names, unit in (linear, angular)
        )
        whole = kinds[f"geometry_msgs/msg/{name}"](*parts)
        return kinds[f"geometry_msgs/msg/{name}Stamped"](header, whole)

    def messages(name, *parts):
        def make(store):
            for row in rows:
                time = bags.START + row["time_s"]
                header = bags.header(store, time)
                yield (
                    time,
                    f"geometry_msgs/msg/{name}Stamped",
                    made(store, name, header, row, *parts),
                )

        return lambda store: list(make(store))

    turn = "Quaternion", ("qx", "qy", "qz", "qw"), ""
    topics = {
        "/eye": images,
        "/hand": messages("Pose", "camera", ("Point", "xyz", "_m"), turn),
        "/go": messages(
            "Twist",
            "command",
            ("Vector3", ("vx", "vy", "vz"), "_m_s"),
            ("Vector3", ("wx", "wy", "wz"), "_rad_s"),
        ),
    }
    path = bags.write(tmp_path / "log_db3", topics)
    out = tmp_path / "twin"
    words = ["twin", str(path), "--fov", "57.82", "--on", "still", "--out", str(out)]
    done = CliRunner().invoke(app, words)
    assert done.exit_code in (0, 1), done.output
    assert load(out / "twin.toml").robot.lag_ms == pytest.approx(40, abs=12)
    assert (out / "replay.mp4").stat().st_size > 10_000
    seen = set()
    for chunk in RrdReader(str(out / "replay.rrd")).stream():
        batch = chunk.to_record_batch()
        seen |= {(chunk.entity_path, name) for name in batch.schema.names}
    pictures = {(f"/{name}", "EncodedImage:blob") for name in ("recorded", "drawn", "difference")}
    assert pictures | {("/plots/difference", "Scalars:scalars")} <= seen
