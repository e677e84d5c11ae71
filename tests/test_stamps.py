"""Stamps of bags and videos: kept in track.csv, in the log for Foxglove and in the report."""

import json

import pytest
from tracked import REGION, call, image, rows_of

from tracking.evaluation.track_file import stamp_text

bags = pytest.importorskip("bags", reason="rosbags and mcap are not installed")
NS = 10**9
STAMPS = [bags.START * NS + ns for ns in (250_000_001, 300_000_002, 600_000_003)]


def pictures(store):
    """Three pictures that were recorded 0.5 s after their stamps."""
    for k, ns in enumerate(STAMPS):
        message = bags.raw(store, 0.0, image(k), "bgr8")
        message.header.stamp.sec = ns // NS
        message.header.stamp.nanosec = ns % NS
        yield ns / NS + 0.5, bags.RAW, message


@pytest.mark.parametrize("form", ["log.mcap", "log.bag", "log_db3"])
def test_the_stamps_of_a_bag_are_kept(monkeypatch, capfd, tmp_path, form):
    from mcap.reader import make_reader

    monkeypatch.chdir(tmp_path)
    bags.write(tmp_path / form, {"/eye": lambda store: list(pictures(store))})
    more = ["--tracker", "frozen", "--out", "out", "--mcap", "track.mcap", "-q"]
    assert call(monkeypatch, capfd, form, "--region", REGION, *more)[0] == 0
    rows = rows_of(tmp_path / "out" / "track.csv")
    assert [row["stamp"] for row in rows] == [
        "1700000000.250000001",
        "1700000000.300000002",
        "1700000000.600000003",
    ]
    assert [float(row["time"]) for row in rows] == pytest.approx([0.0, 0.05, 0.35], abs=1e-6)
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["start"] == pytest.approx(STAMPS[0] / NS, abs=1e-6)
    with (tmp_path / "track.mcap").open("rb") as file:
        found = list(make_reader(file).iter_messages("/shot"))
    assert [message.log_time for _, _, message in found] == STAMPS


@pytest.mark.parametrize(
    ("stamp", "text"), [(None, ""), (0, "0.000000000"), (-1_500_000_000, "-1.500000000")]
)
def test_a_stamp_has_all_its_digits(stamp, text):
    assert stamp_text(stamp) == text
