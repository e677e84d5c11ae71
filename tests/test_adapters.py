"""Other toolkits' conventions, each driven as the toolkit itself drives it."""

from dataclasses import dataclass

import cv2
import numpy as np
import pytest

from tracking.adapters import Got10kTracker, OpenCVTracker, run_vot
from tracking.types import Estimate, Status

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
    with pytest.raises(ValueError, match=r"0\.png: this is not a picture; known formats are JPEG"):
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

    monkeypatch.setattr("tracking.adapters.create", lambda *_, **__: Watching())
    tracker = OpenCVTracker("kams", rate=10.0)
    for _ in range(2):  # a target that is given anew begins at 0 again
        seen.clear()
        tracker.init(bgr(0), (40, 30, 30, 20))
        for k in range(1, 4):
            tracker.update(bgr(k))
        assert seen == [(0, 0.0), (1, pytest.approx(0.1)), (2, pytest.approx(0.2)),
                        (3, pytest.approx(0.3))]  # fmt: skip
