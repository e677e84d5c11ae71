"""`servobench track` on painted pictures: what it writes, and what it says of odd input."""

import json
import time
from dataclasses import replace

import cv2
import numpy as np
import pyarrow.parquet as pq
import pytest
from tracked import FRAMES, REGION, call, image, pictures, rows_of

from servo.cli import track_command
from servo.cli.track_command import region_of
from servo.output.recording.view import recording_in
from tracking.evaluation.track_file import HEADER, TrackFile, read
from tracking.sequences.sequence import source_of
from tracking.sequences.sources import End
from tracking.trackers import frozen


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return pictures(tmp_path)


def test_a_track_has_the_agreed_header_and_a_row_for_every_picture(monkeypatch, capfd, folder):
    code, _, err = call(monkeypatch, capfd, "in", "--region", REGION, "--out", "out", "-q")
    assert (code, err) == (0, "")
    first = (folder / "out" / "track.csv").read_text().splitlines()[0]
    assert first == (
        "frame,time,x,y,theta,scale,width,height,x1,y1,x2,y2,x3,y3,x4,y4,confidence,status,"
        "milliseconds,stamp,name"
    )
    found = rows_of(folder / "out" / "track.csv")
    assert [int(row["frame"]) for row in found] == list(range(FRAMES))
    given = [float(found[0][k]) for k in ("x", "y", "width", "height", "x1", "y1", "x3", "y3")]
    assert given == [55, 40, 30, 20, 40, 30, 70, 50]
    last = found[-1]
    assert float(last["x"]) == pytest.approx(55 + 2 * (FRAMES - 1), abs=1.5)
    assert last["status"] == "LOCKED"
    assert float(last["time"]) == pytest.approx((FRAMES - 1) / 30, abs=1e-6)


def test_the_same_seed_gives_the_same_track(monkeypatch, capfd, folder):
    for name in ("a", "b"):
        call(monkeypatch, capfd, "in", "--region", REGION, "--out", name, "--seed", "4", "-q")
    one, two = read(folder / "a" / "track.csv"), read(folder / "b" / "track.csv")
    np.testing.assert_array_equal(one.corners, two.corners)


def test_a_truth_in_the_folder_of_the_pictures_gives_region_and_measures(
    monkeypatch, capfd, folder
):
    (folder / "seq").mkdir()
    (folder / "in").rename(folder / "seq" / "img")
    lines = [f"{41 + 2 * k},31,30,20" for k in range(FRAMES)]
    (folder / "seq" / "groundtruth_rect.txt").write_text("\n".join(lines))
    settings = ["--tracker", "mean_shift", "--set", "tracker.levels=16"]
    code, out, _ = call(monkeypatch, capfd, "seq", "--out", "out", *settings)
    assert code == 0
    report = json.loads((folder / "out" / "report.json").read_text())
    assert report["tracker"] == {"kind": "mean_shift", "levels": 16}
    assert report["frames"] == FRAMES
    assert report["measures"]["auc"] > 0.85
    assert report["measures"]["mean_error_px"] < 1.0
    assert "mean_error_px" in out


def test_a_truth_of_one_line_is_the_start(monkeypatch, capfd, folder):
    """GOT-10k's test split has no other line; here it is a mask, as VOT has them."""
    (folder / "in" / "groundtruth.txt").write_text("m40,30,30,20,0,600")
    code, _, err = call(monkeypatch, capfd, "in", "--out", "out", "--tracker", "frozen")
    assert (code, err) == (
        0,
        "servobench: in/groundtruth.txt: the masks of this truth are replaced by the boxes around them\n"
        f"servobench: the truth has only one line for {FRAMES} pictures, so no measures are computed\n",
    )
    found = rows_of(folder / "out" / "track.csv")
    assert [float(found[-1][k]) for k in ("x1", "y1", "x3", "y3")] == [40, 30, 70, 50]
    assert json.loads((folder / "out" / "report.json").read_text())["measures"] == {}


def test_a_region_may_be_turned_about_its_centre():
    region, state = region_of("40,30,30,20,90")
    assert (region.width, region.height, state.x, state.y) == (30, 20, 55, 40)
    assert state.theta == pytest.approx(np.pi / 2)
    corners = region.corners(state)
    np.testing.assert_allclose(corners[0], [65, 25], atol=1e-9)  # what was top left is top right


def test_odd_pictures_are_told_and_give_lost_rows(monkeypatch, capfd, folder):
    (folder / "in" / "003.png").write_bytes(b"no picture")
    cv2.imwrite(str(folder / "in" / "005.png"), image(5)[..., 0])
    cv2.imwrite(str(folder / "in" / "006.png"), cv2.resize(image(6), (80, 50)))
    code, _, err = call(
        monkeypatch, capfd, "in", "--region", REGION, "--out", "out", "-q", "--video", "track.mp4"
    )
    assert code == 1
    assert err == (
        "servobench: the pictures change their size at 006.png to 80 x 50 px; the target is "
        "searched for at the same pixels\n"
        f"servobench: 1 of {FRAMES} pictures cannot be read, the first is 003.png (this picture "
        "cannot be decoded; known formats are JPEG, PNG, BMP, TIFF, WebP, PPM); their rows have "
        "the status LOST\n"
    )
    found = rows_of(folder / "out" / "track.csv")
    assert len(found) == FRAMES
    assert (found[3]["status"], float(found[3]["confidence"])) == ("LOST", 0.0)
    assert found[3]["x"] == found[2]["x"]
    film = cv2.VideoCapture(str(folder / "track.mp4"))
    assert int(film.get(cv2.CAP_PROP_FRAME_COUNT)) == FRAMES
    assert (film.get(cv2.CAP_PROP_FRAME_WIDTH), film.get(cv2.CAP_PROP_FPS)) == (640, 30)


def test_a_video_is_tracked_and_a_recording_written(monkeypatch, capfd, folder):
    writer = cv2.VideoWriter("film.avi", cv2.VideoWriter.fourcc(*"MJPG"), 10, (160, 100))
    for k in range(FRAMES):
        writer.write(image(k))
    writer.release()
    arguments = ["film.avi", "--region", REGION, "--out", "out", "--rerun", "--frames", "5", "-q"]
    assert call(monkeypatch, capfd, *arguments)[0] == 0
    found = rows_of(folder / "out" / "track.csv")
    assert len(found) == 5
    assert float(found[4]["time"]) == pytest.approx(0.4)
    assert recording_in(folder / "out") == folder / "out" / "track.rrd"
    assert (folder / "out" / "track.rrd").read_bytes()[:3] == b"RRF"


BAD = {
    "no region": (
        ["in"],
        "in: the region of the target is missing; give --region X,Y,W,H[,DEG], or a folder with a truth file",
    ),
    "an empty region": (
        ["in", "--region", "40,30,0,20"],
        "the region is 0 x 20 px; both sides must be at least 4 px",
    ),
    "a region outside": (
        ["in", "--region", "150,30,30,20"],
        "the region spans 150..180 x 30..50 px; most of it must be inside the image of 160 x 100 px",
    ),
    "no numbers": (
        ["in", "--region", "40,30,big,20"],
        "--region 40,30,big,20: this is no region: write X,Y,W,H or X,Y,W,H,DEG [px, deg]",
    ),
    "too many numbers": (
        ["in", "--region", "1,2,3,4,5,6"],
        "--region 1,2,3,4,5,6: this is no region: write X,Y,W,H or X,Y,W,H,DEG [px, deg]",
    ),
    "another section after a good one": (
        ["in", "--region", REGION, "--set", "tracker.particles=9", "--set", "foo=1"],
        "--set foo=1: track sets only settings of the tracker: write tracker.KEY=VALUE",
    ),
    "another section": (
        ["in", "--region", REGION, "--set", "camera.fx=3"],
        "--set camera.fx=3: track sets only settings of the tracker: write tracker.KEY=VALUE",
    ),
    "an unknown preset": (
        ["in", "--region", REGION, "--set", "tracker.preset=book"],
        "tracker.preset: there is no preset 'book'; there is paper, video",
    ),
    "a first picture that is none": (
        ["broken", "--region", REGION],
        "0.png: the first picture cannot be read: this picture cannot be decoded; known formats are JPEG, "
        "PNG, BMP, TIFF, WebP, PPM",
    ),
    "a truth that is too short": (
        ["in", "--truth", "short.txt", "--region", REGION],
        "short.txt: this truth has 2 lines for 8 pictures; it needs one for each, with nan where "
        "the target is absent",
    ),
    "a truth that never ends": (
        ["in", "--truth", "/dev/zero"],
        "/dev/zero: cannot read this truth: it is a device, not a file",
    ),
    "a truth of a camera": (
        ["camera:0", "--truth", "short.txt"],
        "short.txt: the pictures of camera:0 cannot be counted, so a truth cannot belong to them: leave out --truth",
    ),
    "an unknown format": (
        ["in", "--region", REGION, "--truth-format", "coco"],
        "there is no truth format 'coco'; there is auto, otb, vot, tld, csv",
    ),
    "a truth in another format": (
        ["in", "--truth", "short.txt", "--truth-format", "tld"],
        "short.txt, line 1: 40,30,30,20 is not x1,y1,x2,y2 with x2 > x1 and y2 > y1: correct that line, or give the format of this truth: otb, vot or tld (--truth-format, or truth_format in a suite or in [recording])",
    ),
    "a folder that is no text": (
        ["in", "--region", REGION, "--out", "o\udcff"],
        "o\\udcff: the name of this folder is not UTF-8; choose another with --out",
    ),
    "two targets": (
        ["two"],
        "two: there are several truth files (groundtruth_rect.1.txt, groundtruth_rect.2.txt); "
        "choose one with --truth, or with recording.truth in a scenario",
    ),
    "a log of several cameras": (
        ["cameras.mcap", "--region", REGION],
        "cameras.mcap: this bag is damaged or incomplete: copy or record it again",
    ),
    "a truth that is none": (
        ["in", "--region", REGION, "--truth", "in/000.png"],
        "in/000.png: cannot read this truth: it is not UTF-8 text: save it as UTF-8, or give another "
        "file",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_a_mistake_is_one_sentence_and_leaves_nothing(monkeypatch, capfd, folder, case):
    (folder / "broken").mkdir()
    (folder / "broken" / "0.png").write_bytes(b"no picture")
    (folder / "short.txt").write_text(2 * "40,30,30,20\n")
    (folder / "cameras.mcap").write_bytes(b"\x89MCAP0\r\n" + b"\0" * 99)
    (folder / "two").mkdir()
    cv2.imwrite("two/0.png", image(0))
    for i in (1, 2):
        (folder / "two" / f"groundtruth_rect.{i}.txt").write_text("40,30,30,20\n")
    arguments, message = BAD[case]
    code, _, err = call(monkeypatch, capfd, *arguments)
    assert (code, err) == (2, f"servobench: {message}\n")
    assert not (folder / "runs").exists()


def test_what_is_no_track_is_refused(tmp_path):
    (tmp_path / "t.csv").write_text("a,b\n1,2\n")
    with pytest.raises(ValueError, match="format 3, which this version reads, but a, b"):
        read(tmp_path / "t.csv")
    assert len(HEADER) == 21


@pytest.mark.parametrize("moment", ["before", "after"])
def test_a_stopped_track_reports_the_rows_that_it_wrote(monkeypatch, capfd, folder, moment):
    """The signal comes before or after the fourth row is written, as while a film is."""
    usual = TrackFile.add

    def add(self, shot):
        if shot.index == 3 and moment == "before":
            raise KeyboardInterrupt
        usual(self, shot)
        if shot.index == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr(TrackFile, "add", add)
    words = ("in", "--region", REGION, "--tracker", "frozen", "--out", "out")
    code, out, _ = call(monkeypatch, capfd, *words)
    count = 3 if moment == "before" else 4
    assert code == 130
    assert len(rows_of(folder / "out" / "track.csv")) == count
    assert pq.read_table(folder / "out" / "track.parquet").num_rows == count
    assert json.loads((folder / "out" / "report.json").read_text())["frames"] == count
    assert f"{count} frames, {count - 1} UNSURE, 0 LOST" in out


def test_unsure_pictures_are_counted(monkeypatch, capfd, folder):
    """The target is gone from the third picture on, for less than a second."""
    for k in range(2, FRAMES):
        cv2.imwrite(str(folder / "in" / f"{k:03}.png"), np.full((100, 160, 3), 128, np.uint8))
    words = ("in", "--region", REGION, "--tracker", "pf_ssd", "--rate", "8", "--out", "out")
    code, out, _ = call(monkeypatch, capfd, *words)
    report = json.loads((folder / "out" / "report.json").read_text())
    rows = [row["status"] for row in rows_of(folder / "out" / "track.csv")]
    assert rows == [*2 * ["LOCKED"], *6 * ["UNSURE"]]
    assert (code, report["unsure"], report["lost"]) == (0, 6, 0)
    assert f"{FRAMES} frames, 6 UNSURE, 0 LOST" in out


def test_where_pictures_were_dropped_the_mean_times_of_one_are_said(monkeypatch, capfd, folder):
    """Of the only one that was tracked, too: the time in its row."""
    busy = End("eye: 9 pictures, then it ended", dropped=8)
    monkeypatch.setattr(
        track_command, "source_of", lambda *given: replace(source_of(*given), end=busy)
    )
    monkeypatch.setattr(frozen.Frozen, "start", lambda *_: time.sleep(0.02))
    words = ["in", "--region", REGION, "--out", "out", "-q", "--tracker", "frozen", "--frames", "1"]
    code, _, err = call(monkeypatch, capfd, *words)
    (row,) = rows_of(folder / "out" / "track.csv")
    assert code == 0
    took = f"; a picture took {float(row['milliseconds']):.0f} ms for tracking and "
    assert err.startswith(f"servobench: {busy.sentence}{took}")
