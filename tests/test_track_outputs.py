"""What `servobench track` leaves: times, files, and what there is of them after a kill."""

import itertools
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from preloaded import Command
from tracked import FRAMES, REGION, call, image, pictures, rows_of

from servo.cli.track_command import region_of
from tracking import create
from tracking.drawing.annotated_video import SMALLEST
from tracking.drawing.film_page import CAPTION, HEAD, MARGIN
from tracking.evaluation.track import Track, follow
from tracking.evaluation.track_file import TrackFile, read
from tracking.sequences.sources import PaintedSource
from tracking.sequences.video_file import Video

RrdReader = pytest.importorskip("rerun.chunk", reason="Rerun before 0.38 reads none").RrdReader


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return pictures(tmp_path)


def test_the_times_of_a_track_are_what_the_tracker_took(monkeypatch, tmp_path):
    """A clock that goes on by 2 ms whenever it is read: start and updates take one step each."""
    ticks = itertools.count()
    monkeypatch.setattr("time.perf_counter", lambda: 0.002 * next(ticks))
    region, start = region_of(REGION)
    tracker = create("frozen", 0)
    source = PaintedSource(image, 4, rate=10.0)
    rows = TrackFile(tmp_path / "track.csv", region)
    shots = []
    for shot in follow(tracker, source, region, start):
        rows.add(shot)
        shots.append(shot)
    rows.close()
    assert [float(row["milliseconds"]) for row in rows_of(tmp_path / "track.csv")] == [2.0] * 4
    assert [float(row["time"]) for row in rows_of(tmp_path / "track.csv")] == [0.0, 0.1, 0.2, 0.3]
    np.testing.assert_allclose(read(tmp_path / "track.csv").milliseconds, 2.0)
    np.testing.assert_allclose(Track.of(shots, region).milliseconds, 2.0)


@pytest.mark.parametrize("extra", [(), ("--rerun",), ("--video", "out.mp4", "--rerun")])
def test_exactly_what_was_asked_for_is_written_and_listed(monkeypatch, capfd, folder, extra):
    code, out, _ = call(monkeypatch, capfd, "in", "--region", REGION, "--out", "out", *extra)
    names = {"track.csv", "track.parquet", "report.json"}
    names |= {"track.rrd"} if "--rerun" in extra else set()
    assert code == 0
    assert {path.name for path in (folder / "out").iterdir()} == names
    listed = [line.strip() for line in out.splitlines() if line.startswith("  ")]
    beside = ["out.mp4"] if "--video" in extra else []
    assert sorted(listed) == sorted([*beside, *(f"out/{name}" for name in names)])
    assert [path.name for path in folder.glob("out.*")] == beside


def test_the_pictures_of_the_annotated_video_show_the_estimate(monkeypatch, capfd, folder):
    call(monkeypatch, capfd, "in", "--region", REGION, "--out", "out", "-q", "--video", "a.mp4")
    *_, last = Video.of(folder / "a.mp4")
    left = rows_of(folder / "out" / "track.csv")[-1]
    factor = SMALLEST[0] / 160
    x = MARGIN + round(factor * float(left["x1"]))
    y = HEAD + CAPTION + round(factor * (float(left["y1"]) + float(left["y4"])) / 2)
    red, green, blue = last.image[y, x - 2 : x + 3].astype(int).max(axis=0)
    assert green > max(red, blue) + 40  # the outline of an estimate that is LOCKED


@pytest.mark.processes
def test_a_killed_track_leaves_a_video_and_a_recording_of_all_but_the_last_second(folder):
    for k in range(FRAMES, 3000):
        (folder / "in" / f"{k:04}.png").hardlink_to(folder / "in" / "007.png")
    out = folder / "out"
    words = ["track", "in", "--region", REGION, "--out", out, "-q", "--video", "a.mp4", "--rerun"]
    process = Command(words, stdout=os.devnull, stderr=os.devnull)
    deadline = time.monotonic() + 120
    while not ((out / "track.csv").exists() and len(rows_of(out / "track.csv")) > 100):
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.05)
    process.send_signal(signal.SIGKILL)
    process.wait()
    count = len(rows_of(out / "track.csv"))
    film = Video.of(folder / "a.mp4")
    assert film.rate == 30
    assert count - 30 < film.count <= count
    assert [picture.image is None for picture in film] == [False] * film.count
    images = sum(
        chunk.num_rows
        for chunk in RrdReader(str(out / "track.rrd")).stream()
        if chunk.entity_path == "/image"
    )
    assert count - 40 < images <= count


@pytest.mark.wide
def test_few_open_files_are_enough(folder):
    code = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_NOFILE, (30, 30))\n"
        "from servo.cli.main import main; sys.exit(main())"
    )
    arguments = ["track", "in", "--region", REGION, "--out", "out", "-q", "--video", "a.mp4"]
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, b"", b"")
    assert len(rows_of(folder / "out" / "track.csv")) == FRAMES


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("--rate", "nan", "'nan' is not in the range 0.01<=x<=10000.0."),
        ("--rate", "inf", "inf is not in the range 0.01<=x<=10000.0."),
        ("--rate", "0.001", "0.001 is not in the range 0.01<=x<=10000.0."),
        ("--rate", "1e9", "1000000000.0 is not in the range 0.01<=x<=10000.0."),
        ("--frames", "1e21", "'1e21' is not a valid integer."),
        ("--frames", "1" + "0" * 21, "1" + "0" * 21 + " is not in the range 1<=x<=1000000000."),
        ("--frames", "0", "0 is not in the range 1<=x<=1000000000."),
    ],
)
def test_a_number_out_of_range_is_refused(monkeypatch, capfd, folder, option, value, message):
    code, _, err = call(monkeypatch, capfd, "in", "--region", REGION, option, value)
    assert code == 2
    assert err.endswith(f"Error: Invalid value for '{option}': {message}\n")


@pytest.mark.parametrize("rate", ["0.01", "29.97", "10000"])
def test_every_accepted_rate_is_kept(monkeypatch, capfd, folder, rate):
    arguments = ["in", "--region", REGION, "--out", "out", "-q", "--video", "a.mp4"]
    arguments += ["--rate", rate]
    assert call(monkeypatch, capfd, *arguments)[0] == 0
    assert Video.of(folder / "a.mp4").rate == pytest.approx(float(rate), rel=1e-5)  # 1/90 ms
    times = [float(row["time"]) for row in rows_of(folder / "out" / "track.csv")]
    np.testing.assert_allclose(times, np.arange(FRAMES) / float(rate), atol=1e-6)


def test_pictures_whose_folder_is_no_text_are_tracked_into_one_that_is(monkeypatch, capfd, folder):
    (folder / "in").rename(folder / "in\udcff")
    assert call(monkeypatch, capfd, "in\udcff", "--region", REGION, "-q", "--rerun")[0] == 0
    assert len(rows_of(folder / "runs" / "in?-annealed-0" / "track.csv")) == FRAMES
