"""Depth pictures: where surfaces are, in what a sensor reports of them, and what it leaves out."""

from itertools import pairwise
from pathlib import Path

import cv2
import gymnasium
import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from servo import Episode, Mistake, load
from servo.loop.step import Step
from servo.output.mcap_file import RunMcap
from servo.output.recording.destination import RecordingFile
from servo.output.recording.log import RerunLog
from sim.camera.camera import CameraConfig
from sim.camera.depth_sensor import DepthSensor
from sim.camera.distortion import Distortion
from sim.camera.lens import Lens
from sim.channels import Channel, View
from sim.types import Camera
from tracking.drawing.picture_bytes import encoded_depth

RENDERERS = ("opengl", "exact")
LENSES = {
    "pinhole": (),
    "supersampled": ("camera.supersample=2",),
    "distorted": ("camera.distortion=plumb_bob", "camera.coefficients=[-0.3, 0.1, 0, 0, 0]"),
}
TILTED = ("robot.kind=free", "start.tilt_deg=50", "start.tilt_towards_deg=30", "target.kind=plate")
UNDER = 0.002
"""The plate's reference rectangle is its surface [m]."""


def first(*settings: str) -> Step:
    """The first step of a scenario with a depth picture."""
    with Episode(load("still", ["camera.depth=true", *settings])) as episode:
        return episode.look()


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("renderer", RENDERERS)
def test_depths_are_those_of_the_true_plane(renderer: str, lens: str) -> None:
    step = first(f"camera.renderer={renderer}", *LENSES[lens], *TILTED)
    depth = step.frame.depth
    camera = step.scene.camera
    assert depth is not None
    assert depth.shape == (240, 320)
    assert depth.dtype == np.float32
    corners = step.truth.corners
    inner = corners.mean(axis=0) + 0.9 * (corners - corners.mean(axis=0))
    mask = np.zeros(depth.shape, np.uint8)
    cv2.fillConvexPoly(mask, inner.astype(np.int32), 1)
    v, u = np.nonzero(mask)
    T_camera_target = step.truth.T_world_camera.inverse() @ step.truth.T_world_target
    normal = T_camera_target.rotation[:, 2]
    point = T_camera_target.apply(np.array([0.0, 0.0, UNDER]))
    rays = np.column_stack([camera.normalise(np.stack([u, v], 1) + 0.5), np.ones(len(u))])
    true = normal @ point / (rays @ normal)
    assert len(u) > 1000
    assert np.ptp(true) > 0.1
    # From pixel to pixel the depth changes by 3 mm. A supersampled pixel's depth is that of a place
    # a quarter of a pixel off, a distorted one's that of the nearest pixel of the view.
    tolerance = {"pinhole": 1e-5, "supersampled": 1.5e-3, "distorted": 3e-3}[lens]
    assert np.abs(depth[v, u] - true).max() < tolerance


def test_both_renderers_give_the_same_depths() -> None:
    one, other = (first(f"camera.renderer={r}").frame.depth for r in RENDERERS)
    assert one is not None
    assert other is not None
    assert np.mean(np.abs(one - other) < 1e-3) > 0.999  # pixels on edges may differ


def test_the_sky_has_no_depth() -> None:
    high = ("robot.kind=free", "start.tilt_deg=70", "camera.depth_farthest=1000")
    one, other = (first(f"camera.renderer={r}", *high).frame.depth for r in RENDERERS)
    assert one is not None
    assert other is not None
    assert 0.1 < np.isnan(one).mean() < 0.5
    assert np.mean(np.isnan(one) == np.isnan(other)) > 0.999


def test_a_lens_mixes_no_depths() -> None:
    lens = Lens(
        Camera(
            200.0,
            200.0,
            160.0,
            120.0,
            320,
            240,
            Distortion("plumb_bob", (-0.2, 0.0, 0.0, 0.0, 0.0)),
        )
    )
    near_and_far = np.where(
        np.indices((lens.view.height, lens.view.width)).sum(axis=0) % 9 < 4, 1, 2
    )
    bent = lens.nearest(near_and_far.astype(np.float32))
    assert bent.shape == (240, 320)
    assert np.unique(bent).tolist() == [1.0, 2.0]


def test_noise_grows_with_the_square_of_the_distance() -> None:
    sensor = DepthSensor(CameraConfig(depth=True, depth_noise=2e-3), np.random.default_rng(0))
    for distance in (0.5, 1.0, 4.0):
        found = sensor.develop(np.full((200, 200), distance, np.float32))
        assert found.mean() == pytest.approx(distance, rel=1e-3)
        assert found.std() == pytest.approx(2e-3 * distance**2, rel=0.02)


def test_what_is_beside_an_edge_or_out_of_range_has_no_depth() -> None:
    config = CameraConfig(depth=True, depth_holes=3, depth_nearest=0.5, depth_farthest=2.0)
    exact = np.ones((20, 40), np.float32)
    exact[:, 20:] = 1.1  # an edge
    exact[:, 30:] = 1.12  # none
    exact[:5, :5] = np.inf
    exact[19, 0] = 0.4
    found = DepthSensor(config, np.random.default_rng(0)).develop(exact)
    assert np.flatnonzero(np.isnan(found[10])).tolist() == [17, 18, 19, 20, 21, 22]
    assert np.isnan(found[0, 0])
    assert np.isnan(found[19, 0])
    assert not np.isnan(found[:, 30]).any()


def test_what_noise_moves_out_of_range_has_no_depth() -> None:
    sensor = DepthSensor(CameraConfig(depth=True, depth_noise=1.0), np.random.default_rng(0))
    found = sensor.develop(np.ones((100, 100), np.float32))
    # A normal draw below -0.9; of 10,000 of them, three standard deviations.
    assert np.isnan(found).mean() == pytest.approx(0.184, abs=0.012)
    assert np.nanmin(found) >= 0.1


def test_a_run_is_the_same_with_a_depth_picture() -> None:
    """Its noise has draws of its own, and a dropped frame has the last depths."""
    settings = (
        "camera.noise=4",
        "run.duration=1.5",
        "disturbances=[{kind='dropped_frames', share=0.3}]",
    )
    runs = []
    for more in ((), ("camera.depth=true", "camera.depth_noise=0.0014")):
        with Episode(load("line", [*settings, *more])) as episode:
            runs.append(list(episode))
    for one, other in zip(*runs, strict=True):
        assert np.array_equal(one.frame.image, other.frame.image)
        assert np.array_equal(one.command.twist, other.command.twist)
    frames = [step.frame for step in runs[1]]
    for before, frame in pairwise(frames):
        assert frame.depth is not None
        assert np.array_equal(before.depth, frame.depth, equal_nan=True) == (not frame.fresh)
    assert not all(frame.fresh for frame in frames)
    assert runs[0][0].frame.depth is None
    assert runs[1][0].light().frame.depth is None


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("camera.depth_noise=0.1", "depth_noise, depth_holes and the range of depths need depth"),
        ("camera.depth_nearest=20", "depth_nearest = 20 should be below depth_farthest = 10"),
    ],
)
def test_settings_that_do_not_fit_are_refused(setting: str, message: str) -> None:
    depth = ["camera.depth=true"] if "nearest" in setting else []
    with pytest.raises(Mistake, match=message):
        load("still", [*depth, setting])


def test_a_file_has_millimetres() -> None:
    depth = np.array([[0.8354, np.nan, 70.0, 2.0]], np.float32)
    read = cv2.imdecode(np.frombuffer(encoded_depth(depth), np.uint8), cv2.IMREAD_UNCHANGED)
    assert read.dtype == np.uint16
    assert read.tolist() == [[835, 0, 65535, 2000]]


def test_a_log_has_the_depths_in_metres(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Episode(load("still", ["camera.depth=true", "run.duration=0.1"])) as episode:
        log = RunMcap(path, episode)
        steps = list(episode)
        for step in steps:
            log.add(step)
        log.close()
    with AnyReader([path]) as bag:
        topics = [c for c in bag.connections if c.topic == "/camera/depth"]
        found = [bag.deserialize(raw, c.msgtype) for c, _, raw in bag.messages(topics)]
    assert [(m.width, m.height, m.step, m.encoding) for m in found] == 3 * [
        (320, 240, 1280, "32FC1")
    ]
    read = np.frombuffer(found[2].data, np.float32).reshape(240, 320)
    assert np.array_equal(read, steps[2].frame.depth, equal_nan=True)


@pytest.mark.newest  # Rerun before 0.38 reads no recording
def test_a_recording_has_the_depths_in_millimetres(tmp_path: Path) -> None:
    from rerun.chunk import RrdReader

    path = tmp_path / "a.rrd"
    with Episode(load("still", ["camera.depth=true", "run.duration=0.1"])) as episode:
        log = RerunLog(RecordingFile(path), episode)
        steps = list(episode)
        for step in steps:
            log.add(step)
        log.close()
    column = "EncodedDepthImage:blob"
    batches = [chunk.to_record_batch() for chunk in RrdReader(path).stream()]
    blobs = [b for batch in batches if column in batch.schema.names for b in batch[column]]
    picture = np.array(blobs[2].as_py()[0], np.uint8)
    assert len(blobs) == 3
    depth = steps[2].frame.depth
    assert depth is not None
    assert np.array_equal(cv2.imdecode(picture, cv2.IMREAD_UNCHANGED), np.rint(1e3 * depth))


def test_an_environment_tells_the_depth_picture() -> None:
    for settings, has_one in ((("camera.depth=true",), True), ((), False)):
        env = gymnasium.make("servo.gym:servobench/Still-v0", overrides=list(settings))
        info = env.reset(seed=0)[1]
        assert ("depth" in info) == has_one
        assert not has_one or info["depth"].shape == (240, 320)
        env.close()


def test_a_part_sees_what_it_needs_and_nothing_else() -> None:
    step = first()
    given = {"truth": step.truth, "true_motion": np.zeros(4), "seen": True}
    names = {
        Channel.PICTURE: "picture",
        Channel.DEPTH: "depth",
        Channel.TRUTH: "truth",
        Channel.TRUE_MOTION: "true_motion",
        Channel.SEEN: "seen",
    }
    for channel, name in names.items():
        view = View.of(step.frame, frozenset({channel}), **given)
        assert [n for n in names.values() if getattr(view, n) is not None] == [name]
