"""Cameras and streams: the newest picture wins, and losses and ends are sentences."""

import itertools
import json
import re
import threading
import time
from contextlib import nullcontext
from datetime import UTC, datetime, timedelta

import cv2
import numpy as np
import pytest
from serving import film, served
from tracked import REGION, call, image, rows_of

from tracking.sequences import stream
from tracking.sequences.sequence import source_of
from tracking.sequences.sources import End, Picture, Times, timed
from tracking.sequences.stream import Feed, LiveSource
from tracking.trackers import frozen

IMAGE = np.zeros((20, 30, 3), np.uint8)
NS = 10**9
SCHEMES = pytest.mark.parametrize(
    "rtsp", [False, pytest.param(True, marks=pytest.mark.newest)], ids=["tcp", "rtsp"]
)
"""FFmpeg before 8.1, which PyAV brings before 18, crashes on MPEG-TS over RTSP."""


def picture(stamp, image=IMAGE, *, damaged=False):
    """A picture as a stream gives it, with a stamp [s]."""
    stated = None if stamp is None else round(stamp * NS)
    return Picture("", 0.0, image, stamp=stated, damaged=damaged)


def test_the_newest_picture_wins_and_the_dropped_are_counted():
    go, done = threading.Event(), threading.Event()

    def pictures():
        yield picture(None, None)  # of a picture that was sent earlier
        yield picture(10.0)
        go.wait(9)
        yield picture(None, None)
        for k in range(1, 6):
            yield picture(10.0 + 0.1 * k, damaged=k > 3)
        done.set()

    source = LiveSource("eye", lambda: nullcontext(Feed(pictures(), 10.0)))
    found = iter(source)
    first = next(found)
    assert source.end is None
    go.set()
    done.wait(9)
    rest = list(found)
    assert [p.name for p in (first, *rest)] == ["frame 0", "frame 5"]
    assert [p.time for p in (first, *rest)] == pytest.approx([0.0, 0.5])
    assert source.rate == 10.0
    assert source.end == End(
        "eye: 6 pictures, then it ended; 4 of them were dropped, because they came too fast; "
        "2 of them are damaged; 1 more cannot be decoded",
        lost=True,
        dropped=4,
        damaged=3,
    )


def test_a_recording_on_a_server_waits_and_a_reader_that_stops_ends_the_thread():
    feed = Feed((picture(k / 10) for k in range(50)), 10.0, waits=True)
    source = LiveSource("eye", lambda: nullcontext(feed))
    before = threading.active_count()
    found = iter(source)
    assert [next(found).name for _ in range(20)] == [f"frame {k}" for k in range(20)]
    found.close()
    assert source.end is None
    assert threading.active_count() == before


@pytest.mark.parametrize(
    ("stamps", "expected"),
    [
        ([None, 7.0, 7.05, None, 7.3], [0.0, 0.1, 0.15, 0.25, 0.4]),
        ([7.0, 7.2, 7.1, 7.4, 7.3, 7.6], [0.0, 0.2, 0.2001, 0.4, 0.4001, 0.6]),  # wrong order
        ([7.0, 7.0, 7.0, 7.3, 7.3], [0.0, 0.1, 0.2, 0.3, 0.4]),  # the same twice
        ([7.0, 7.1, 2.0, 2.2], [0.0, 0.1, 0.2, 0.4]),  # a clock that was set back,
        ([7.0, 7.1, 1.7e9, 1.7e9 + 1], [0.0, 0.1, 0.2, 1.2]),  # or forward
        ([7.0, 3607.0, 3607.5], [0.0, 3600.0, 3600.5]),  # a pause
    ],
)
def test_times_increase_whatever_the_stamps_are(stamps, expected):
    times = Times(10.0)
    stated = [None if stamp is None else round(stamp * NS) for stamp in stamps]
    assert [times.since_first(stamp) for stamp in stated] == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(
    ("stamps", "expected"),
    [
        ([5.0, 5.1, None, 5.15, 5.25], [0.0, 0.1, 0.125, 0.15, 0.25]),
        ([5.0, None, None, 5.6, None, None], [0.0, 0.2, 0.4, 0.6, 0.7, 0.8]),
        ([None, None, 5.0, 5.05], [0.0, 0.05, 0.1, 0.15]),
    ],
)
def test_pictures_that_cannot_be_decoded_leave_the_times_of_the_others(stamps, expected):
    there = [picture(stamp, None if stamp is None else IMAGE) for stamp in stamps]
    found = list(timed(there, 10.0))
    assert [p.image is None for p in found] == [stamp is None for stamp in stamps]
    assert [p.time for p in found] == pytest.approx(expected)


def clock_of(now):
    """The module `time` with another clock [s]."""
    return type("Clock", (), {"monotonic": now, "monotonic_ns": lambda: round(now() * NS)})


class Camera:
    """Two frames, the second one half a second later, then no more."""

    def __init__(self, clock, works=True):
        self.clock, self.works, self.left, self.released = clock, works, 2, False

    def isOpened(self):
        return self.works

    def read(self):
        time.sleep(0.3)  # the reader has taken the one before
        self.clock[0] += 0.5
        self.left -= 1
        return self.left >= 0, np.full((2, 3, 3), (10, 20, 30), np.uint8)

    def release(self):
        self.released = True


def test_a_camera_gives_pictures_with_their_times_until_it_is_lost(monkeypatch):
    clock = [50.0]
    cameras = {2: Camera(clock), 3: Camera(clock, works=False)}
    monkeypatch.setattr(stream, "time", clock_of(lambda: clock[0]))
    monkeypatch.setattr(stream.cv2, "VideoCapture", cameras.get)
    source = source_of("camera:2", 30.0)
    pictures = list(source)
    assert [(p.name, p.time) for p in pictures] == [("frame 0", 0.0), ("frame 1", 0.5)]
    assert pictures[0].image.tolist() == [[[30, 20, 10]] * 3] * 2
    assert cameras[2].released
    assert source.end == End(
        "camera:2: 2 pictures, then it was lost: no picture came from the camera: check its cable, "
        "and that no other program uses it",
        lost=True,
    )
    with pytest.raises(ValueError, match="camera:3: there is no such camera"):
        next(iter(source_of("camera:3", 30.0)))


def test_the_scheme_of_an_address_may_be_in_capitals():
    with served(film(5)) as address:
        assert next(iter(source_of(address.replace("tcp", "TCP"), 30.0))).image is not None


def test_a_tracker_is_warmed_up_before_a_stream_is_opened(monkeypatch, capfd, tmp_path):
    """Compiling takes a second: after the first picture, the target would have moved."""
    events = []

    def opened():
        events.append("opened")
        return nullcontext(Feed((picture(k / 10) for k in range(3)), 10.0, waits=True))

    for method in ("start", "update"):
        usual = getattr(frozen.Frozen, method)

        def noted(self, *given, usual=usual, method=method):
            events.append(method)
            return usual(self, *given)

        monkeypatch.setattr(frozen.Frozen, method, noted)
    monkeypatch.setattr(stream, "stream", lambda address: LiveSource(address, opened))
    monkeypatch.chdir(tmp_path)
    arguments = ["tcp://127.0.0.1:1", "--tracker", "frozen", "--region", "2,2,9,9", "-q"]
    code, _, err = call(monkeypatch, capfd, *arguments)
    assert (code, err) == (0, "servobench: tcp://127.0.0.1:1: 3 pictures, then it ended\n")
    assert events == ["start", *6 * ["update"], "opened", "start", "update", "update"]


@pytest.fixture(scope="module")
def parts():
    return film(60)


@pytest.mark.processes
@SCHEMES
def test_a_stream_is_tracked_by_a_slow_tracker(monkeypatch, capfd, tmp_path, parts, rtsp):
    usual = frozen.Frozen.update

    def slow(self, *given):
        time.sleep(0.25)
        return usual(self, *given)

    monkeypatch.setattr(frozen.Frozen, "update", slow)
    monkeypatch.chdir(tmp_path)
    before = datetime.now(UTC) - timedelta(milliseconds=1)
    with served(parts, gap=0.04, rtsp=rtsp) as address:
        code, _, err = call(
            monkeypatch,
            capfd,
            address,
            "--region",
            REGION,
            "--tracker",
            "frozen",
            "-q",
            "--out",
            "out",
        )
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    rows = rows_of(tmp_path / "out" / "track.csv")
    assert code == 0
    assert err == f"servobench: {report['end']}\n"
    total = len(rows) + report["dropped"]
    assert re.fullmatch(
        rf"{address}: {total} pictures, then it ended; {report['dropped']} of them were dropped, "
        r"because they came too fast; a picture took 2\d\d ms for tracking and \d+ ms for "
        "writing and showing",
        report["end"],
    )
    came = datetime.fromisoformat(report["began"])
    assert came.tzinfo is UTC
    assert before <= came <= datetime.now(UTC)
    assert 0 < report["dropped"] < total <= 60
    times = np.array([float(row["time"]) for row in rows])
    np.testing.assert_allclose(25 * times, np.round(25 * times), atol=1e-3)
    assert np.diff(times).max() > 0.1


@pytest.mark.processes
@pytest.mark.parametrize(
    ("then", "reason"), [("die", "Connection reset by peer"), ("stall", "nothing came for 2 s")]
)
def test_a_stream_that_dies_leaves_its_rows(monkeypatch, capfd, tmp_path, parts, then, reason):
    monkeypatch.setattr(stream, "PATIENCE", 2.0)
    monkeypatch.chdir(tmp_path)
    with served(parts, gap=0.04, then=then) as address:
        words = ("--region", REGION, "--tracker", "frozen", "--out", "out", "--rerun")
        code, _, err = call(monkeypatch, capfd, address, *words)
    assert code == 1
    assert err.startswith(f"servobench: {address}: ")
    assert f" pictures, then it was lost: {reason}" in err
    assert len(err.splitlines()) == 1
    rows = rows_of(tmp_path / "out" / "track.csv")
    assert len(rows) > 1
    assert float(rows[-1]["time"]) > 0.2
    assert json.loads((tmp_path / "out" / "report.json").read_text())["frames"] == len(rows)


def test_a_silent_address_is_a_sentence_soon(monkeypatch):
    monkeypatch.setattr(stream, "PATIENCE", 0.5)
    with served([], then="stall") as address:
        began = time.monotonic()
        with pytest.raises(ValueError) as refused:
            next(iter(source_of(address, 30.0)))
    assert str(refused.value) == f"{address}: cannot open this stream: nothing came for 0.5 s"
    assert time.monotonic() - began < 8


def test_few_pictures_are_read_before_the_first_one_is_given():
    """What is read to detect the format comes at once afterwards, and most of it is replaced."""
    given, in_time = threading.Event(), []

    def parts():
        yield from film(8)
        in_time.append(given.wait(3))

    with served(parts()) as address:
        pictures = iter(source_of(address, 30.0))  # kept: it is read until all parts were sent
        assert next(pictures).image.shape == (100, 160, 3)
        given.set()
    assert in_time == [True]


def motion_jpeg(picture, part=1.0):
    """A picture as an HTTP camera sends it, or the first part of one."""
    jpeg = cv2.imencode(".jpg", picture)[1].tobytes()
    jpeg = jpeg[: round(part * len(jpeg))]
    head = b"--eye\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(jpeg)
    return head + jpeg + b"\r\n"


def test_damaged_pictures_of_a_stream_are_counted(monkeypatch, capfd, tmp_path):
    parts = [motion_jpeg(image(0), 0.5 if k % 10 == 5 else 1.0) for k in range(30)]
    monkeypatch.chdir(tmp_path)
    words = ("--region", REGION, "--tracker", "frozen", "-q", "--out", "out")
    with served(parts, gap=0.03) as address:
        code, _, err = call(monkeypatch, capfd, address, *words)
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert (code, report["damaged"]) == (1, 3)
    assert re.match(rf"servobench: {address}: \d\d pictures, then it ", err)
    assert "; 3 of them are damaged" in err


def test_pictures_without_stamps_have_the_times_at_which_they_come(monkeypatch):
    clock = itertools.count()
    monkeypatch.setattr(stream, "time", clock_of(lambda: next(clock)))
    with served(9 * [motion_jpeg(IMAGE)], gap=0.15) as address:
        found = [(int(p.name.removeprefix("frame ")), p.time) for p in source_of(address, 30.0)]
    first = found[0][0]  # on a busy machine, pictures before it were replaced by newer ones
    assert found[-1][0] == 8 > first
    assert found == [(number, number - first) for number, _ in found]


def test_a_stream_that_ends_while_its_format_is_detected_is_read():
    with served([cv2.imencode(".jpg", IMAGE)[1].tobytes()]) as address:
        assert [p.time for p in source_of(address, 30.0)] == [0.0]


def test_a_playlist_at_an_address_opens_nothing(tmp_path):
    (tmp_path / "secret.ts").write_bytes(b"".join(film(3)))
    text = f"#EXTM3U\n#EXTINF:1,\n{tmp_path}/secret.ts\n#EXT-X-ENDLIST\n".encode()
    with served([text]) as address, pytest.raises(ValueError) as refused:
        next(iter(source_of(address, 30.0)))
    assert str(refused.value) == (
        f"{address}: cannot open this stream: Invalid data found when processing input"
    )


@SCHEMES
def test_a_stream_is_read_from_its_first_key_frame_on(rtsp):
    with served(film(50, gop=50), gap=0.01, rtsp=rtsp) as address:
        source = source_of(address, 30.0)
        given = len(list(source))
    assert given + source.end.dropped >= 49  # the last one of RTSP may lack its end


def test_a_password_is_not_printed():
    assert stream.shown("rtsp://me:a:b@10.0.0.1/x@y") == "rtsp://me:***@y"
    assert stream.shown("camera:0") == "camera:0"
