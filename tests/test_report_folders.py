"""`servobench report`: what a page says of a run, a bench, the papers, and of broken folders."""

import html
import json
import re
import shlex
import shutil
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pyarrow.parquet as pq
import pytest
from kept import keep, spoil

from servo.cli.report_command import Printed, write
from servo.mistake import Mistake
from servo.report.study_time import band, survival
from servo.study.run import Record
from servo.study.store import StudyFile
from tracking.evaluation.track_measures import OVERLAPS, PIXELS

EVIL = "<script>alert(1)</script>"


def encoded(kind):
    image = np.random.default_rng(0).integers(0, 255, (30, 60, 3)).astype(np.uint8)
    return cv2.imencode(kind, image)[1].tobytes()


def text_of(folder, tmp_path):
    return write([folder], tmp_path / "page.html")[0].read_text(encoding="utf-8")


def make_bench(folder):
    (folder / "sheets").mkdir(parents=True)
    StudyFile(
        command=f"servobench evaluate mine.toml --trackers kams,{EVIL} --seeds 1",
        versions={"servobench": "0.1.0"},
        holds="evaluate",
        name="mine",
        title="Trackers against each other on sequences with a truth.",
        axes={"tracker": ["kams", EVIL], "sequence": list("abcdefghijk")},
        draws={},
        seeds=[0],
        compare="tracker",
        expect={},
        runs=22,
        table={},
        scenarios={},
    ).write(folder)
    records = []
    for i, (tracker, auc, lost) in enumerate((("kams", 0.857, 9.0), (EVIL, 0.25, 2.0))):
        for k, name in enumerate("abcdefghijk"):
            record = Record(
                number=11 * i + k,
                subject=name,
                subject_is="sequence",
                seed=0,
                settings={"tracker": tracker, "family": name, "drawn": False},
                outcome="COMPLETED",
                success=True,
                measures={"auc": auc, "frames_until_loss": lost},
                series={"success_curve": auc * (1 - OVERLAPS), "precision_curve": PIXELS / 50},
            )
            records.append(record)
    keep(folder, records)
    (folder / "sheets" / "a.png").write_bytes(encoded(".png"))
    return folder


@pytest.mark.newest  # Rerun before 0.38 reads no recording, and the page has no picture of it
def test_a_run_tells_outcome_bounds_pictures_and_the_command_that_repeats_it(ran, tmp_path):
    page = text_of(ran, tmp_path)
    report = json.loads((ran / "report.json").read_text())
    assert '<h1>still, seed 3</h1><span class="badge bad">TIMED_OUT</span>' in page
    assert '<span class="badge bad">1 of 2</span>' in page
    assert [m["name"] for m in report["missed"]] == ["servo_rms_px"]
    found = report["measures"]["servo_rms_px"]
    assert f"<li>servo_rms_px is {found:.3g}, expected at most 0.5</li>" in page
    row = re.search(r"<tr><td>servo_rms_px</td>.*</tr>", page).group()
    assert f">{report['measures']['servo_rms_px']:.3g}</td>" in row
    assert row.count("missed") == 1
    assert page.count("<svg") == 4
    assert page.count('<img src="data:image/jpeg;base64,') == 1
    command = html.unescape(re.findall("<code>(.*)</code>", page)[-1])
    assert shlex.split(command) == [
        "servobench",
        "run",
        "still",
        "--set",
        "run.duration=0.5",
        "--set",
        "measure.after=0.4",
        "--set",
        "expect={}",
        "--set",
        "expect.tilt_peak_deg=1.0",
        "--set",
        "expect.servo_rms_px=0.5",
        "--set",
        "tracker.kind=mean_shift",
        "--seed",
        "3",
    ]


@pytest.mark.newest
def test_the_pictures_of_a_recording_come_with_the_rectangles_of_the_table(ran):
    from servo.output.recording.recorded_frames import pictures

    found = pictures(ran / "run.rrd", 4)
    table = pq.read_table(ran / "steps.parquet").to_pylist()
    assert [round(p.time * 30) for p in found] == [0, 4, 9, 14]
    for picture in found:
        row = table[round(picture.time * 30)]
        assert picture.image.shape == (240, 320, 3)
        for corners, who in ((picture.truth, "true"), (picture.estimate, "estimated")):
            at = [row[f"{who}_x_px"], row[f"{who}_y_px"]]
            np.testing.assert_allclose(corners.mean(axis=0), at, atol=0.3)


def test_a_run_without_a_recording_says_so(ran, tmp_path):
    shutil.copytree(ran, tmp_path / "bare", ignore=shutil.ignore_patterns("*.rrd"))
    page = text_of(tmp_path / "bare", tmp_path)
    assert "There is no recording in this folder, so there are no pictures." in page
    assert "<img" not in page


@pytest.mark.newest
def test_a_recording_without_pictures_says_so(ran, section, monkeypatch):
    from servo.output.recording import recorded_frames

    monkeypatch.setattr(recorded_frames, "pictures", lambda path, count: [])
    blocks = {block["title"]: block for block in section(ran)["blocks"]}
    told = blocks["What the camera saw"]
    assert (told["text"], told["pictures"]) == (["There are no pictures in this recording."], [])


def test_survival_counts_who_was_never_off_the_target_after_the_first_second():
    time = np.arange(0, 4, 0.5)
    never, early, late = np.ones(8), time != 0.5, time < 2
    series = [{"time_s": time, "on_target": on} for on in (never, early, late)]
    times, share = survival(series)
    assert times[-1] == 4.0
    assert share[times < 2].tolist() == [1.0] * int(np.sum(times < 2))
    np.testing.assert_allclose(share[times > 2], 2 / 3)


def test_a_band_has_the_percentiles_of_the_runs_that_last_so_long():
    long, short = np.arange(0, 4, 0.5), np.arange(0, 2, 0.5)
    series = [
        {"time_s": t, "e": np.full(len(t), v)} for t, v in ((long, 0.0), (long, 10.0), (short, 5.0))
    ]
    times, middle, low, high = band(series, "e")
    np.testing.assert_allclose([low[0], middle[0], high[0]], [1, 5, 9])
    np.testing.assert_allclose([low[-1], middle[-1], high[-1]], [1, 5, 9])
    np.testing.assert_allclose(high[times > 2.1], 9.0)
    assert band(series, "not there") is None


def test_a_bench_ranks_its_trackers_and_shows_its_curves(tmp_path):
    page = text_of(make_bench(tmp_path / "bench"), tmp_path)
    assert '<span class="badge plain">best: kams</span>' in page
    assert '<tr><td>kams</td><td class="number">11</td><td class="number">0.857' in page
    assert (
        "kams tracks for longer than &lt;script&gt;alert(1)&lt;/script&gt; (McNemar, p &lt; 0.05)."
        in page
    )
    assert (page.count("<svg"), page.count("<img")) == (2, 1)  # curves, and a contact sheet
    assert page.count("<script") == 1  # the page's own
    assert "servobench evaluate mine.toml --trackers kams,&lt;script&gt;" in page


def test_the_curves_of_a_bench_are_files(tmp_path):
    write([make_bench(tmp_path / "bench")], tmp_path / "page.html", Printed(figures="svg"))
    names = sorted(path.name for path in (tmp_path / "figures").iterdir())
    assert names == ["01-success.svg", "02-precision.svg"]
    assert "kams" in (tmp_path / "figures" / names[0]).read_text()


def test_a_bench_with_a_damaged_run_names_no_best_tracker(tmp_path):
    folder = make_bench(tmp_path / "bench")
    spoil(folder, 0)
    page = text_of(folder, tmp_path)
    assert "<p>This study is not finished: 21 of 22 runs.</p>" in page
    assert "<p>Runs that are damaged: 1.</p>" in page
    assert ">21 of 22 runs</span>" in page
    assert "best: " not in page


def test_all_that_is_said_of_a_bench_and_the_papers(section, approved, make_papers, tmp_path):
    approved("report/bench", section(make_bench(tmp_path / "bench")))
    approved("report/papers", section(make_papers(tmp_path / "papers")))


def test_papers_tell_which_claims_hold(make_papers, tmp_path):
    page = text_of(make_papers(tmp_path / "papers"), tmp_path)
    assert "1 holds, 1 does not hold</span>" in page
    assert "<h2>P2-2: does not hold</h2>" in page
    assert "<p>Effect: 1.5 px (1 to 2.25), 2 units.</p>" in page
    assert "<p>Measured: 1 &amp; 2.</p>" in page
    assert "<code>servobench papers P0-1a P2-2 --quick</code>" in page


HEAD = {"format": 1, "kind": "study", "command": "", "versions": {}}
STUDY = json.dumps(
    HEAD
    | {
        "format": StudyFile.FORMAT,
        "name": "s",
        "title": "",
        "axes": {},
        "draws": {},
        "seeds": [0],
        "compare": None,
        "expect": {},
        "runs": 1,
        "table": {},
        "scenarios": {},
    }
).encode()
BAD = {
    "no folder": (
        None,
        "{}: there is no such folder: name one, or loop-v2 or loop-v2-size or loop-v2-all or servo-v2 or goal-v1 or loop-v1 or servo-v1 without --measures",
    ),
    "nothing known": (
        {"notes.txt": b""},
        "{}: this folder has no results of `servobench run`, `evaluate`, `benchmark`, `papers`, `sweep` or `compare`: name a folder that one of them wrote",
    ),
    "a track": (
        {"report.json": b"{}"},
        "{}: this folder has no results of `servobench run`, `evaluate`, `benchmark`, `papers`, `sweep` or `compare`: name a folder that one of them wrote",
    ),
    "half a file": (
        {"study.json": STUDY[:-9]},
        "{}/study.json: this is not JSON; it may be half-written: repeat the command that wrote it, into a new folder",
    ),
    "a value is missing": (
        {"papers.json": b'{"format": 1, "kind": "papers"}'},
        "{}/papers.json: the content of this file is wrong: command: field required; repeat the command that wrote it, into a new folder",
    ),
    "an empty bench": (
        {"study.json": json.dumps(json.loads(STUDY) | {"holds": "evaluate"}).encode()},
        "{}: this folder has no finished runs; repeat the command that wrote it",
    ),
    "papers that were stopped": (
        {"study.json": json.dumps(json.loads(STUDY) | {"holds": "papers"}).encode()},
        "{}/papers.json: cannot read this file: No such file or directory",
    ),
    "a run that was killed": (
        {"steps.arrows": b""},
        "{}: this run has not ended (report.json is missing, steps.arrows has its rows): wait for its "
        "end or, if it was stopped, run it again into a new folder",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_a_mistake_is_one_sentence_and_writes_nothing(tmp_path, case):
    written, message = BAD[case]
    folder = tmp_path / "out"
    if written is not None:
        folder.mkdir()
    for name, content in (written or {}).items():
        (folder / name).write_bytes(content)
    with pytest.raises(Mistake) as told:
        write([folder], tmp_path / "page.html")
    assert str(told.value) == message.format(folder)
    assert not (tmp_path / "page.html").exists()


@pytest.mark.newest
def test_broken_pictures_and_recordings_are_mistakes(ran, tmp_path):
    folder = make_bench(tmp_path / "bench")
    (folder / "sheets" / "a.png").write_bytes(b"x")
    with pytest.raises(Mistake, match=r"/sheets/a\.png: this is not a picture; it may be half-"):
        write([folder], None)
    shutil.copytree(ran, tmp_path / "run")
    whole = (ran / "run.rrd").read_bytes()
    (tmp_path / "run" / "run.rrd").write_bytes(whole[:100] + bytes(500))
    with pytest.raises(
        Mistake,
        match=r"/run\.rrd: this recording is damaged: repeat the command that wrote it, into a new folder$",
    ):
        write([tmp_path / "run"], None)


@pytest.mark.newest
@pytest.mark.parametrize("blob", [b"", b"no picture"])
def test_a_picture_of_a_recording_that_cannot_be_decoded_is_a_mistake(monkeypatch, blob):
    from servo.output.recording import recorded_frames as reader

    logged = (reader.BLOB, 3, 0.1, SimpleNamespace(as_py=lambda: [blob]))
    monkeypatch.setattr(reader, "check", lambda path: None)
    monkeypatch.setattr(reader, "_logged", lambda path: iter([logged]))
    with pytest.raises(Mistake) as found:
        reader.pictures(Path("run.rrd"), 1)
    assert str(found.value) == (
        "run.rrd: this recording is damaged (the picture of frame 3 cannot be decoded): repeat "
        "the command that wrote it, into a new folder"
    )


def test_a_page_that_cannot_be_written_is_a_mistake(make_papers, tmp_path):
    folder = make_papers(tmp_path / "papers")
    with pytest.raises(Mistake, match=r"gone/x\.html: there is no folder .*gone: make it first$"):
        write([folder], tmp_path / "gone" / "x.html")
    with pytest.raises(Mistake, match=r"papers/figures: this is not a file; name a file to write"):
        write([folder], folder / "figures")
    before = (folder / "papers.json").read_bytes()
    with pytest.raises(Mistake, match=r"papers\.json: the name of this file should end in \.html"):
        write([folder], folder / "figures" / ".." / "papers.json")
    assert (folder / "papers.json").read_bytes() == before
    assert write([folder], folder / "mine.html") == write([folder], folder / "mine.html")


def altered(table, name, values):
    """The table with other values in a column; without the column where there are none."""
    at = table.column_names.index(name)
    return table.remove_column(at) if values is None else table.set_column(at, name, [values])


@pytest.mark.parametrize("name", ["time_s", "status", "error_theta_rad", "motion_true_xn_m_s"])
@pytest.mark.parametrize("values", [None, "texts", "lists"])
def test_steps_without_a_column_of_a_run_are_a_mistake(ran, tmp_path, name, values):
    folder = shutil.copytree(ran, tmp_path / "run")
    table = pq.read_table(folder / "steps.parquet")
    odd = {"texts": ["text"] * len(table), "lists": [[1.0]] * len(table), None: None}[values]
    pq.write_table(altered(table, name, odd), folder / "steps.parquet")
    if (name, values) == ("status", "texts"):
        assert "Over time" in text_of(folder, tmp_path)  # nothing was LOCKED then
        return
    with pytest.raises(Mistake) as told:
        text_of(folder, tmp_path)
    assert str(told.value) == (
        f"{folder}/steps.parquet: column '{name}' is missing or has no numbers: repeat the "
        "command that wrote it, into a new folder"
    )


@pytest.mark.parametrize("lost", ["run", "table", "versions"])
def test_a_report_without_its_settings_is_a_page_or_a_mistake(ran, tmp_path, lost):
    folder = shutil.copytree(ran, tmp_path / "run")
    report = json.loads((folder / "report.json").read_text())
    if lost == "run":
        del report["settings"]["run"]
    else:
        report[lost] = {"measure": None}
    (folder / "report.json").write_text(json.dumps(report))
    if lost == "run":
        assert "Measures and bounds" in text_of(folder, tmp_path)
        return
    with pytest.raises(Mistake) as told:
        text_of(folder, tmp_path)
    assert str(told.value).startswith(f"{folder}/report.json: the ")
    assert lost in str(told.value)


def test_a_table_without_a_report_is_named(ran, tmp_path):
    shutil.copy(ran / "steps.parquet", tmp_path)
    with pytest.raises(Mistake) as told:
        text_of(tmp_path, tmp_path)
    assert str(told.value) == (
        f"{tmp_path}: this run has not ended (report.json is missing, steps.parquet has its rows): "
        "wait for its end or, if it was stopped, run it again into a new folder"
    )
