"""The folder of a bench: whose it is, and by which code."""

import json
import shutil
import sys

import pytest

from servo.cli import main

BENCH = ("evaluate", "suite.toml", "--seeds", "2", "--workers", "1", "--out", "out")
SUITE = """
[[sequences]]
kind = "clutter"
frames = 5

[[trackers]]
kind = "frozen"
"""


def call(monkeypatch, capfd, *arguments):
    monkeypatch.setattr(sys, "argv", ["servobench", *arguments])
    with pytest.raises(SystemExit) as ended:
        main.main()
    return ended.value.code or 0, capfd.readouterr().err


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    there = tmp_path_factory.mktemp("bench")
    (there / "suite.toml").write_text(SUITE)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(there)
        patch.setattr(sys, "argv", ["servobench", *BENCH, "-q"])
        with pytest.raises(SystemExit):
            main.main()
    return there


@pytest.fixture
def place(finished, tmp_path, monkeypatch):
    shutil.copytree(finished, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_results_of_another_command_are_refused(monkeypatch, capfd, place):
    words = ("evaluate", "closed_loop", "--trackers", "frozen", "--seeds", "1")
    assert call(monkeypatch, capfd, *words, "--workers", "1", "--out", "out", "-q") == (
        2,
        "servobench: out: this folder holds results of another command; choose another folder "
        "with --out\n",
    )


def test_a_folder_of_something_else_is_refused(monkeypatch, capfd, place):
    (place / "out" / "study.json").unlink()
    assert call(monkeypatch, capfd, *BENCH, "-q") == (
        2,
        "servobench: out: this folder has files, but no study.json of `servobench "
        "evaluate`; choose another folder with --out\n",
    )


def test_a_description_of_another_format_is_refused(monkeypatch, capfd, place):
    path = place / "out" / "study.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"format": 3}))
    assert call(monkeypatch, capfd, *BENCH, "-q") == (
        2,
        "servobench: out/study.json: this file has format 3, and this version of servobench "
        "reads format 2, so the runs in this folder cannot be used; choose another folder with "
        "--out\n",
    )


def test_the_digest_changes_with_the_source_and_not_with_the_readmes_pictures(
    monkeypatch, tmp_path
):
    from servo.output import versions

    for name in ("one.py", "pictures/seen.png"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("a = 1\n")
    monkeypatch.setattr(versions, "PACKAGES", ("anything",))
    monkeypatch.setattr(versions.resources, "files", lambda package: tmp_path)
    digest = versions.source_digest.__wrapped__
    before = digest()
    (tmp_path / "pictures" / "seen.png").write_text("another")
    assert digest() == before
    (tmp_path / "one.py").write_text("a = 2\n")
    assert digest() != before
