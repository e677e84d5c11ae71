"""A disk that takes no more: rows come first, one sentence, exit code 1.

A limit stands for the full disk: the system then refuses to let any file grow beyond a size.
Runs, recordings and videos, which other libraries write, are tested in a process of their own.
"""

import json
import os
import resource
import shlex
import sys

import cv2
import numpy as np
import pyarrow.parquet as pq
import pytest
from preloaded import ran

from servo.cli import main

pytestmark = pytest.mark.processes

NO_BYTECODE = {"PYTHONDONTWRITEBYTECODE": "1"}
"""Python 3.11 keeps bytecode that did not fit, and cannot import it afterwards."""
QUICK = "--set run.duration=2 --set tracker.kind=frozen --set estimator.kind=none --set expect={}"


FULL = (
    "servobench: out: cannot write runs.sqlite: disk I/O error; the finished runs are stored; "
    "remove the cause and run the same command again to continue\n"
)


def limited(blocks, command, place):
    """Exit code and stderr of a command whose files may not be larger than so many KiB."""
    environment = os.environ | NO_BYTECODE
    code, _, err = ran(shlex.split(command), cwd=place, env=environment, largest=blocks << 10)
    return code, err


@pytest.fixture
def here(tmp_path, monkeypatch, capfd):
    """The same in this process, without stdout."""
    monkeypatch.chdir(tmp_path)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)

    def call(blocks, command):
        monkeypatch.setattr(sys, "argv", ["servobench", *command.split(), "-q"])
        monkeypatch.setattr(sys, "dont_write_bytecode", True)  # as NO_BYTECODE
        monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")  # for the processes it starts
        size = limits[0] if blocks is None else blocks << 10
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
        try:
            with pytest.raises(SystemExit) as ended:
                main.main()
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        return ended.value.code or 0, capfd.readouterr().err

    return call


def test_a_recording_that_cannot_grow_costs_neither_rows_nor_report(tmp_path):
    # The recording of two seconds has 1.4 MiB; the room that is reserved for the rows is smaller.
    code, err = limited(1260, f"run still --out out {QUICK} --set camera.noise=40", tmp_path)
    assert (code, err) == (
        1,
        "servobench: out/run.rrd: this output ends too early (run again for all of it): the disk refuses more (is a quota or a limit of file sizes "
        "reached?)\n",
    )
    assert pq.read_table(tmp_path / "out" / "steps.parquet").num_rows == 60
    assert json.loads((tmp_path / "out" / "report.json").read_text())["outcome"] == "TIMED_OUT"


def test_without_room_for_the_rows_a_run_does_not_begin(tmp_path):
    code, err = limited(300, f"run still --out out --mcap out.mcap {QUICK}", tmp_path)
    assert (code, err) == (
        1,
        "servobench: out/steps.arrows: the disk has no room for the table: File too large: make room, or choose another folder\n",
    )
    assert list(tmp_path.rglob("*")) == [tmp_path / "out"]


@pytest.fixture
def pictures(tmp_path):
    (tmp_path / "seen").mkdir()
    for k in range(90):
        image = np.random.default_rng(k).integers(0, 255, (60, 80, 3), np.uint8)
        cv2.imwrite(str(tmp_path / "seen" / f"{k:02}.png"), image)
    (tmp_path / "seen" / "groundtruth.txt").write_text("20,20,20,20\n" * 90)
    return tmp_path


def test_a_track_keeps_the_rows_that_fit(here, pictures):
    code, err = here(4, "track seen --tracker frozen --out out")
    assert (code, err) == (1, "servobench: out/track.csv: File too large\n")
    rows = (pictures / "out" / "track.csv").read_text().splitlines()
    assert len(rows) > 10
    assert rows[1].startswith("0,0.000000,30,30,")


@pytest.mark.parametrize("workers", [1, 2])
def test_a_bench_stops_at_the_first_file_that_does_not_fit(here, pictures, workers):
    command = "evaluate seen --trackers frozen --out out --seeds 2 --workers"
    code, err = here(4, f"{command} {workers}")
    assert code == 1
    assert err == FULL
    assert here(None, f"{command} 1") == (0, "")


def test_papers_stop_likewise(here):
    code, err = here(1, "papers P1-4b --quick --out out --workers 1")
    assert code == 1
    assert err.endswith(FULL)  # after a line where the loops are not yet compiled and stored


def test_a_recording_for_which_there_is_no_room_does_not_begin(pictures):
    # The table has 8.1 KiB, a little more or less with the times in it.
    code, err = limited(12, "track seen --tracker frozen --out out -q --rerun", pictures)
    assert (code, err) == (
        1,
        "servobench: out/track.rrd: this output ends too early (run again for all of it): File too large\n",
    )
    assert len((pictures / "out" / "track.csv").read_text().splitlines()) == 91
    assert not (pictures / "out" / "track.rrd").exists()


@pytest.mark.parametrize("extra", ["--video out.mp4", "--mcap out.mcap", "--rerun"])
def test_a_video_or_a_recording_that_cannot_grow_costs_no_row(pictures, extra):
    file = extra.partition(" ")[2] or "out/track.rrd"
    code, err = limited(30, f"track seen --tracker frozen --out out -q {extra}", pictures)
    assert code == 1
    assert err.startswith(
        f"servobench: {file}: this output ends too early (run again for all of it): "
    )
    assert not (pictures / "out.mp4").exists()  # not a second of it has found room
    assert err.count("\n") == 1
    assert len((pictures / "out" / "track.csv").read_text().splitlines()) == 91
    assert json.loads((pictures / "out" / "report.json").read_text())["frames"] == 90


def test_a_check_keeps_the_older_file_where_the_new_one_has_no_room(here, tmp_path):
    (tmp_path / "out.xml").write_text("older")
    code, err = here(1, "check still --set run.duration=0.1 --seeds 3 --workers 1 --junit out.xml")
    assert code == 1
    assert err.endswith(
        "servobench: out.xml: cannot write this file: File too large; remove the cause, and run again\n"
    )
    assert (tmp_path / "out.xml").read_text() == "older"
    assert list(tmp_path.iterdir()) == [tmp_path / "out.xml"]


def test_a_page_that_has_no_room_is_not_written(tmp_path):
    limited(100_000, f"run still --out out --no-rerun {QUICK} --set run.duration=0.1", tmp_path)
    code, err = limited(8, "report out --out page.html", tmp_path)
    assert (code, err) == (
        1,
        "servobench: page.html: cannot write this page: File too large; remove the cause, and run again\n",
    )
    assert list(tmp_path.iterdir()) == [tmp_path / "out"]


def test_a_film_of_two_runs_that_cannot_be_played_is_not_left(tmp_path):
    run = f"'still {QUICK} --set run.duration=0.1'"
    code, err = limited(8, f"film {run} {run} --out film.mp4 -q", tmp_path)
    assert (code, err) == (1, "servobench: film.mp4: File too large\n")
    assert list(tmp_path.iterdir()) == []
