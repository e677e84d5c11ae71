"""Tables as they are printed and written, from made-up results: bench, study, progress, lists."""

import dataclasses
import io
import itertools
import re
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from servo.cli import evaluate_command, jobs, list_command, sweep_command
from servo.cli.main import app
from servo.loop.measure import MEASURES as OF_RUNS
from servo.mistake import Mistake
from servo.report import bench_section
from servo.scenario.catalogue import shipped, studies
from servo.scenario.load import SECTIONS
from servo.study import ranking
from servo.study.execute import Workers
from servo.study.parse import StudyTable, load
from servo.study.record_file import table_of
from servo.study.results import SHOWN, Cell, moved
from servo.study.run import Failure, Job, Record
from servo.study.scenario_run import MEASURED
from servo.study.sequence_run import PRECISION_CURVE, SUCCESS_CURVE
from servo.study.store import Store, StudyFile
from tracking.drawing import curves
from tracking.evaluation.track_measures import MEASURES, OVERLAPS, PIXELS
from tracking.files.json_text import as_json


@pytest.fixture
def printed(monkeypatch):
    """A console that keeps lines of up to 140 characters; `listing` prints into it, too."""
    console = Console(width=140, record=True, file=io.StringIO())
    monkeypatch.setattr(list_command, "Console", lambda: console)
    return console


def lines(console):
    return [line.rstrip() for line in console.export_text(styles=False).splitlines()]


class Made:
    """A subject."""

    def describe(self):
        return {}


def results(families, seeds=8):
    """Three trackers; the best one is named last, one measure of another is never known."""
    rng, found = np.random.default_rng(6), []
    for i, tracker in enumerate(("slow", "poor", "best")):
        for family in families:
            for seed in range(seeds):
                skill = (0.5, 0.2, 0.8)[i] * rng.uniform(0.9, 1.1)
                measures = {m.name: float(10 * skill * rng.uniform(1, 2)) for m in MEASURES}
                measures |= {"auc": float(skill), "frames_until_loss": round(100 * skill)}
                if tracker == "poor":
                    measures[MEASURES[-1].name] = np.nan
                found.append(
                    Record(
                        subject=f"{family}-1",
                        subject_is="sequence",
                        seed=seed,
                        settings={
                            "tracker": tracker,
                            "family": family,
                            "drawn": True,
                            "frames": 100 + seed,
                        },
                        outcome="COMPLETED",
                        success=True,
                        measures=measures,
                        versions={},
                        series={
                            SUCCESS_CURVE: skill * (1 - OVERLAPS),
                            PRECISION_CURVE: np.minimum(1, skill * PIXELS / 30),
                        },
                    )
                )
    return found


@pytest.mark.parametrize("count", [1, 3, evaluate_command.WIDE, evaluate_command.WIDE + 1])
@pytest.mark.newest
def test_a_bench_prints_these_tables(count, printed, approved):
    found = results([f"family{i}" for i in range(count)])
    evaluate_command.print_ranks(printed, ranking.ranked(found))
    approved(f"tables/bench-{count}", lines(printed))


def test_a_bench_writes_these_files(monkeypatch, approved, tmp_path):
    found = results([f"family{i}" for i in range(3)])
    store = Store(tmp_path)
    store.records = lambda jobs: found if jobs else []
    store.table = lambda: table_of([found[:1]])
    monkeypatch.setattr(evaluate_command, "opened", lambda *_: nullcontext(store))
    monkeypatch.setattr(evaluate_command, "complete_jobs", lambda *_: 0)
    code = evaluate_command.run("clutter", "frozen", seeds=1, workers=1, out=tmp_path, quiet=True)
    assert code == 0
    names = ("runs.csv", "table.csv")
    texts = {name: (tmp_path / name).read_text().splitlines() for name in names}
    approved("tables/bench-files", texts)


def test_a_mean_over_a_part_of_the_sequences_says_of_how_many():
    found = results(["a", "b"], seeds=1)
    for record in found:
        if record.subject == "b-1":
            record.measures["lost_auc"] = np.nan  # never off the target
    table = bench_section.trackers_table(ranking.ranked(found))
    column = list(table.head).index("lost")
    assert {row[column].split(" ", 1)[1] for row in table.rows} == {"(1 of 2)"}
    assert not any("of" in row[column - 1] for row in table.rows)


@pytest.mark.parametrize(("wins", "losses", "longer"), [(0, 12, "ab"), (12, 0, "ba")])
def test_which_of_two_trackers_tracks_for_longer_is_said_by_the_test(wins, losses, longer):
    """The first is the best by the area under its curve, and may be worse by the test."""
    best, other = ranking.ranked(results([f"family{i}" for i in range(3)]))[:2]
    test = dataclasses.replace(other.against_best, wins=wins, losses=losses)
    ranks = [
        dataclasses.replace(best, tracker="a"),
        dataclasses.replace(other, tracker="b", against_best=test, p=0.001),
    ]
    sentence = f"{longer[0]} tracks for longer than {longer[1]} (McNemar, p < 0.05)."
    assert bench_section.against_best(ranks) == [sentence]


def test_curves_of_a_bench_show_this(monkeypatch, drawn, approved, tmp_path):
    saved = []
    monkeypatch.setattr(curves, "save", lambda f, _, name: saved.append([name, drawn(f)]))
    found = [
        {
            "tracker": r.settings["tracker"],
            "success": r.series[SUCCESS_CURVE],
            "precision": r.series[PRECISION_CURVE],
        }
        for r in results(["one"])
    ]
    curves.draw(found, ["best", "slow", "poor"], "a $uite", tmp_path)
    approved("tables/curves", saved)


class Kept:
    """A store with made-up records."""

    def __init__(self, study, folder):
        self.folder, self.written, self.find = folder, {}, list
        rng, self.done = np.random.default_rng(8), []
        for job in study.jobs():
            poor = job.settings["tracker.kind"] == "kams"
            rms = float(rng.uniform(1, 2) * (3 if poor else 1))
            measures = {name: rms * (k + 1) for k, name in enumerate(OF_RUNS)}
            success = not poor or job.seed % 3 == 0
            self.done.append(
                Record(
                    number=job.number,
                    subject=job.subject.name,
                    seed=job.seed,
                    settings=job.settings,
                    outcome="CONVERGED",
                    success=success,
                    measures=measures
                    | {"track_ms": 0.5 * rms, "settle_s": np.inf if poor else rms},
                )
            )

    def table(self):
        return table_of([self.done])

    def export(self, table):
        return [self.folder / "results.parquet", self.folder / "series.parquet"]

    def write(self, name, data):
        self.written[name] = data
        return self.folder / name


@pytest.mark.newest
def test_a_study_prints_and_writes_these_tables(printed, approved, capfd, monkeypatch, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(
        'scenario = "still"\nseeds = 9\n[axes]\ntracker.kind = ["kams", "pf_ssd"]\n'
        "controller.gain = { geomspace = [0.5, 8.0, 3] }\n"
        "[expect]\nsuccess_rate = 0.9\nservo_rms_px = 4.0\n"
    )
    study = load(str(file))
    kept = Kept(study, tmp_path)
    monkeypatch.setattr(sweep_command, "opened", lambda *_: nullcontext(kept))
    monkeypatch.setattr(sweep_command, "complete_jobs", lambda *_: 0)
    asked = study, "servobench sweep mine.toml", Workers(), tmp_path, printed
    assert sweep_command.run_study(*asked, has_page=True) == 1
    told = {
        "printed": [line.replace(str(tmp_path), "DIR") for line in lines(printed)],
        "missed": capfd.readouterr().err.splitlines(),
        "cells": kept.written["cells.csv"].splitlines(),
        "comparisons": kept.written["comparisons.csv"].splitlines(),
    }
    approved("tables/study", told)


@pytest.mark.wide
def test_the_manifest_of_every_shipped_study_is_this(approved):
    found = {}
    for name in studies():
        study = load(name)
        table = as_json(StudyFile.of(study, "again")) | {"versions": "", "scenarios": ""}
        runs = [[r.number, r.subject.name, r.seed, r.settings, r.pictured] for r in study.jobs()]
        found[name] = table | {"first": runs[0], "last": runs[-1]}
    approved("tables/studies", found)


def test_the_bar_of_a_study_counts_all_runs_and_those_that_failed(tmp_path, monkeypatch, capsys):
    (tmp_path / "mine.toml").write_text('scenario = "still"\nseeds = 6\n')
    every, told = list(load(str(tmp_path / "mine.toml")).jobs()), []
    store = Store(tmp_path)
    store.done = dict.fromkeys(["000000", "000001"], tmp_path)
    clock = itertools.count(100.0, 30.0)
    bar = SimpleNamespace(
        add_task=lambda name, **more: told.append([name, more]),
        update=lambda _, **more: told.append(more),
    )
    ends = [(job, Failure("no") if job.number == 5 else None) for job in every[2:]]
    monkeypatch.setattr(jobs, "moves", lambda _: True)
    monkeypatch.setattr(jobs, "progress_bar", lambda _: nullcontext(bar))
    monkeypatch.setattr(jobs.time, "monotonic", lambda: next(clock))
    monkeypatch.setattr(jobs, "complete", lambda *_: ends)
    console = Console(force_terminal=True)
    failed = jobs.complete_jobs(every, store, Workers(), console, "sweep mine", "")
    assert failed == 1
    out, err = capsys.readouterr()
    assert "sweep mine: 6 runs, 2 of them finished\n" in out
    assert err == f"servobench: {tmp_path}/failures: no\n"
    more = {"total": 6, "completed": 2, "note": jobs.COMPILING}
    assert told == [["sweep mine", more]] + [
        {"advance": 1, "note": f"2.0 a minute, {failed} failed"} for failed in (0, 0, 0, 1)
    ]


def test_without_a_terminal_progress_is_a_line_now_and_then(monkeypatch, capsys):
    clock = iter([0.0, 0.9, 4.0, 33.0, 60.0, 3600.0])
    monkeypatch.setattr(jobs.time, "monotonic", lambda: next(clock))
    with jobs.progress(Console(), "sweep mine", 1000, 100) as ended:
        for note in ("a", "b", "c", "d", "e"):
            ended(note)
    assert capsys.readouterr().err.splitlines() == [
        "sweep mine: 102 of 1,000, b, 30 min left",
        "sweep mine: 104 of 1,000, d, 3.7 h left",
        "sweep mine: 105 of 1,000, e, 179.0 h left",
    ]
    monkeypatch.setattr(jobs.time, "monotonic", itertools.count(0.0, 60.0).__next__)
    with jobs.progress(Console(quiet=True), "sweep mine", 2) as ended:
        ended("a")
    assert capsys.readouterr().err == ""


def test_a_dry_run_tells_how_many_runs_and_keeps_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(
        "scenario = 'still'\nseeds = 40\nset.run.duration = 0.1\nset.tracker.kind = 'frozen'\n"
    )
    assert sweep_command.run("mine.toml", [], None, 2, None, None, False, True) == 0
    out, err = capsys.readouterr()
    first, second = out.splitlines()
    assert first == "40 runs, 0 of them finished"
    assert re.fullmatch(r"a run takes \d+\.\d s here, 40 runs about \d+ s, 2 at once", second)
    assert err == ""
    # Nobody knows how many workers a cluster will have.
    cluster = "tcp://127.0.0.1:8786"
    assert sweep_command.run("mine.toml", [], None, 2, cluster, None, False, True) == 0
    shared = r"40 runs about \d+ s, in all, to be divided by the cluster's workers"
    assert re.search(shared, capsys.readouterr().out)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.toml"]


def test_a_dry_run_tells_what_would_fail(tmp_path, capsys):
    def fails(job, folder):
        raise RuntimeError("no")

    subject = SimpleNamespace(name="mine", perform=fails)
    every = [Job(i, subject, i, command=f"again {i}") for i in range(3)]
    assert jobs.print_estimate(every, 2, Console()) == 1
    assert capsys.readouterr().err == "servobench: RuntimeError: no (again: again 0)\n"


def test_the_table_of_a_study_has_the_measures_that_differ():
    """An rms is shown without its peak, which says the same; times differ between any two runs."""

    def cell(x, seeds=3, **measures):
        rows = [
            dict.fromkeys(MEASURED, 1.0)
            | {"axis": x, "seed": seed, "success": True}
            | {name: value + 0.01 * seed for name, value in measures.items()}
            for seed in range(seeds)
        ]
        return Cell.of({"axis": x}, rows, drawn=True)

    moving = [
        cell(x, servo_rms_px=x, servo_peak_px=3 * x, end_position_mm=(x - 2) ** 2, step_ms=x)
        for x in (1.0, 2.0, 3.0)
    ]
    assert moved(moving) == ["servo_rms_px", "end_position_mm"]
    assert moved([cell(1.0), cell(2.0)]) == list(SHOWN)
    # The means of two cells are always in a line: that says nothing about the measures.
    two = [cell(x, servo_rms_px=x, end_position_mm=9 * x, age_ms=50 - x) for x in (1.0, 9.0)]
    assert set(moved(two)) == {"servo_rms_px", "end_position_mm", "age_ms"}
    assert moved(moving[:1]) == list(SHOWN)


def test_an_unknown_measure_is_refused_before_the_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(Mistake, match=r"^--measures: there is no measure 'age'; did you mean"):
        sweep_command.run("noise", [], 1, 1, None, None, False, False, "servo_rms_px, age")
    assert list(tmp_path.iterdir()) == []


def test_the_list_has_every_scenario_study_and_kind(printed):
    list_command.show_all()
    listed = [tuple(line.split()[:2]) for line in lines(printed) if not line.startswith(" ")]
    every = [
        (section, kind)
        for section, folder in list_command.FOLDERS.items()
        for kind in folder.names()
    ]
    assert (
        listed == [("scenario", n) for n in shipped()] + [("study", n) for n in studies()] + every
    )


@pytest.mark.parametrize("part", list_command.PARTS)
def test_a_part_is_listed_with_all_its_kinds(part, printed):
    list_command.show(part)
    shown = list(itertools.takewhile(bool, lines(printed)))  # advice may follow
    rows = [line.split(maxsplit=2) for line in shown if not line.startswith(" ")]
    own = {"scenario": shipped, "study": studies}.get(part)
    names = own() if own else list_command.FOLDERS[part].names()
    assert [row[:2] for row in rows] == [[part, name] for name in names]
    assert all(len(row) == 3 for row in rows)  # each with a sentence


@pytest.mark.parametrize("section", [*SECTIONS, "expect", "sweep"])
def test_a_section_is_listed_with_all_its_settings(section, printed):
    list_command.show(section)
    title, head, *rows = lines(printed)
    same = f'.kind = "{section}"', f"scenario  {section}"  # what has its name follows the section
    others = [i for i, row in enumerate(rows) if any(each in row for each in same)]
    rows = rows[: others[0]] if others else rows
    assert title.startswith(f"[{section}]  ")
    assert head.split() == ["setting", "default", "meaning"]
    at = head.index("default"), head.index("meaning")
    names = [row[: at[0]].strip() for row in rows]
    config = SECTIONS.get(section)
    known = {
        "expect": ["outcome", *OF_RUNS, "drawn", "tracker"],
        "sweep": [*StudyTable.model_fields],
    }.get(section)
    fields = dataclasses.fields(config) if config else ()
    assert [n for n in names if n] == [f"{section}.{n}" for n in known or [f.name for f in fields]]
    assert all(row[at[1] :].strip() for row in rows)
    if config:
        defaults = [str(getattr(config(), f.name)) for f in fields]
        assert [
            row[slice(*at)].strip() for row, n in zip(rows, names, strict=True) if n
        ] == defaults


def test_a_setting_is_listed_with_its_unit(printed):
    list_command.show("camera")
    assert "camera.width           320                                 Image width [px]." in lines(
        printed
    )


def test_a_name_that_is_a_scenario_only_is_listed_with_its_sentence(printed):
    list_command.show("six_dof")
    assert lines(printed)[0].startswith("scenario  six_dof  The paper's law on all six degrees")


@pytest.mark.parametrize("kind", ["kams", "ibvs", "clutter"])
def test_the_settings_of_a_kind_are_listed_so(kind, printed, approved):
    list_command.show(kind)
    approved(f"tables/settings-{kind}", lines(printed))


def test_the_options_of_every_command_begin_so(approved):
    found = {
        name: {
            p.name: [
                p.opts,
                p.default,
                getattr(p, "is_flag", False),
                p.multiple,
                p.nargs,
                p.required,
                *(getattr(p.type, bound, None) for bound in ("min", "max")),
                getattr(p, "show_default", None),
                p.metavar,
            ]
            for p in command.params
        }
        for name, command in app.commands.items()
    }
    approved("tables/options", found)
    assert (app.no_args_is_help, app.context_settings) == (
        True,
        {"help_option_names": ["-h", "--help"]},
    )
