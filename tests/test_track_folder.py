"""A track's files beside its rows: where the disk refuses one, the others go on."""

from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow.parquet as pq
import pytest
from tracked import rows_of

from servo.mistake import Refused
from servo.output import track_folder
from servo.output.track_folder import TrackFolder
from tracking.evaluation.track import Shot
from tracking.evaluation.track_file import HEADER, read
from tracking.sequences.sources import Picture
from tracking.types import Estimate, Region, State, Status


class Extra:
    """A file that refuses some acts, and says what it was asked for."""

    def __init__(self, refuses=None, error=None):
        self.refuses, self.error, self.done = refuses, error, []

    def _do(self, act):
        self.done.append(act)
        if act == self.refuses:
            raise self.error

    def add(self, shot, *_):
        self._do("add" if shot.index else "begin")

    def close(self):
        self._do("close")

    def abandon(self):
        self._do("abandon")


def shot(k):
    estimate = Estimate(State(20.0, 15.0), np.eye(4), 0.1, Status.LOCKED)
    return Shot(Picture(f"{k}.png", k / 30, None), k, estimate, 0.002, (64, 48))


def tracked(folder, extras, count=3):
    """The folder after some shots."""
    more = {folder / name: extra for name, extra in extras.items()}
    files = TrackFolder(folder, Region(10.0, 6.0), recording=False, more=more)
    for k in range(count):
        files.add(shot(k), None)
    files.close()
    assert len((folder / "track.csv").read_text().splitlines()) == 1 + count
    return files


def test_rows_have_the_names_of_the_pictures_whatever_these_are(tmp_path):
    names = ["IMG_7.png", 'a, "b"\n.png', "\udcfd.png", "NA", "7"]
    files = TrackFolder(tmp_path, Region(10.0, 6.0), recording=False)
    for k, name in enumerate(names):
        files.add(replace(shot(k), picture=Picture(name, k / 30, None)), None)
    files.close()
    names[2] = r"\udcfd.png"
    assert [row["name"] for row in rows_of(tmp_path / "track.csv")] == names
    assert pq.read_table(tmp_path / "track.parquet")["name"].to_pylist() == names
    assert len(read(tmp_path / "track.csv").states) == files.count == 5


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (OSError(28, "No space left on device"), "No space left on device"),
        (OSError("odd"), "odd"),
        (Refused("here: the recording ends: the disk refuses more"), "the disk refuses more"),
    ],
)
@pytest.mark.parametrize(
    ("act", "done"),
    [
        ("begin", ["begin", "abandon"]),
        ("add", ["begin", "add", "abandon"]),
        ("close", ["begin", "add", "add", "close", "abandon"]),
    ],
)
def test_what_the_disk_refuses_is_left_and_named(tmp_path, act, done, error, reason):
    bad, good = Extra(act, error), Extra()
    files = tracked(tmp_path, {"track.mp4": bad, "track.rrd": good})
    assert (
        str(files.refused)
        == f"{tmp_path}/track.mp4: this output ends too early (run again for all of it): {reason}"
    )
    assert bad.done == done
    assert good.done == ["begin", "add", "add", "close"]
    assert [path.name for path in files.paths] == ["track.csv", "track.parquet", "track.rrd"]


def test_the_first_of_two_refusals_is_named(tmp_path):
    bad, worse = Extra("begin", OSError("first")), Extra("add", OSError("second"))
    files = tracked(tmp_path, {"a": worse, "b": bad})
    assert (
        str(files.refused)
        == f"{tmp_path}/b: this output ends too early (run again for all of it): first"
    )


def test_after_each_row_room_is_looked_for_and_where_there_is_none_only_rows_go_on(
    tmp_path, monkeypatch
):
    """With exactly what is kept free there is enough."""
    free = [track_folder.SPARE, track_folder.SPARE - 1]

    def disk_usage(folder):
        return SimpleNamespace(free=free.pop(0))

    monkeypatch.setattr(track_folder.shutil, "disk_usage", disk_usage)
    extra = Extra()
    files = tracked(tmp_path, {"a": extra}, 3)
    assert (
        str(files.refused)
        == f"{tmp_path}/a: this output ends too early (run again for all of it): the disk is full"
    )
    assert extra.done == ["begin", "abandon"]


def test_a_recording_without_room_does_not_begin(tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as full:
        full.setattr(Path, "write_bytes", refuse)
        files = TrackFolder(tmp_path, Region(10.0, 6.0), recording=True)
    files.add(shot(0), None)
    files.close()
    assert str(files.refused) == (
        f"{tmp_path}/track.rrd: this output ends too early (run again for all of it): No space left on device"
    )
    assert sorted(path.name for path in tmp_path.iterdir()) == ["track.csv", "track.parquet"]


def test_the_rows_are_a_parquet_table_too_with_all_digits_of_a_stamp(tmp_path):
    stamp = 1_700_000_000_250_000_001
    files = TrackFolder(tmp_path, Region(10.0, 6.0), recording=False)
    files.add(shot(0), None)
    files.add(replace(shot(1), picture=Picture("1.png", 1 / 30, None, stamp=stamp)), None)
    files.close()
    table = pq.read_table(tmp_path / "track.parquet")
    assert table.column_names == list(HEADER)
    # Also where all values are whole, as angle and scale here.
    assert {str(table[name].type) for name in ("x", "theta", "scale", "width")} == {"double"}
    assert table["stamp"].to_pylist() == [None, Decimal("1700000000.250000001")]
    assert table["status"].to_pylist() == ["LOCKED", "LOCKED"]
    assert table["x1"].to_pylist() == [15.0, 15.0]
