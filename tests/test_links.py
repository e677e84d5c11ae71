"""Nothing is written through a link: the folder of a study may come from somebody else."""

import shutil
import sys

import pytest

from servo.cli import main

STUDY = """# mine
# A car that stands.
scenario = "still"
seeds = 2

[set]
run.duration = 0.1
tracker.kind = "frozen"
estimator.kind = "none"
"""


def sweep(monkeypatch, capfd):
    words = ["servobench", "sweep", "mine.toml", "--out", "out", "--workers", "1"]
    monkeypatch.setattr(sys, "argv", words)
    with pytest.raises(SystemExit) as ended:
        main.main()
    return ended.value.code or 0, capfd.readouterr().err


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A folder with both runs; copy it to change it."""
    there = tmp_path_factory.mktemp("finished")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(there)
        (there / "mine.toml").write_text(STUDY)
        patch.setattr(sys, "argv", ["servobench", "sweep", "mine.toml", "--out", "out", "-q"])
        with pytest.raises(SystemExit):
            main.main()
    return there


@pytest.fixture
def place(finished, tmp_path, monkeypatch):
    shutil.copytree(finished, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def folder(place):
    return place / "out"


LINKS = ["runs", "failures", "study.json", ".lock", "results.parquet", "cells.csv",
         "runs/000000.parquet", "runs/.000000.parquet.part", ".cells.csv.part"]  # fmt: skip


@pytest.mark.parametrize("link", LINKS)
def test_nothing_is_written_through_a_link(monkeypatch, capfd, folder, place, link):
    precious = place / "precious"
    precious.mkdir()
    (precious / "file").write_text("mine")
    target = precious if link in ("runs", "failures") else precious / "file"
    if link == "study.json":  # it has to be the study's, to come to writing at all
        shutil.copy(folder / link, precious / "file")
    before = (precious / "file").read_bytes()
    path = folder / link
    if path.is_dir():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)
    path.symlink_to(target)
    (folder / "runs" / "000001.parquet").unlink(missing_ok=True)
    code, err = sweep(monkeypatch, capfd)
    assert "Traceback" not in err
    assert (code == 0) == (link not in ("runs", "failures", ".lock"))
    assert (precious / "file").read_bytes() == before
    assert [p.name for p in precious.iterdir()] == ["file"]
