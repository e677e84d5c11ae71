"""Other toolkits' conventions, each driven as the toolkit itself drives it."""

import io
import json
import subprocess
import sys
from collections import namedtuple
from dataclasses import dataclass
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from followed import frame

from tracking import configured
from tracking.exported import Got10kTracker, OpenCVTracker, run_vot
from tracking.exported.program_server import run_program
from tracking.exported.served import Served
from tracking.types import Estimate, Region, State, Status

FRAMES = 10


def bgr(k):
    picture = np.full((100, 160, 3), 120, np.uint8)
    if k < FRAMES:
        x = 40 + 3 * k
        picture[30:50, x : x + 30] = (200, 60, 30)
        picture[30:50, x : x + 12] = (40, 220, 230)
    return picture


def test_opencvs_convention():
    tracker = OpenCVTracker("mean_shift", scale=False)
    assert tracker.init(bgr(0), (40, 30, 30, 20)) is None
    for k in range(1, FRAMES):
        ok, (x, y, width, height) = tracker.update(bgr(k))
        assert ok is True
        assert (x, y) == pytest.approx((40 + 3 * k, 30), abs=1.0)
        assert (width, height) == pytest.approx((30, 20))
    gone = [tracker.update(bgr(FRAMES))[0] for _ in range(3)]
    assert gone == [False] * 3  # OpenCV's own go on saying true


def test_opencvs_convention_takes_grey_pictures_and_may_begin_again():
    tracker = OpenCVTracker("kams", particles=20)
    grey = cv2.cvtColor(bgr(0), cv2.COLOR_BGR2GRAY)
    ends = []
    for _ in range(2):
        tracker.init(grey, (40, 30, 30, 20))
        ends.append(tracker.update(cv2.cvtColor(bgr(1), cv2.COLOR_BGR2GRAY)))
    assert ends[0] == ends[1]
    with pytest.raises(ValueError, match="both sides must be at least 4 px"):
        tracker.init(grey, (40, 30, 0, 20))


def test_got10ks_convention():
    """As its `Tracker.track` does it: boxes (n, 4) of pictures in RGB, counted from 1."""
    tracker = Got10kTracker("sok")
    assert (tracker.name, tracker.is_deterministic) == ("sok", True)
    boxes = np.zeros((FRAMES, 4))
    boxes[0] = (41, 31, 30, 20)
    for k in range(FRAMES):
        picture = bgr(k)[..., ::-1]
        if k == 0:
            tracker.init(picture, boxes[0])
        else:
            boxes[k] = tracker.update(picture)
    np.testing.assert_allclose(boxes[:, 0], 41 + 3 * np.arange(FRAMES), atol=1.0)
    np.testing.assert_allclose(boxes[:, 1:], [[31, 30, 20]] * FRAMES, atol=1.0)


@dataclass
class Rectangle:
    x: float
    y: float
    width: float
    height: float


class Handle:
    """What the toolkit's `vot.VOT("rectangle")` offers."""

    def __init__(self, paths):
        self.paths, self.reports = list(paths), []

    def region(self):
        return Rectangle(40, 30, 30, 20)

    def frame(self):
        return self.paths.pop(0) if self.paths else None

    def report(self, region, confidence):
        self.reports.append((region, confidence))


def test_vots_protocol(tmp_path):
    paths = [str(tmp_path / f"{k}.png") for k in range(FRAMES)]
    for k, path in enumerate(paths):
        cv2.imwrite(path, bgr(k))
    handle = Handle(paths)
    run_vot(handle, "pf_ssd", seed=1)
    assert len(handle.reports) == FRAMES - 1
    for k, (region, confidence) in enumerate(handle.reports, 1):
        assert isinstance(region, Rectangle)
        assert region.x == pytest.approx(40 + 3 * k, abs=1.5)
        assert 0.5 < confidence <= 1.0


def test_vots_protocol_names_a_picture_that_is_none(tmp_path):
    (tmp_path / "0.png").write_bytes(b"no picture")
    with pytest.raises(
        ValueError, match=r"0\.png: this picture cannot be decoded; known formats are JPEG"
    ):
        run_vot(Handle([str(tmp_path / "0.png")]), "frozen")


def test_each_picture_has_the_time_of_its_number(monkeypatch):
    """The trackers get frame 3 of a camera of 10 Hz at 0.3 s."""
    seen = []

    class Watching:
        def start(self, frame, region, state):
            seen.append((frame.index, frame.time))
            self.given = region, state

        def update(self, frame):
            seen.append((frame.index, frame.time))
            return Estimate(self.given[1], np.zeros((4, 4)), 0.0, Status.LOCKED)

    settings = SimpleNamespace(build=lambda _: Watching())
    monkeypatch.setattr("tracking.exported.toolkits.configured", lambda *_, **__: settings)
    tracker = OpenCVTracker("kams", rate=10.0)
    for _ in range(2):  # a target that is given anew begins at 0 again
        seen.clear()
        tracker.init(bgr(0), (40, 30, 30, 20))
        for k in range(1, 4):
            tracker.update(bgr(k))
        assert seen == [
            (0, 0.0),
            (1, pytest.approx(0.1)),
            (2, pytest.approx(0.2)),
            (3, pytest.approx(0.3)),
        ]


def written(folder, count=FRAMES):
    for k in range(count):
        cv2.imwrite(str(folder / f"{k:04}.jpg"), bgr(k), [cv2.IMWRITE_JPEG_QUALITY, 95])
    return [str(folder / f"{k:04}.jpg") for k in range(count)]


def check_track(boxes, times):
    assert boxes.shape == (FRAMES, 4)
    np.testing.assert_array_equal(boxes[0], (41, 31, 30, 20))
    np.testing.assert_allclose(boxes[:, 0], 41 + 3 * np.arange(FRAMES), atol=1.0)
    assert times.shape == (FRAMES,)
    assert (times > 0).all()


def test_got10ks_experiments_call_track(tmp_path):
    """As `ExperimentOTB.run` of the toolkit 0.1.3 does it, whatever the tracker's class."""
    boxes, times = Got10kTracker("mk_ssd").track(
        written(tmp_path), np.array([41.0, 31, 30, 20]), visualize=False
    )
    check_track(boxes, times)


def test_a_picture_that_is_none_is_named_in_a_track(tmp_path):
    (tmp_path / "a.jpg").write_bytes(b"no picture")
    with pytest.raises(ValueError, match=r"a\.jpg: this picture cannot be decoded"):
        Got10kTracker("mk_ssd").track([str(tmp_path / "a.jpg")], (41, 31, 30, 20))


def test_got10ks_toolkit_itself(tmp_path, monkeypatch):
    pytest.importorskip("got10k", reason="the toolkit is not installed")
    from got10k.datasets import OTB
    from got10k.experiments import ExperimentOTB

    folder = tmp_path / "otb" / "Crossing" / "img"
    folder.mkdir(parents=True)
    written(folder)
    truth = "\n".join(f"{41 + 3 * k},31,30,20" for k in range(FRAMES))
    (folder.parent / "groundtruth_rect.txt").write_text(truth)
    monkeypatch.setattr(OTB, "_download", lambda *_: None)  # it has what it needs
    experiment = ExperimentOTB(str(tmp_path / "otb"), 2013, str(tmp_path / "results"))
    experiment.run(Got10kTracker("mk_ssd"))
    found = np.loadtxt(tmp_path / "results" / "OTB2013" / "mk_ssd" / "Crossing.txt", delimiter=",")
    times = tmp_path / "results" / "OTB2013" / "mk_ssd" / "times" / "Crossing_time.txt"
    check_track(found, np.loadtxt(times))


Point = namedtuple("Point", ["x", "y"])
Polygon = namedtuple("Polygon", ["points"])
Box = namedtuple("Box", ["x", "y", "width", "height"])


class NewHandle(Handle):
    """The integration of 2026: regions are named tuples, and no confidence is taken."""

    def __init__(self, paths, given):
        super().__init__(paths)
        self.given = given

    def region(self):
        return self.given

    def report(self, status):
        self.reports.append(status)


def test_vots_newer_integration_takes_polygons_and_no_confidence(tmp_path):
    corners = [(40, 30), (70, 30), (70, 50), (40, 50)]
    handle = NewHandle(written(tmp_path), Polygon([Point(*corner) for corner in corners]))
    run_vot(handle, "mk_ssd")
    assert len(handle.reports) == FRAMES - 1
    for k, found in enumerate(handle.reports, 1):
        assert isinstance(found, Polygon)
        assert isinstance(found.points[0], Point)
        np.testing.assert_allclose(found.points, np.add(corners, (3 * k, 0)), atol=1.5)
    boxes = NewHandle(written(tmp_path), Box(40, 30, 30, 20))
    run_vot(boxes, "mk_ssd")
    assert isinstance(boxes.reports[-1], Box)


PENTAGON = [Point(*corner) for corner in ((40, 30), (60, 30), (70, 40), (70, 50), (40, 50))]


@pytest.mark.parametrize(
    ("region", "what"),
    [
        (Polygon(PENTAGON[:3]), "a polygon of 3 points"),
        (Polygon(PENTAGON), "a polygon of 5 points"),
        (np.ones((60, 80), np.uint8), "a mask"),
    ],
)
def test_a_region_of_the_vot_toolkit_that_is_no_rectangle_or_quadrangle_is_refused(
    tmp_path, region, what
):
    handle = NewHandle(written(tmp_path), region)
    with pytest.raises(ValueError) as refused:
        run_vot(handle, "frozen")
    assert str(refused.value) == (
        f"the region is {what}: expected a rectangle or a polygon of 4 points, as "
        "vot.VOT('rectangle') gives"
    )
    assert handle.reports == []


def test_traxs_own_client_follows_with_ours(tmp_path):
    trax = pytest.importorskip("trax.client", reason="vot-trax is not installed")
    from trax.image import FileImage
    from trax.region import Rectangle as TraxRectangle

    paths = written(tmp_path)
    command = [sys.executable, "-m", "tracking.exported.trax_server", "mk_ssd"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as server:
        pipes = (server.stdin.fileno(), server.stdout.fileno())
        client = trax.Client(pipes, log=lambda _: None)
        first = {"color": FileImage.create(paths[0])}
        client.initialize(first, [(TraxRectangle.create(40, 30, 30, 20), {})], {})
        for k, path in enumerate(paths[1:], 1):
            status, _ = client.frame({"color": FileImage.create(path)}, {}, [])
            left, top, *_ = status[0][0].bounds()
            assert (left, top) == pytest.approx((40 + 3 * k, 30), abs=1.0)
        client.quit()
        assert server.wait(10) == 0


@pytest.mark.parametrize(
    "setting", [{"judge": "histogram"}, {"least_confidence": 0.5}, {"follow_size": False}], ids=str
)
def test_a_setting_that_judges_reports_is_refused_where_none_arrive(setting):
    (name,) = setting
    with pytest.raises(ValueError, match=f"^{name} has no effect here: set it where the reports"):
        Served(configured("opencv", **setting), seed=0)


@pytest.mark.parametrize("kind", ["mean_shift", "mk_ssd"])
def test_a_served_tracker_reports_an_angle_if_it_follows_one(kind):
    """A tracker that keeps the first angle has measured none: it reports the box around."""
    served = Served(configured(kind), seed=0)
    region, state = Region(30.0, 20.0), State(55.0, 40.0, 0.3)
    served.start(frame(0), region, state)
    report = served.update(frame(0))
    assert report.seen
    if kind == "mk_ssd":
        assert report.angle == pytest.approx(0.3, abs=0.2)
        expected = [40.0, 30.0, 30.0, 20.0]
    else:
        assert report.angle is None
        corners = region.corners(state)
        expected = [*corners.min(axis=0), *np.ptp(corners, axis=0)]
    np.testing.assert_allclose(report.box, expected, atol=4.0)


@pytest.mark.parametrize(
    ("left_out", "given"),
    [("time", {}), ("index", {}), ("width", {}), ("angle", {"corners": [[40, 30]] * 4})],
)
def test_a_client_whose_line_lacks_a_key_is_a_sentence(left_out, given):
    line = {"width": 160, "height": 100, "index": 0, "time": 0.0} | given
    lines = [{"seed": 7}, {key: value for key, value in line.items() if key != left_out}]
    requests = io.BytesIO("".join(f"{json.dumps(one)}\n" for one in lines).encode())
    with pytest.raises(ValueError) as refused:
        run_program("frozen", requests=requests, answers=io.BytesIO())
    assert str(refused.value) == (
        f"the client sent a line without '{left_out}' before a picture; it needs width, height, "
        "index, time, and for the first picture corners and angle"
    )
