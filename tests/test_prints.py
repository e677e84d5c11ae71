"""What is printed and drawn beside tables: doctor, reports of runs, sheets, the viewer's layout."""

import io
import re
import sys
from contextlib import nullcontext
from dataclasses import replace
from importlib.util import find_spec, module_from_spec
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console
from servoing import METRIC

from servo.cli import (
    check_command,
    doctor_command,
    list_command,
    main,
    papers_command,
    run_command,
    terminal,
    track_command,
)
from servo.loop.measure import MEASURES
from servo.output import versions as found_versions
from servo.output.formats import command_line
from servo.output.recording import layout
from servo.papers.claim import Claim, Rule, Verdict
from servo.papers.claims import Judged
from servo.scenario.load import load
from servo.study.bounds import missed_bounds
from servo.study.run import Job, Record
from servo.study.scenario_run import LoadedScenario
from tracking.drawing import contact_sheet
from tracking.evaluation.track import Shot, Track
from tracking.evaluation.track_measures import Comparison
from tracking.sequences.sources import End, PaintedSource, Picture
from tracking.statistics.comparisons import Interval
from tracking.statistics.verdicts import Finding
from tracking.types import Estimate, Region, State, Status


@pytest.fixture
def console(monkeypatch):
    found = Console(width=120, record=True, file=io.StringIO())
    monkeypatch.setattr(doctor_command, "Console", lambda: found)
    monkeypatch.setattr(list_command, "Console", lambda: found)
    return found


def lines(console):
    return [line.rstrip() for line in console.export_text(styles=False).splitlines()]


def test_the_doctor_says_this(console, monkeypatch, approved, capsys):
    monkeypatch.setattr(doctor_command.gl, "is_there", lambda: True)
    monkeypatch.setattr(doctor_command.gl, "backend", lambda: "egl")
    monkeypatch.setattr(doctor_command.platform, "python_version", lambda: "3.x")
    monkeypatch.setattr(doctor_command, "versions", lambda: {"mujoco": "4.x"})
    monkeypatch.setattr(doctor_command.gl, "describe", lambda: "a renderer")
    monkeypatch.setattr(doctor_command, "running", lambda: "5.x without the additional modules")

    step = SimpleNamespace(seconds=SimpleNamespace(render=0.002))
    monkeypatch.setattr(doctor_command, "Episode", lambda _: nullcontext([step]))
    assert doctor_command.run() == 0
    approved("prints/doctor", lines(console))
    monkeypatch.setattr(doctor_command, "clash", lambda: "uninstall one")
    assert doctor_command.run() == 1
    assert capsys.readouterr().err == (
        "servobench: uninstall one; OpenCV 5.x without the additional modules is used\n"
    )
    assert doctor_command.FINE not in lines(console)


@pytest.mark.newest
def test_the_report_of_a_run_is_printed_so(console, approved):
    scenario = load("reversal", ["expect.servo_rms_px=0.1"], 4)
    measures = {name: 0.37 * (k + 1) for k, name in enumerate(MEASURES)}
    record = Record(
        subject=scenario.name,
        seed=4,
        command=command_line("run", "reversal", set=["a=b c"], seed=4),
        outcome="CONVERGED",
        success=True,
        measures=measures,
        missed=missed_bounds(
            "CONVERGED", measures, {"servo_rms_px": 0.1, "outcome": "TIMED_OUT", "lost_pct": 90.0}
        ),
        seconds=2.345,
    )
    run_command._print_record(console, scenario, record, features=4, all_measures=True)
    run_command.print_missed(console, record)
    job = Job(0, LoadedScenario(scenario), 4)
    kept = replace(record, missed=(), seconds=0.1)
    terminal.print_table(console, check_command._table([(job, record), (job, kept)]))
    approved("prints/run", lines(console))


@pytest.mark.parametrize("pose", [(), ("end_position_mm", "end_rotation_deg", "retreat_m")])
def test_a_run_with_six_features_tells_where_the_camera_ends(pose):
    record = SimpleNamespace(measures=dict.fromkeys(MEASURES, 0.37))
    features = 6 if pose else 5
    told = ["servo_rms_px", "servo_peak_px", "tracking_rms_px", *pose]
    line = run_command._bounds_line(load("reversal", ["expect={}"]), record, features)
    assert line == "  " + ", ".join(f"{name} 0.37" for name in told)
    bounded = load("reversal", ["expect={retreat_m=0.2}"])
    others = [f"{name} 0.37" for name in pose if name != "retreat_m"]
    line = run_command._bounds_line(bounded, record, features)
    assert line == "  " + ", ".join(["retreat_m 0.37 (bound 0.2)", *others])


def test_bounds_of_a_run_that_is_too_short_are_missed_in_one_line(tmp_path, capfd):
    changes = ["run.duration=0.1"]
    run_command.run("circle", changes, None, tmp_path / "o", quiet=True, no_rerun=True)
    first, again, *_ = capfd.readouterr().err.splitlines()
    names = "servo_rms_px, servo_peak_px, servo_angle_peak_deg, servo_scale_peak_pct, "
    assert first == (
        f"missed: {names}tracking_rms_px, tilt_peak_deg: no value, because the run ended before "
        "measure.after"
    )
    assert again.startswith("  again: servobench run circle ")


def test_a_run_without_a_picture_that_counts_says_so():
    changes = ["expect={}", "run.duration=1"]
    early = load("still", [*changes, "measure.after=0.96"])
    late = load("still", [*changes, "measure.after=0.98"])
    assert run_command.measures_lines(early) == []
    assert run_command.measures_lines(late) == [
        "The last picture is taken at 0.966667 s, and measure.after = 0.98 s: measures that count "
        "from that time on have no value"
    ]


@pytest.mark.parametrize("late", ["latency=15", "latency_ms=500"])
def test_a_run_that_ends_before_its_first_command_acts_says_so(late):
    changes = ["expect={}", "measure.after=0", f"run.{late}"]
    longer = load("still", [*changes, "run.duration=0.52"])
    ended = load("still", [*changes, "run.duration=0.5"])
    assert run_command.measures_lines(longer) == []
    assert run_command.measures_lines(ended) == [
        "The run ends after 0.5 s, before its first command acts: no command moves the camera"
    ]


@pytest.mark.newest
def test_a_claim_is_printed_so(console, approved):
    rule = Rule("error [px]", "as printed", "2 worlds", "1 px", "95 % interval", "below [1] px")
    claim = Claim("P0-1a", "[this] is better", rule, lambda _: [], lambda *_: None)
    table = [["tracker", "error [px]", "z"], ["[kams]", "1.25", "3"], ["long-name", "10.5", "2.75"]]
    papers_command._print_rule(console, claim)
    effect = Interval(0.5, 0.25, 0.75)
    for finding, rows in zip(Finding, (table, [], []), strict=True):
        verdict = Verdict(finding, effect, "[px]", 2, "1 & [2]", rows)
        papers_command._print(console, verdict)
    terminal.plain(console, Judged.of(claim, verdict).row("P0-1a"))
    approved("prints/papers", lines(console))


def shot(k, status=Status.LOCKED, size=(64, 48)):
    state, covariance = State(20.0 + k, 15.0, 0.01 * k, 1.0), np.eye(4)
    picture = Picture(f"{k}.png", k / 30, None, "" if size else "cut off")
    return Shot(picture, k, Estimate(state, covariance, 0.1 * k, status), 0.002, size)


def test_a_track_is_printed_so(console, monkeypatch, approved):
    region = Region(10.0, 6.0)
    sizes = [(64, 48), (64, 48), None, (64, 48), (80, 48), None, (64, 48)]
    statuses = [*3 * [Status.LOCKED], *2 * [Status.UNSURE], *2 * [Status.LOST]]
    seen = [shot(k, statuses[k], size) for k, size in enumerate(sizes)]
    truth = np.stack([region.corners(State(20.0 + 1.5 * k, 16.0)) for k in range(7)])
    compared = Comparison.of(Track.of(seen, region), truth)
    monkeypatch.setattr(terminal, "Console", lambda **_: console)
    track_command.print_track(console, "kams on [film]", seen, compared, None)
    track_command.print_track(console, "kams on film", seen[:3], None, End("film: lost", True))
    approved("prints/track", lines(console))


def test_the_list_is_laid_out_so(console, monkeypatch, approved):
    monkeypatch.setattr(list_command, "shipped", lambda: ["still"])
    monkeypatch.setattr(list_command, "studies", lambda: ["noise"])
    monkeypatch.setattr(list_command, "PARTS", ("scenario", "study", "robot"))
    list_command.show_all()
    approved("prints/list", lines(console))


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_progress_bar_is_gone_when_the_work_is_done():
    console = Console(width=60, file=Terminal(), force_terminal=True, color_system=None)
    with terminal.progress_bar(console) as bar:
        bar.add_task("work", total=4, completed=1, note="a note")
        bar.refresh()
        shown = console.file.getvalue()
    assert [word in shown for word in ("work", "1/4", "a note")] == [True] * 3
    assert console.file.getvalue().endswith("\x1b[1A\x1b[2K")


def test_in_a_pipe_force_color_adds_colours_only(monkeypatch, capfd, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("FORCE_COLOR", "1")
    words = ["run", "still", "--set", "run.duration=0.1", "--no-rerun", "--out", "coloured"]
    monkeypatch.setattr(sys, "argv", ["servobench", *words])
    with pytest.raises(SystemExit):
        main.main()
    out, err = capfd.readouterr()
    codes = set(re.findall("\x1b\\[[^a-zA-Z]*[a-zA-Z]", out + err))
    assert {code[-1] for code in codes} == {"m"}


def test_the_stages_of_a_step_are_told_as_medians(monkeypatch, tmp_path, capfd):
    seconds = 1e-3 * np.array([[1, 2, 3, 4], [2, 4, 6, 8], [9, 9, 9, 90]])
    monkeypatch.setattr(run_command, "timed", lambda run: seconds)
    short = ["run.duration=0.1", "tracker.kind=frozen", "expect={}"]
    run_command.run(
        "still", short, None, tmp_path / "o", quiet=False, no_rerun=True, all_measures=True
    )
    said = " ".join(capfd.readouterr().out.split())
    stages = "render 2.00 track 4.00 control 6.00 physics 8.00"
    assert re.search(
        rf"A step took 20.0 ms: {stages}; writing it took \d+\.\d ms \(medians\)", said
    )


@pytest.mark.newest
def test_contact_sheets_look_like_this(approved):
    def paint(k):
        image = np.full((90, 120, 3), 40 + 10 * k, np.uint8)
        image[10 * k :, :20] = (200, 10 * k, 30)
        return image

    square = np.array([[20, 20], [60, 20], [60, 50], [20, 50]], float)
    truth = square + 3 * np.arange(7)[:, None, None]
    found = truth[:5] + 6
    found[2] = np.nan
    whole = contact_sheet.sheet(PaintedSource(paint, 7), truth, found, count=6)
    lost = contact_sheet.tile(Picture("gone", 0.0, None), truth[0], None)
    seen = {}
    for name, image in (("sheet", whole), ("lost", lost), ("page", contact_sheet.page([lost] * 2))):
        bands = np.add.reduceat(image.astype(float), range(0, image.shape[0], 31), axis=0)
        seen[name] = [image.shape, np.add.reduceat(bands, range(0, image.shape[1], 31), axis=1)]
    approved("prints/sheets", seen, 0.01)


def plan(item):
    """A viewer's plan as plain values."""
    if isinstance(item, list | tuple):
        return [plan(part) for part in item]
    if type(item).__module__.startswith("rerun.blueprint"):
        return {type(item).__name__: {k: plan(v) for k, v in vars(item).items() if k != "id"}}
    return str(item)


BLUEPRINTS = {
    "run": lambda: layout.blueprint_of_run(METRIC.names),
    "track": layout.blueprint_of_track,
}


@pytest.mark.parametrize(("name", "blueprint"), BLUEPRINTS.items())
@pytest.mark.newest
def test_the_viewer_is_laid_out_so(name, blueprint, approved):
    approved(f"prints/viewer-{name}", plan(blueprint()))


@pytest.mark.parametrize(
    ("there", "sentence"),
    [
        (["opencv-python-headless"], ""),
        (["opencv-contrib-python"], ""),
        (
            ["opencv-contrib-python-headless", "opencv-python-headless"],
            "opencv-python-headless and opencv-contrib-python-headless write into the same folder "
            "cv2: uninstall all, then install one; the contrib ones hold all that the others do",
        ),
    ],
)
def test_several_opencvs_are_a_clash(there, sentence, monkeypatch):
    monkeypatch.setattr(found_versions, "is_installed", lambda name: name in there)
    assert found_versions.clash() == sentence


def test_any_opencv_has_its_version_in_every_result(monkeypatch):
    """A user of the contrib modules has another distribution than the one we require."""

    def version(name):
        if name == "opencv-python-headless":
            raise found_versions.metadata.PackageNotFoundError(name)
        return f"{name} 1"

    spec = find_spec(found_versions.__name__)
    fresh = module_from_spec(spec)  # it reads the versions once
    spec.loader.exec_module(fresh)
    missing = found_versions.metadata.PackageNotFoundError
    there = SimpleNamespace(version=version, PackageNotFoundError=missing)
    monkeypatch.setattr(fresh, "metadata", there)
    named = fresh.versions()
    assert "opencv-python-headless" not in named
    assert named["opencv-contrib-python"] == "opencv-contrib-python 1"
