"""`servobench report`: what a page says of a study, and that any page is whole, safe and fits."""

import itertools
import json
import re
import shutil
import sys
from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from kept import drop, execute, keep, spoil

from servo.cli import main
from servo.cli.report_command import Printed, write
from servo.mistake import Mistake
from servo.report import study_section
from servo.report.page import LIGHT, Block, Section
from servo.report.printed import latex
from servo.report.study_data import StudyResults, duration, load
from servo.report.study_time import heat_maps
from servo.report.words import Badge, Table, Tone
from servo.study.bounds import MissedBound
from servo.study.run import Record
from servo.study.store import FailureFile, StudyFile

EVIL = "<script>alert(1)</script>"
AXES = {"tracker.kind": ["pf_ssd", "kams"], "camera.rate": [5.0, 30.0]}


def encoded(kind):
    image = np.random.default_rng(0).integers(0, 255, (30, 60, 3)).astype(np.uint8)
    return cv2.imencode(kind, image)[1].tobytes()


def make_study(folder, *, seeds=2, kinds=("pf_ssd", "kams"), **changes):
    """Runs 0..7: kams is lost at 5 Hz from 2 s on; servo_rms_px is the run's number."""
    manifest = {
        "name": "rates",
        "title": "How slow may it be?",
        "command": "servobench sweep rates",
        "versions": {"servobench": "0.1.0"},
        "axes": AXES | {"tracker.kind": list(kinds)},
        "seeds": list(range(seeds)),
        "draws": {"start.x": {"uniform": [-80, 80]}},
        "compare": "tracker.kind",
        "expect": {"success_rate": 0.9, "servo_rms_px": 6.6},
        "runs": 4 * seeds,
        "table": {},
        "scenarios": {},
    } | changes
    StudyFile(**manifest).write(folder)
    records = []
    time = np.arange(0, 4, 0.2)
    cells = itertools.product(kinds, AXES["camera.rate"], range(seeds))
    for number, (kind, rate, seed) in enumerate(cells):
        held = kind == kinds[0] or rate == 30.0
        series = {
            "time_s": time,
            "servo_error_px": np.full(len(time), 3.0 + number),
            "on_target": time < (9 if held else 2),
        }
        record = Record(
            number=number,
            subject="line",
            seed=seed,
            settings={"tracker.kind": kind, "camera.rate": rate, "start.x": 1.5},
            outcome="CONVERGED" if held else "TARGET_LOST",
            success=held,
            measures={"servo_rms_px": float(number), "settle_s": np.nan},
            missed=() if held else (MissedBound("settle_s", None, 3.0),),
            series=series,
            sheet=encoded(".jpg"),
        )
        records.append(record)
    keep(folder, records)
    return folder


def text_of(folder, tmp_path):
    return write([folder], tmp_path / "page.html")[0].read_text(encoding="utf-8")


@pytest.mark.usefixtures("undrawn")
def test_a_study_tells_what_held_and_what_did_not(tmp_path):
    section = study_section.section(make_study(tmp_path / "study"))
    facts = {
        fact.label: (getattr(fact.value, "text", fact.value), fact.note) for fact in section.facts
    }
    assert facts["runs"] == ("8 of 8", "2 seeds a cell")
    assert facts["success rate"] == ("0.75", "mean of 2 draws, 95 %: 0.198 to 0.973")
    assert facts["true centre against the goal, rms, median"] == ("3.5 px", "servo_rms_px")
    blocks = {block.title: block for block in section.blocks}
    assert list(blocks) == [
        "Over time",
        "Compared",
        "What was varied, and what held",
        "Against the axes",
        "Over two axes",
        "Contact sheets",
        "Cells",
        "Runs",
        "Again",
    ]
    assert blocks["What was varied, and what held"].points == [
        "tracker.kind = kams, camera.rate = 5.0: success_rate is 0, expected at least 0.9",
    ]
    assert blocks["Compared"].points == []
    (row,) = blocks["Compared"].tables[1].rows
    assert row == ["pf_ssd", "kams", "draw", "2", "0", "0", "0.707", "0.5", "0.5"]
    said = blocks["Compared"].tables[0].rows[1][:6]
    assert said == ["kams", "4", "2 draws", "0.5 (0.0945 to 0.905)", "2", "2"]
    cells = blocks["Cells"].tables[0]
    said = cells.rows[3][:6]
    assert said == ["kams", "30", "2", "2 draws", "1 (0.342 to 1)", "6.5 (0.147 to 12.9)"]
    assert blocks["Contact sheets"].pictures[0].title == (
        "run 4, tracker.kind = kams, camera.rate = 5, seed = 0: TARGET_LOST"
    )
    assert [f.title for f in blocks["Over two axes"].figures] == [
        "Success rate",
        "Median error, servo_rms_px",
    ]


@pytest.mark.usefixtures("undrawn")
def test_a_difference_that_is_sure_is_a_sentence(tmp_path):
    section = study_section.section(make_study(tmp_path / "study", seeds=10))
    (compared,) = (block for block in section.blocks if block.title == "Compared")
    assert compared.points == [
        "pf_ssd succeeds more often than kams: in 10 draws against 0 (p = 0.002 after Holm)."
    ]


@pytest.mark.usefixtures("undrawn")
def test_an_unfinished_study_is_made_of_the_runs_there_are(tmp_path):
    folder = make_study(tmp_path / "study")
    drop(folder, 1)
    spoil(folder, 2)
    (folder / "failures").mkdir()
    failure = {"run": 1, "settings": {"seed": 1}, "command": "again", "error": "Trace\nOops: <b>"}
    FailureFile(**failure).write(folder / "failures", "000001.json")
    page = text_of(folder, tmp_path)
    assert "<p>This study is not finished: 6 of 8 runs.</p>" in page
    assert "<p>Runs that are damaged: 1.</p>" in page
    assert "<li>run 1, seed = 1: Oops: &lt;b&gt;</li>" in page


@pytest.mark.usefixtures("undrawn")
def test_a_run_that_failed_first_and_then_finished_is_told(tmp_path):
    folder = make_study(tmp_path / "study")
    (folder / "failures").mkdir()
    failure = {"run": 3, "settings": {"seed": 1}, "command": "again", "error": "Trace\nOops"}
    FailureFile(**failure).write(folder / "failures", "000003.json")
    page = text_of(folder, tmp_path)
    assert (
        "<p>Runs that failed first and finished when they were tried again, so that something in "
        "them does not repeat itself: 1 (3). Their errors are in failures/.</p>"
    ) in page
    assert "runs that failed" not in page


@pytest.mark.usefixtures("undrawn")
def test_a_tracker_whose_runs_all_failed_has_a_row(tmp_path):
    folder = make_study(tmp_path / "study")
    rows = load(folder).rows
    for row in rows:
        if row["tracker.kind"] == "kams":
            drop(folder, row["run"])
    (compared,) = (b for b in study_section.section(folder).blocks if b.title == "Compared")
    first, second = compared.tables[0].rows
    assert first[:2] == ["pf_ssd", "4"]
    assert second[:3] == ["kams", "0 of 4", "0 draws"]


CASES = {
    "done": {},
    "not-done": {"seeds": 5},
    "no-axes": {"axes": {}, "compare": None, "expect": {}},
    "one-axis": {"axes": {"camera.rate": [5.0, 30.0]}, "expect": {"servo_rms_px": 60.0}},
    "names": {"axes": {"tracker.kind": AXES["tracker.kind"]}, "draws": {}},
}


@pytest.mark.parametrize("name", CASES)
def test_all_that_is_said_and_drawn_of_a_study(name, section, approved, tmp_path):
    folder = make_study(tmp_path / "study", **CASES[name])
    if name == "not-done":
        (folder / "failures").mkdir()
        for run, error in ((1, "Trace\nOops"), (2, "Other")):
            failure = {"run": run, "settings": {"seed": run}, "command": "again", "error": error}
            FailureFile(**failure).write(folder / "failures", f"{run:06}.json")
            drop(folder, run)
    approved(f"report/study-{name}", section(folder))


def test_a_study_without_runs_still_has_a_page(tmp_path):
    folder = make_study(tmp_path / "study")
    execute(folder, "DELETE FROM runs")
    assert "0 of 8 runs" in text_of(folder, tmp_path)


@pytest.mark.usefixtures("undrawn")
def test_what_is_too_much_is_cut_and_said(tmp_path):
    folder = make_study(tmp_path / "study", seeds=7)
    pictures = next(b for b in study_section.section(folder).blocks if b.title == "Contact sheets")
    assert len(pictures.pictures) == 24
    assert "At most 24 are shown." in pictures.text


def test_no_text_from_a_file_becomes_part_of_the_page(ran, tmp_path):
    shutil.copytree(ran, tmp_path / "run", ignore=shutil.ignore_patterns("*.rrd"))
    report = json.loads((ran / "report.json").read_text()) | {"scenario": EVIL}
    report["missed"] = [{"name": EVIL, "found": 2.0, "bound": 1.0}]
    (tmp_path / "run" / "report.json").write_text(json.dumps(report))
    kinds = ("pf_ssd", f"$x{EVIL}")
    folder = make_study(tmp_path / "study", title=EVIL, kinds=kinds, versions={EVIL: EVIL})
    page = write([tmp_path / "run", folder], tmp_path / "page.html")[0].read_text()
    assert page.count("<script") == 1  # the page's own
    assert page.count("&lt;script&gt;alert(1)&lt;/script&gt;") > 10


@pytest.fixture(scope="module")
def whole(make_papers, ran, tmp_path_factory):
    """A page about several folders."""
    folder = tmp_path_factory.mktemp("whole")
    folders = [ran, make_study(folder / "study"), make_papers(folder / "papers")]
    return write(folders, folder / "page.html")[0]


def test_the_page_refers_to_nothing_outside_and_has_no_stand_in_colours(whole):
    page = whole.read_text(encoding="utf-8")
    found = re.findall(r"(?:src|href|action|resource)\s*=\s*[\"']([^\"']*)", page)
    assert {f.partition(":")[0] for f in found if not f.startswith("#")} == {"data"}
    assert "@import" not in page
    assert not re.search(r"url\((?!#)", page)
    assert not any(f"stroke: {colour}" in page for colour in LIGHT)
    assert "currentColor" in page
    assert "stroke: var(--series-1)" in page


def test_the_command_prints_the_path_it_wrote(make_papers, monkeypatch, capfd, tmp_path):
    folder = make_papers(tmp_path / "papers")
    monkeypatch.setattr(sys, "argv", ["servobench", "report", str(folder)])
    with pytest.raises(SystemExit) as ended:
        main.main()
    assert ended.value.code in (0, None)
    assert capfd.readouterr() == (f"{folder / 'report.html'}\n", "")
    assert (folder / "report.html").read_text().startswith("<!DOCTYPE html>")


@pytest.mark.wide
@pytest.mark.newest  # Rerun before 0.38 reads no recording, and the page has no picture of it
def test_the_page_opens_in_a_browser_and_fits_a_phone(whole, browser):
    browser.get(whole.as_uri())
    drawn = browser.execute_script(
        "return [...document.querySelectorAll('figure > svg')].map(s => s.getBBox().width *"
        " s.getBoundingClientRect().height)"
    )
    assert len(drawn) == 10
    assert min(drawn) > 10_000
    widths = browser.execute_script("return [...document.images].map(i => i.naturalWidth)")
    assert len(widths) == 1 + 8 + 2
    assert min(widths) > 0
    for width in (380, 1280):
        size = {"width": width, "height": 800, "deviceScaleFactor": 1, "mobile": False}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        taken = browser.execute_script("return document.documentElement.scrollWidth")
        assert taken <= width
    assert [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"] == []


@pytest.mark.wide
@pytest.mark.usefixtures("undrawn")
def test_a_click_on_a_head_sorts_the_rows_and_a_second_one_turns_them(browser, tmp_path):
    page = write([make_study(tmp_path / "study")], tmp_path / "page.html")[0]
    browser.get(page.as_uri())
    cells = (
        "const t = [...document.querySelectorAll('table')].find("
        "t => t.tHead.textContent.startsWith('run'));"
        "const at = [...t.tHead.rows[0].cells].findIndex(h => h.textContent === 'servo_rms_px');"
        "t.tHead.rows[0].cells[at].click();"
        "return [...t.tBodies[0].rows].map(r => r.cells[at].textContent)"
    )
    assert browser.execute_script(cells) == ["0", "1", "2", "3", "4", "5", "6", "7"]
    assert browser.execute_script(cells) == ["7", "6", "5", "4", "3", "2", "1", "0"]
    words = cells.replace("'servo_rms_px'", "'outcome'")
    assert browser.execute_script(words) == ["CONVERGED"] * 6 + ["TARGET_LOST"] * 2


@pytest.mark.wide
def test_tables_and_figures_of_a_page_are_files_with_the_measures_asked_for(tmp_path):
    folder = make_study(tmp_path / "study", kinds=("pf_ssd", "50_%&"))
    printed = Printed(tmp_path / "tables.tex", "pdf", "settle_s,servo_rms_px")
    page, tables, figures = write([folder], tmp_path / "page.html", printed)
    text = tables.read_text()
    assert (
        "tracker.kind & runs & units & success (95 \\%) & CONVERGED & TARGET\\_LOST & settle\\_s & "
        "servo\\_rms\\_px \\\\\n\\midrule\n"
        "pf\\_ssd & 4 & 2 draws & 1 (0.342 to 1) & 4 & 0 & -- & 1.5 \\\\\n"
        "50\\_\\%\\& & 4 & 2 draws & 0.5 (0.0945 to 0.905) & 2 & 2 & -- & 5.5 \\\\\n"
    ) in text
    assert text.count("\\begin{table}") == text.count("\\bottomrule") == 6
    assert "track_ms" not in page.read_text()
    found = {path.name: path.read_bytes() for path in sorted(figures.iterdir())}
    assert list(found) == [
        "01-distance-from-the-goal.pdf",
        "02-still-on-target.pdf",
        "03-error-against-camera-rate-true-centre-ag.pdf",
        "04-success-against-camera-rate.pdf",
        "05-success-rate.pdf",
        "06-median-error-servo-rms-px.pdf",
    ]
    assert {content[:5] for content in found.values()} == {b"%PDF-"}
    narrow = Printed(figures="svg", figure_width=3.4)
    write([folder], tmp_path / "page.html", narrow)
    drawing = (figures / "01-distance-from-the-goal.svg").read_text()
    assert LIGHT[0] in drawing
    assert "var(--" not in drawing
    assert "50_%" in drawing  # the legend
    points = float(re.search(r'width="([\d.]+)pt"', drawing)[1])
    assert 3.2 < points / 72 <= 3.6  # less or more by what is cut off and the margin


@pytest.mark.usefixtures("undrawn")
def test_tables_have_labels_and_those_too_wide_say_so(tmp_path):
    folder = make_study(tmp_path / "study")
    write([folder], tmp_path / "page.html", Printed(latex=tmp_path / "tables.tex"))
    text = (tmp_path / "tables.tex").read_text()
    labels = re.findall(r"\\label{(tab:[a-z0-9-]+)}", text)
    assert len(set(labels)) == text.count("\\begin{table}") == 6
    wide = Table([f"column {n}" for n in range(17)], [["1"] * 17])
    block = Block("All runs", tables=[wide])
    section = Section("study", "study", "", Badge("2 runs", Tone.PLAIN), [], [block], "")
    wide = '% "All runs" has 1 rows and 17 columns and fits no page'
    assert f"{wide}; --measures chooses columns." in latex([section])
    assert f"{wide}." in latex([replace(section, kind="evaluate")])  # which refuses --measures


@pytest.mark.usefixtures("undrawn")
def test_measures_and_tables_are_refused_where_they_do_not_fit(make_papers, tmp_path):
    folder = make_study(tmp_path / "study")
    cases = [
        ([folder], Printed(measures="speed"), "--measures: there is no measure 'speed'"),
        (
            [folder],
            Printed(figure_width=3.4),
            "--figure-width has no effect without --figures: add --figures pdf, svg or pgf",
        ),
        (
            [folder],
            Printed(latex=tmp_path / "tables.txt"),
            "tables.txt: the name of this file should end in .tex",
        ),
        (
            [folder],
            Printed(latex=tmp_path),
            "this is not a file; name a file to write, such as x.tex",
        ),
        (
            [make_papers(tmp_path / "papers")],
            Printed(measures="settle_s"),
            "papers: --measures is only for folders of sweep and compare",
        ),
    ]
    for folders, printed, sentence in cases:
        with pytest.raises(Mistake, match=sentence):
            write(folders, tmp_path / "page.html", printed)
    assert not (tmp_path / "page.html").exists()


def test_a_median_over_some_of_the_runs_has_their_number(tmp_path):
    """The last two runs of kams have no servo_rms_px, and all others no settle_s."""
    folder = make_study(tmp_path / "study")
    drop(folder, 6, 7)
    keep(folder, [
        Record(
            number=number, subject="line", seed=number - 6, outcome="CONVERGED", success=True,
            settings={"tracker.kind": "kams", "camera.rate": 30.0, "start.x": 1.5},
            measures={"servo_rms_px": np.nan, "settle_s": 3.0}, series={},
        )
        for number in (6, 7)
    ])  # fmt: skip
    (compared,) = (b for b in study_section.section(folder).blocks if b.title == "Compared")
    head, rows = compared.tables[0].head, compared.tables[0].rows
    found = [[row[head.index(name)] for row in rows] for name in ("servo_rms_px", "settle_s")]
    assert found == [["1.5", "4.5 (2 of 4)"], ["\u2013", "3 (2 of 4)"]]


@pytest.mark.parametrize(("times", "seconds"), [([0.0], 0.0), ([0.0, 0.1, 0.2, 0.5], 0.6)])
def test_a_run_lasts_until_the_end_of_its_last_frame(times, seconds):
    assert duration({"time_s": np.array(times)}) == pytest.approx(seconds)


def test_a_heat_map_has_the_runs_of_values_that_are_lists():
    """An axis of lists, or of several types, is stored as texts."""
    axes = {"controller.dof": [["vx", "vy"], ["vz"]], "tracker.kind": ["kams", "truth"]}
    rows = [
        {"controller.dof": dof, "tracker.kind": kind, "success": good, "servo_rms_px": error}
        for dof, kind, good, error in [
            ("['vx', 'vy']", "kams", True, 1.0),
            ("['vx', 'vy']", "kams", False, 3.0),
            ("['vz']", "kams", False, 8.0),
            ("['vz']", "truth", True, 0.5),
        ]
    ]
    plan = SimpleNamespace(axes=axes, compare="tracker.kind")
    rate, error = heat_maps(StudyResults(None, plan, rows, {}, set(), [], []))
    texts = [
        sorted(text.get_text() for text in figure.drawing.axes[0].texts) for figure in (rate, error)
    ]
    assert texts == [["0", "0.5", "1"], ["0.5", "2", "8"]]
