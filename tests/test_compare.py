"""`servobench compare`: variants of parts and settings as one study, with all that it writes."""

import dataclasses
import re
import sys

import pytest
from kept import found

from servo.cli import compare_command, main
from servo.cli.compare_command import CompareRequest, study_of
from servo.mistake import Mistake
from servo.study.store import StudyFile


def request(*scenarios, **options):
    plain = {"tracker": (), "controller": (), "estimator": (), "set_of": (), "changes": ()}
    fixed = {"measured": False, "seeds": 2, "workers": 1, "scheduler": None, "out": None}
    rest = {"measures": None, "dry_run": False, "quiet": True}
    return CompareRequest(scenarios=scenarios or ("still",), **(plain | fixed | rest | options))


def test_variants_are_groups_of_settings_over_scenarios_and_seeds():
    asked = request(
        "still",
        "line",
        tracker=["kams", "mine=mk_pf:paper", "far=trax:python -m tracker --fast"],
        controller=["calm=ibvs"],
        estimator=["none=none"],
        set_of=["slow=controller.gain=0.5,run.latency=3"],
        measured=True,
    )
    study = study_of(asked, "mine")
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
    study = study_of(request(set_of=[text]), "mine")
    assert study.bases[0].named["variant"]["a"] == found


def test_a_single_variant_stands_beside_the_scenario_as_it_is():
    study = study_of(request(set_of=["slow=controller.gain=0.5"]), "mine")
    assert study.axes[0].values == ("as it is", "slow")


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({}, "nothing to compare: give --tracker, --controller, --estimator or --set-of"),
        (
            {"tracker": ["a=kams"], "controller": ["a=ibvs"]},
            "two variants are called 'a': write another name before the =",
        ),
        (
            {"tracker": ["a="]},
            "'a=': write NAME=KIND, NAME=module:Class, NAME='trax:COMMAND' or NAME=onnx:FILE",
        ),
        (
            {"set_of": ["slow"]},
            "--set-of slow: write NAME=KEY=VALUE,..., such as slow=controller.gain=0.5",
        ),
    ],
)
def test_a_mistake_is_one_sentence(options, sentence):
    with pytest.raises(Mistake) as raised:
        study_of(request(**options), "mine")
    assert str(raised.value) == sentence


def test_an_unknown_kind_is_named_before_anything_runs():
    with pytest.raises(Mistake, match=r"^compare: where variant = a: still.toml: .*'kam'"):
        study_of(request(tracker=["a=kam", "kams"]), "mine")


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
    again = request(tracker=["frozen", "best=truth"], changes=["run.duration=0.3"], seeds=1)
    assert compare_command.run(dataclasses.replace(again, out=folder, workers=1)) == 0
    assert found(folder) == {"000000", "000001"}


def test_scenarios_of_different_lengths_share_no_curve_over_time(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    short = "run.duration=0.2"
    asked = request("still", "line", set_of=["calm=controller.gain=0.5"], changes=[short], seeds=1)
    assert compare_command.run(dataclasses.replace(asked, out=tmp_path / "both", workers=1)) == 0
    page = (tmp_path / "both" / "report.html").read_text()
    for title in ("Distance from the goal", "Still on target"):
        drawn = re.findall(f'aria-label="({title}[^"]*)"', page)
        assert drawn == [f"{title}: scenario = still", f"{title}: scenario = line"]
