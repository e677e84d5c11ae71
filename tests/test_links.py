"""Nothing is written through a link: the folder of a study may come from somebody else."""

import shutil
import sys

import pytest

from servo.cli import main

pytestmark = pytest.mark.usefixtures("no_workers")


def sweep(monkeypatch, capfd):
    words = ["servobench", "sweep", "mine.toml", "--out", "out"]
    monkeypatch.setattr(sys, "argv", words)
    with pytest.raises(SystemExit) as ended:
        main.main()
    return ended.value.code or 0, capfd.readouterr().err


@pytest.fixture
def place(finished_study, study_place):
    """The study with its finished runs in `out`."""
    shutil.copytree(finished_study, study_place / "out")
    return study_place


@pytest.fixture
def folder(place):
    return place / "out"


LINKS = [
    "failures",
    "study.json",
    ".lock",
    "results.parquet",
    "cells.csv",
    "series.parquet",
    "runs.sqlite",
    "runs.sqlite-wal",
    ".cells.csv.part",
]


@pytest.mark.parametrize("link", LINKS)
def test_nothing_is_written_through_a_link(monkeypatch, capfd, folder, place, link):
    precious = place / "precious"
    precious.mkdir()
    (precious / "file").write_text("mine")
    target = precious if link == "failures" else precious / "file"
    if link == "study.json":  # it has to be the study's, to come to writing at all
        shutil.copy(folder / link, precious / "file")
    before = (precious / "file").read_bytes()
    path = folder / link
    if path.is_dir():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)
    path.symlink_to(target)
    code, err = sweep(monkeypatch, capfd)
    assert "Traceback" not in err
    assert (code == 0) == (link not in (".lock", "runs.sqlite", "runs.sqlite-wal"))
    assert (precious / "file").read_bytes() == before
    assert [p.name for p in precious.iterdir()] == ["file"]
