"""Checks for other programs: JUnit's XML, JSON, and scenario files as pytest's tests."""

import json
import os
import subprocess
import sys
from itertools import islice
from xml.etree import ElementTree

import pytest

from servo.cli import check_command, jobs
from servo.cli.check_command import run as check_scenarios
from servo.mistake import Mistake
from servo.study.execute import execute

SHORT = """[run]
duration = 0.3
[start]
x = 9
[tracker]
kind = "frozen"
[expect]
servo_rms_px = {bound}
"""


def checked(tmp_path, bound, **files):
    path = tmp_path / "mine.toml"
    path.write_text(SHORT.format(bound=bound))
    return path, check_scenarios([str(path)], ["start.x=9"], 3, 2, 1, quiet=True, **files)


@pytest.mark.parametrize(
    ("change", "is_refused"),
    [
        ("run.seed=1", True),
        ("run={seed=1,duration=0.2}", True),
        ("run={duration=0.2}", False),
        ('run.scheduler="seed"', False),
        ('tracker={kind="frozen"}', False),
    ],
)
def test_only_a_seed_is_refused_among_the_settings_of_a_run(change, is_refused, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(SHORT.format(bound=1e3))
    sentence = f"--set {change}: check sets this key by --seed and --seeds: use these options"
    with pytest.raises(Mistake) as refused:
        check_scenarios([str(path)], [change, "camera.width=-1"], 3, 2, 1, quiet=True)
    assert (str(refused.value) == sentence) == is_refused


def test_a_missed_bound_is_a_failure_with_its_command(tmp_path, capsys):
    files = {"junit": tmp_path / "out.xml", "json": tmp_path / "out.json"}
    path, code = checked(tmp_path, 0.001, **files)
    suite = ElementTree.parse(files["junit"]).getroot()
    assert code == 1
    counts = {key: suite.get(key) for key in ("tests", "failures", "errors")}
    assert counts == {"tests": "2", "failures": "2", "errors": "0"}
    case, failure = suite[1], suite[1][0]
    assert (case.get("classname"), case.get("name")) == ("servobench.mine", "mine, seed 4")
    assert failure.get("message").startswith("servo_rms_px is ")
    assert failure.get("message").endswith(", expected at most 0.001")
    again = f"servobench run {path} --set start.x=9 --seed 4"
    assert failure.text == f"again: {again}"
    found = json.loads(files["json"].read_text())
    assert found["command"] == f"servobench check {path} --set start.x=9 --seed 3 --seeds 2"
    assert (found["kind"], found["format"], len(found["runs"])) == ("check", 1, 2)
    run = found["runs"][1]
    assert (run["command"], run["outcome"], run["failed"]) == (again, "CONVERGED", "")
    assert run["missed"][0]["found"] == run["measures"]["servo_rms_px"]
    capsys.readouterr()


DRAWN = """[run]
duration = 0.3
[tracker]
kind = "frozen"
[vary]
start.x = {{ choice = [0.0, 50.0] }}
[expect]
outcome = "CONVERGED"
servo_rms_px = 0.5
[expect.drawn]
servo_rms_px = {bound}
success_rate = {rate}
"""
"""Of seeds 3 to 6, the last two draw 50 px and end TIMED_OUT."""


def test_some_drawn_seeds_may_end_otherwise(tmp_path, capsys):
    path = tmp_path / "mine.toml"
    path.write_text(DRAWN.format(bound=0.5, rate=0.5))
    files = {"junit": tmp_path / "out.xml", "json": tmp_path / "out.json"}
    assert check_scenarios([str(path)], [], 3, 4, 1, quiet=False, **files) == 0
    out = capsys.readouterr().out
    assert (
        "mine: 2 of 4 drawn seeds ended as expected; at least 2 must (expect.drawn.success_rate: 0.5)\n"
        in out
    )
    assert [line.split()[-3] for line in out.splitlines() if "TIMED_OUT" in line] == ["counted"] * 2
    share = {"scenario": "mine", "ended": 2, "seeds": 4, "success_rate": 0.5}
    assert json.loads(files["json"].read_text())["shares"] == [share]
    case = ElementTree.parse(files["junit"]).getroot()[-1]
    assert (case.get("name"), len(case)) == ("mine, drawn seeds", 0)


def test_too_few_drawn_seeds_that_end_as_expected_miss_their_bound(tmp_path, capsys):
    path = tmp_path / "mine.toml"
    path.write_text(DRAWN.format(bound=-1, rate=0.75))
    junit = tmp_path / "out.xml"
    assert check_scenarios([str(path)], [], 3, 4, 1, quiet=True, junit=junit) == 1
    sentence = "mine: 2 of 4 drawn seeds ended as expected; at least 3 must (expect.drawn.success_rate: 0.75)"
    err = capsys.readouterr().err
    assert f"missed: {sentence}\n" in err
    assert err.count(", expected at most -1 (expect.drawn)\n") == 2  # not of those that are counted
    failure = ElementTree.parse(junit).getroot()[-1][0]
    again = f"again: servobench check {path} --seed 3 --seeds 4"
    assert (failure.get("message"), failure.text) == (sentence, again)


def test_reading_many_scenarios_shows_progress(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(jobs, "FIRST", 0.0)
    monkeypatch.setattr(jobs, "EVERY", 0.0)
    path = tmp_path / "mine.toml"
    path.write_text(SHORT.format(bound=1000))
    assert check_scenarios([str(path)], [], 0, 2, 1, quiet=False) == 0
    out, err = capsys.readouterr()
    assert out.startswith("check: 2 runs\n")
    read, first, *_ = err.splitlines()
    assert read.startswith(f"check: reading scenarios: 1 of 2, {path}, ")
    assert first.startswith("check: 1 of 2, mine, seed 0, ")


def test_kept_bounds_are_passed_tests(tmp_path):
    _, code = checked(tmp_path, 1000, junit=tmp_path / "out.xml")
    suite = ElementTree.parse(tmp_path / "out.xml").getroot()
    assert (code, suite.get("failures"), [len(case) for case in suite]) == (0, "0", [0, 0])


@pytest.mark.parametrize("name", ["bell\x07", "escape\x1b[31m", os.fsdecode(b"latin\xe9")])
def test_a_name_that_xml_cannot_have_is_written_out(tmp_path, name):
    path = tmp_path / f"{name}.toml"
    path.write_text(SHORT.format(bound=0.001))
    files = {"junit": tmp_path / "out.xml", "json": tmp_path / "out.json"}
    assert check_scenarios([str(path)], [], 0, 1, 1, quiet=True, **files) == 1
    case = ElementTree.parse(files["junit"]).getroot()[0]
    shown = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in name)
    assert (case.get("name"), case.get("classname")) == (f"{shown}, seed 0", f"servobench.{shown}")
    assert shown in case[0].text
    assert len(json.loads(files["json"].read_text())["runs"]) == 1


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("x/out.xml", "there is no folder .*/x: make it first$"),
        ("folder.xml", r"this is not a file; name a file to write, such as x\.xml$"),
        (
            "link.xml",
            "this is a link, and nothing is written through a link: name the file itself$",
        ),
    ],
)
def test_a_file_that_cannot_be_written_is_refused_before_the_runs(tmp_path, name, sentence):
    (tmp_path / "folder.xml").mkdir()
    (tmp_path / "link.xml").symlink_to("/dev/null")
    sentence = f"/{name}: {sentence}"
    with pytest.raises(Mistake, match=sentence):
        checked(tmp_path, 1000, junit=tmp_path / name)


def test_no_scenario_is_overwritten(tmp_path):
    """As `--junit scenes/*.toml` would do, of which the shell makes a file and scenarios."""
    with pytest.raises(Mistake, match=r"mine\.toml: the name of this file should end in \.json$"):
        checked(tmp_path, 1000, json=tmp_path / "mine.toml")
    assert (tmp_path / "mine.toml").read_text() == SHORT.format(bound=1000)


def test_a_scenario_that_cannot_be_read_is_an_error_in_the_files(tmp_path):
    (tmp_path / "wrong.toml").write_text("[run]\nduration = -1\n")
    files = {"junit": tmp_path / "out.xml", "json": tmp_path / "out.json"}
    with pytest.raises(Mistake, match="duration"):
        check_scenarios([str(tmp_path / "wrong.toml")], [], 0, 1, 1, quiet=True, **files)
    suite = ElementTree.parse(files["junit"]).getroot()
    assert (suite.get("tests"), suite.get("errors")) == ("1", "1")
    assert "duration" in suite[0].find("error").get("message")
    (run,) = json.loads(files["json"].read_text())["runs"]
    assert "duration" in run["failed"]


def pytest_in(folder, *words):
    command = [sys.executable, "-m", "pytest", "-n", "0", "-p", "no:cacheprovider", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_a_run_without_bounds_is_skipped_and_told(tmp_path, capfd):
    scenario = tmp_path / "own.toml"
    scenario.write_text('[run]\nduration = 0.1\n\n[expect]\noutcome = "TIMED_OUT"\n')
    xml, found = tmp_path / "own.xml", tmp_path / "own.json"
    changes = ["tracker.kind=frozen"]
    assert check_scenarios([str(scenario)], changes, 0, 1, 1, False, junit=xml, json=found) == 0
    why = "No verdict: the bounds are made for pf_ssd, and there are none for frozen."
    assert capfd.readouterr().err == f"1 of 1 runs (own): {why}\n"
    suite = ElementTree.parse(xml).getroot()
    assert (suite.get("skipped"), suite.get("failures")) == ("1", "0")
    assert suite.find("testcase/skipped").get("message") == why
    assert json.loads(found.read_text())["runs"][0]["unjudged"] == why


def test_a_check_that_is_stopped_leaves_what_had_ended(tmp_path, monkeypatch):
    def stop(jobs, pool):
        yield from islice(execute(jobs, pool), 1)
        raise KeyboardInterrupt

    monkeypatch.setattr(check_command, "execute", stop)
    xml = tmp_path / "own.xml"
    with pytest.raises(KeyboardInterrupt):
        check_scenarios(["still"], ["run.duration=0.1", "expect={}"], 0, 2, 1, True, junit=xml)
    ended, stopped = ElementTree.parse(xml).getroot().findall("testcase")
    assert ended.find("error") is None
    assert stopped.find("error").get("message") == "the check was stopped before this run ended"
