"""`servobench compare`: variants of parts and settings as one study, with all that it writes."""

import re
import sys

import pytest
from kept import found

from servo.cli import compare_command, main, report_command
from servo.cli.compare_command import MEASURED, study_of, variants_of
from servo.mistake import Mistake
from servo.scenario.part_names import named_part
from servo.study.store import StudyFile

PARTS = ("tracker", "controller", "estimator")
PLAIN = {"set_of": (), "changes": (), "measured": False, "seeds": 2, "workers": 1}
PLAIN |= {"scheduler": None, "measures": None, "dry_run": False, "quiet": True}


@pytest.fixture
def unprinted(monkeypatch):
    """No figures are written beside a page."""
    monkeypatch.setattr(report_command, "figures", lambda *_: [])


def compared(*scenarios, **options):
    """Return the study of a comparison, by the options of the command line."""
    parts = {part: options.get(part, ()) for part in PARTS}
    variants = variants_of(parts, options.get("set_of", ()))
    return study_of(scenarios or ("still",), variants, options.get("changes", ()), 2, "mine")


def test_variants_are_groups_of_settings_over_scenarios_and_seeds():
    study = compared(
        "still",
        "line",
        tracker=["kams", "mine=mk_pf:paper", "far=trax:python -m tracker --fast"],
        controller=["calm=ibvs"],
        estimator=["none=none"],
        set_of=["slow=controller.gain=0.5,run.latency=3"],
        changes=[MEASURED],
    )
    assert study.name == "mine"
    assert study.title == "Variants compared in still, line."
    assert study.compare == "variant"
    assert study.size == 2 * 6 * 2
    assert study.bases[0].changes == {"run.tracker_ms": "measured"}
    assert study.bases[1].named["variant"] == {
        "kams": {"tracker.kind": "kams"},
        "mine": {"tracker.kind": "mk_pf", "tracker.preset": "paper"},
        "far": {"tracker.kind": "trax", "tracker.command": "python -m tracker --fast"},
        "calm": {"controller.kind": "ibvs"},
        "none": {"estimator.kind": "none"},
        "slow": {"controller.gain": 0.5, "run.latency": 3},
    }


def test_a_comma_inside_a_list_separates_no_settings():
    text = 'a=controller.weights=[1.0,1.0,1.0,0.1,0.1,1.0],tracker.kind="frozen"'
    found = {"controller.weights": [1.0, 1.0, 1.0, 0.1, 0.1, 1.0], "tracker.kind": "frozen"}
    study = compared(set_of=[text])
    assert study.bases[0].named["variant"]["a"] == found


def test_a_single_variant_stands_beside_the_scenario_as_it_is():
    study = compared(set_of=["slow=controller.gain=0.5"])
    assert study.axes[0].values == ("as it is", "slow")


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({}, "there is nothing to compare: give --tracker, --controller, --estimator or --set-of"),
        (
            {"tracker": ["a=kams"], "controller": ["a=ibvs"]},
            "two variants are called 'a': give one another name, as in NAME=kams",
        ),
        (
            {"tracker": ["as it is=kams"]},
            "two variants are called 'as it is': give one another name, as in NAME=kams",
        ),
        (
            {"tracker": ["a="]},
            "'a=': the name before the = or the component after it is missing; write NAME=KIND, NAME=module:Class, NAME='program:COMMAND', NAME='trax:COMMAND' or NAME=onnx:FILE",
        ),
        (
            {"set_of": ["slow"]},
            "--set-of slow: there is no name or no setting: write NAME=KEY=VALUE,..., such as slow=controller.gain=0.5",
        ),
    ],
)
def test_a_mistake_is_one_sentence(options, sentence):
    with pytest.raises(Mistake) as raised:
        compared(**options)
    assert str(raised.value) == sentence


def test_an_unknown_kind_is_named_before_anything_runs():
    with pytest.raises(
        Mistake, match=r"^compare: in the run with variant = a: still.toml: .*'kam'"
    ):
        compared(tracker=["a=kam", "kams"])


def test_a_program_that_cannot_start_is_named_before_anything_runs(tmp_path):
    asked = dict.fromkeys(PARTS, ()) | {"tracker": ["frozen", "a=program:not-there"]}
    with pytest.raises(Mistake) as raised:
        compare_command.run(["still"], **(PLAIN | asked | {"out": tmp_path / "x"}))
    assert str(raised.value) == ("program 'not-there' cannot be started: No such file or directory")
    assert not (tmp_path / "x").exists()


@pytest.mark.wide
def test_one_command_writes_study_page_table_and_figures(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    line = "compare still --tracker frozen --tracker best=truth --set run.duration=0.3 --seeds 1"
    monkeypatch.setattr(sys, "argv", ["servobench", *line.split(), "--workers", "1", "--quiet"])
    with pytest.raises(SystemExit) as ended:
        main.main()
    assert ended.value.code in (0, None)
    folder = tmp_path / "runs" / "compare"
    kept = StudyFile.read(folder / "study.json")
    assert kept.command == f"servobench {line}"
    assert kept.axes == {"variant": ["frozen", "best"]}
    assert "variant & runs & units" in (folder / "tables.tex").read_text()
    assert "Variants compared in still." in (folder / "report.html").read_text()
    assert len(list((folder / "figures").glob("*.pdf"))) == 3
    again = dict.fromkeys(PARTS, ()) | {"tracker": ["frozen", "best=truth"], "seeds": 1}
    again |= {"changes": ["run.duration=0.3"], "out": folder}
    assert compare_command.run(["still"], **(PLAIN | again)) == 0
    assert found(folder) == {"000000", "000001"}


@pytest.mark.wide
@pytest.mark.usefixtures("undrawn", "unprinted")
def test_scenarios_of_different_lengths_share_no_curve_over_time(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    asked = dict.fromkeys(PARTS, ()) | {"set_of": ["calm=controller.gain=0.5"], "seeds": 1}
    asked |= {"changes": ["run.duration=0.2"], "out": tmp_path / "both"}
    assert compare_command.run(["still", "line"], **(PLAIN | asked)) == 0
    page = (tmp_path / "both" / "report.html").read_text()
    for title in ("Distance from the goal", "Still on target"):
        drawn = re.findall(f'aria-label="({title}[^"]*)"', page)
        assert drawn == [f"{title}: scenario = still", f"{title}: scenario = line"]


def test_a_command_with_an_equals_sign_needs_no_name():
    command = "program:mine --rate=3"
    assert named_part("tracker", command) == (command, command)
    assert named_part("tracker", f"fast={command}") == ("fast", command)
