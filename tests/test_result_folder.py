"""The folders of benches and papers: whose they are, by which code, and what is damaged in them."""

import csv
import json
import shutil
import sys

import pytest

from servo.cli import main
from servo.output.result_folder import Begun, only_writer, result_folder
from servo.output.versions import SOURCE, source_digest

BENCH = ("bench", "suite.toml", "--seeds", "2", "--workers", "1", "--out", "out")
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


def errors(place):
    with (place / "out" / "runs.csv").open() as file:
        return [row["mean_error_px"] for row in csv.DictReader(file)]


def without_the_sum(text):
    return json.dumps({k: v for k, v in json.loads(text).items() if k != "sha256"})


def with_another_number(text):
    document = json.loads(text)
    document["result"]["measures"]["mean_error_px"] = 0.0
    return json.dumps(document)


DAMAGE = {
    "a list": lambda text: "[]",
    "null": lambda text: "null",
    "a number": lambda text: "3",
    "no JSON": lambda text: text[: len(text) // 2],
    "nothing": lambda text: "",
    "zeros": lambda text: "\0" * 100,
    "too deep": lambda text: "[" * 100_000,
    "no result": lambda text: json.dumps(json.loads(text) | {"result": None}),
    "a nested result": lambda text: json.dumps(json.loads(text) | {"result": {"result": {}}}),
    "no sum": without_the_sum,
    "another number": with_another_number,
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_result_is_named_and_computed_again(monkeypatch, capfd, place, damage):
    before = errors(place)
    path = place / "out" / "results" / "frozen" / "clutter-a-1.json"
    path.write_text(DAMAGE[damage](path.read_text()))
    assert call(monkeypatch, capfd, *BENCH, "-q") == (
        0,
        "servobench: out/results/frozen/clutter-a-1.json: this result is damaged; it is "
        "computed again\n",
    )
    assert errors(place) == before
    assert call(monkeypatch, capfd, *BENCH, "-q") == (0, "")


def begun(place, **changed):
    path = place / "out" / Begun.FILE
    path.write_text(json.dumps(json.loads(path.read_text()) | changed))


def test_results_of_other_code_are_refused(monkeypatch, capfd, place):
    versions = json.loads((place / "out" / Begun.FILE).read_text())["versions"]
    assert versions[SOURCE] == source_digest()
    begun(place, versions=versions | {SOURCE: "abc"})
    assert call(monkeypatch, capfd, *BENCH, "-q") == (
        2,
        "servobench: out: this was begun with servobench source abc, but "
        f"{source_digest()} is installed: the numbers could not be compared; choose another folder "
        "with --out\n",
    )


def test_results_of_another_command_are_refused(monkeypatch, capfd, place):
    for words in (("papers", "P1-3", "--quick"), ("bench", "closed_loop", "--trackers", "frozen")):
        assert call(monkeypatch, capfd, *words, "--workers", "1", "--out", "out", "-q") == (
            2,
            "servobench: out: this folder holds results of another command; choose another "
            "folder with --out\n",
        )


def test_a_folder_of_something_else_is_refused(monkeypatch, capfd, place):
    (place / "out" / Begun.FILE).unlink()
    assert call(monkeypatch, capfd, *BENCH, "-q") == (
        2,
        "servobench: out: there is something in this folder, but no begun.json of `servobench "
        "bench`; choose another folder with --out\n",
    )


def test_a_result_of_another_format_is_named_and_computed_again(monkeypatch, capfd, place):
    path = place / "out" / "results" / "frozen" / "clutter-a-1.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"format": 2}))
    assert call(monkeypatch, capfd, *BENCH, "-q") == (
        0,
        "servobench: out/results/frozen/clutter-a-1.json: this file has format 2, and this "
        "version of servobench reads format 1; it is computed again\n",
    )


def test_a_beginning_of_another_format_is_refused(monkeypatch, capfd, place):
    begun(place, format=2)
    assert call(monkeypatch, capfd, *BENCH, "-q") == (
        2,
        "servobench: out/begun.json: this file has format 2, and this version of servobench "
        "reads format 1; choose another folder with --out\n",
    )


@pytest.mark.parametrize("text", ["", "[]", "null", "3", "{"])
def test_a_damaged_beginning_is_refused(monkeypatch, capfd, place, text):
    (place / "out" / Begun.FILE).write_text(text)
    code, err = call(monkeypatch, capfd, *BENCH, "-q")
    assert code == 2
    assert err.startswith("servobench: out/begun.json: this file is damaged, so the results")


def test_one_command_writes_into_a_folder_at_a_time(monkeypatch, capfd, place):
    with only_writer(place / "out", Begun, "bench"):
        assert call(monkeypatch, capfd, *BENCH, "-q") == (
            2,
            "servobench: out: another command is writing into this folder\n",
        )
    assert call(monkeypatch, capfd, *BENCH, "-q") == (0, "")


def test_an_exception_in_the_block_lets_others_write(tmp_path):
    with pytest.raises(KeyError), result_folder(tmp_path / "new", "bench"):
        raise KeyError("a bug")
    with result_folder(tmp_path / "new", "bench"):
        assert json.loads((tmp_path / "new" / Begun.FILE).read_text())["holds"] == "bench"


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
