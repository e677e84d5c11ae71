"""`servobench evaluate` on short painted sequences: its files, its order, how it goes on."""

import csv
import shutil

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from kept import drop

from servo.cli import main
from servo.cli.main import app
from servo.study import ranking
from servo.study.run import Job, Record
from tracking.evaluation.track_measures import MEASURES

SUITE = """
[[sequences]]
kind = "clutter"
level = "a"
frames = 40

[[trackers]]
kind = "sok"

[[trackers]]
kind = "frozen"
label = "nothing"
"""
WORDS = ("mine.toml", "--seeds", "2", "--workers", "1", "--out", "out")


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(SUITE)
    return tmp_path


def call(monkeypatch, capfd, *arguments):
    monkeypatch.setattr("sys.argv", ["servobench", "evaluate", *arguments])
    with pytest.raises(SystemExit) as left:
        main.main()
    out, err = capfd.readouterr()
    return left.value.code, out, err


def bench(monkeypatch, capfd, *more):
    return call(monkeypatch, capfd, *WORDS, *more)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A folder with the finished bench; copy it to change it."""
    folder = tmp_path_factory.mktemp("finished")
    (folder / "mine.toml").write_text(SUITE)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        done = CliRunner().invoke(app, ["evaluate", *WORDS])
    assert (done.exit_code, done.exception) == (0, None)
    return folder / "out"


@pytest.mark.parametrize("damage", ["missing", "empty", "cut", "cut in a row", "noise"])
def test_a_track_that_is_lost_is_computed_again(monkeypatch, capfd, place, finished, damage):
    shutil.copytree(finished, place / "out")
    path = place / "out" / "tracks" / "sok" / "clutter-a-0.csv"
    whole = path.read_bytes()
    left = {"empty": b"", "cut": b"\n".join(whole.split(b"\n")[:20]) + b"\n", "noise": b"\xff" * 99}
    path.write_bytes(left.get(damage, whole[: len(whole) // 2]))
    if damage == "missing":
        path.unlink()
    code, _, err = bench(monkeypatch, capfd)
    assert code == 0
    sentence = "this track is missing or damaged and is computed again"
    assert f"servobench: out/tracks/sok/clutter-a-0.csv: {sentence}\n" in err
    assert "Traceback" not in err
    assert len(path.read_bytes().splitlines()) == len(whole.splitlines())
    assert sentence not in bench(monkeypatch, capfd)[2]


@pytest.mark.usefixtures("no_progress")
def test_a_bench_writes_tables_curves_tracks_and_sheets(monkeypatch, capfd, place):
    code, out, err = bench(monkeypatch, capfd)
    assert (code, err) == (0, "")
    rows = rows_of(place / "out" / "runs.csv")
    assert [(r["tracker"], r["seed"]) for r in rows] == [
        ("sok", "0"),
        ("sok", "1"),
        ("nothing", "0"),
        ("nothing", "1"),
    ]
    auc = [float(r["auc"]) for r in rows]
    assert min(auc[:2]) > 0.8
    assert max(auc[2:]) < 0.4
    table = rows_of(place / "out" / "table.csv")
    assert [r["tracker"] for r in table] == ["sok", "nothing"]
    assert float(table[0]["auc_low"]) <= float(table[0]["auc"]) <= float(table[0]["auc_high"])
    assert {m.name for m in MEASURES} < set(rows[0])
    for name in ("success.png", "precision.png", "sheets/clutter-a.png"):
        assert cv2.imread(str(place / "out" / name)).std() > 10
    assert (place / "out" / "tracks" / "sok" / "clutter-a-1.csv").exists()
    assert out.index("sok") < out.index("nothing")


def test_a_stopped_bench_goes_on_and_repeats_nothing(monkeypatch, capfd, place, finished):
    shutil.copytree(finished, place / "out")
    before = (place / "out" / "runs.csv").read_text()
    drop(place / "out", 1)
    ran = []
    run = Job.run
    monkeypatch.setattr(Job, "run", lambda job, to: ran.append(job.key) or run(job, to))
    assert bench(monkeypatch, capfd)[0] == 0
    assert ran == ["000001"]
    assert without_times(place / "out" / "runs.csv") == without_times(before)


def rows_of(path):
    with path.open() as file:
        return list(csv.DictReader(file))


def without_times(table):
    text = table if isinstance(table, str) else table.read_text()
    return [
        {k: v for k, v in r.items() if k not in ("milliseconds", "auc_streamed")}
        for r in csv.DictReader(text.splitlines())
    ]


def test_a_folder_of_other_settings_is_refused(monkeypatch, capfd, place, finished):
    shutil.copytree(finished, place / "out")
    (place / "mine.toml").write_text(SUITE.replace("frames = 40", "frames = 9"))
    assert bench(monkeypatch, capfd)[::2] == (
        2,
        "servobench: out: this folder holds another study (its settings differ: runs); choose "
        "another folder with --out\n",
    )


@pytest.mark.usefixtures("no_progress")
def test_a_run_that_fails_is_named_and_the_others_go_on(monkeypatch, capfd, place):
    run = Job.run

    def fail(job, to):
        if job.number == 1:
            raise RuntimeError("out of paint")
        return run(job, to)

    monkeypatch.setattr(Job, "run", fail)
    code, _, err = bench(monkeypatch, capfd)
    assert (code, err) == (
        1,
        "servobench: out/failures/000001.json: RuntimeError: out of paint\n",
    )
    assert len(rows_of(place / "out" / "runs.csv")) == 3


def test_folders_of_sequences_and_presets_are_benched(monkeypatch, capfd, place):
    for name in ("one", "two"):
        (place / "all" / name / "img").mkdir(parents=True)
        for k in range(4):
            image = np.full((60, 80, 3), 200, np.uint8)
            image[20:40, 20 + 2 * k : 40 + 2 * k] = (10, 200, 90)
            image[26:34, 26 + 2 * k : 34 + 2 * k] = (200, 20, 90)
            cv2.imwrite(str(place / "all" / name / "img" / f"{k}.png"), image)
        lines = [f"{20 + 2 * k},20,20,20" for k in range(4)]
        (place / "all" / name / "groundtruth.txt").write_text("\n".join(lines))
    (place / "all" / "two" / "img" / "2.png").write_bytes(b"no picture")
    arguments = ["--trackers", "mean_shift,mean_shift:paper", "--seeds", "1", "--workers", "1"]
    code, _, err = call(monkeypatch, capfd, "all", *arguments, "-q")
    # Said once, though both trackers have read the picture.
    assert (code, err) == (
        0,
        "servobench: two: 1 of 4 pictures cannot be read, the first is 2.png (this picture cannot "
        "be decoded; known formats are JPEG, PNG, BMP, TIFF, WebP, PPM); "
        "their rows have the status LOST\n",
    )
    rows = rows_of(place / "runs" / "evaluate-all" / "runs.csv")
    assert [(r["tracker"], r["sequence"]) for r in rows] == [
        ("mean_shift", "one"),
        ("mean_shift", "two"),
        ("mean_shift-paper", "one"),
        ("mean_shift-paper", "two"),
    ]
    assert all(float(r["mean_error_px"]) < 3 for r in rows)


BAD = {
    "no suite": (
        ["magic"],
        "there is no suite 'magic'; give clutter, hard_clutter, similarity, texture, "
        "camouflage, closed_loop, a folder or a .toml file",
    ),
    "no tracker": (
        ["clutter", "--trackers", "kams:book"],
        "--trackers.preset: there is no preset 'book'; there is paper",
    ),
    "the same twice": (
        ["clutter", "--trackers", "kams,kams", "--seeds", "1"],
        "--trackers: two trackers are called 'kams': leave one out, or rename it: a recorded "
        "sequence by its folder, a tracker by its label in a suite's file",
    ),
    "no file": (["gone.toml"], "gone.toml: cannot read this suite: No such file or directory"),
    "no key": (["odd.toml"], "odd.toml: there is no key 'sequence'; did you mean 'sequences'?"),
    "no sequences": (["none.toml"], "none.toml: sequences: a value is missing"),
    "no level": (
        ["level.toml"],
        "level.toml: sequences[0].level = 'z': input should be 'a', 'b', 'c', 'd', 'e', 'f', 'g' "
        "or 'h'",
    ),
    "the same sequence twice": (
        ["twice.toml"],
        "twice.toml: two sequences are called 'similarity': leave one out, or rename it: a "
        "recorded sequence by its folder, a tracker by its label in a suite's file",
    ),
    "the same label twice": (
        ["label.toml"],
        "label.toml: two trackers are called 'kams': leave one out, or rename it: a recorded "
        "sequence by its folder, a tracker by its label in a suite's file",
    ),
    "a label that is no text": (
        ["number.toml"],
        "number.toml: trackers[0].label = 3: expected a text",
    ),
    "an empty folder": (
        ["empty"],
        "empty: there is no sequence in this folder: give a folder with pictures and a truth file, "
        "or a folder of such folders",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_a_mistake_is_one_sentence(monkeypatch, capfd, place, case):
    (place / "empty").mkdir()
    (place / "odd.toml").write_text("[[sequence]]\n")
    (place / "none.toml").write_text("")
    (place / "level.toml").write_text('[[sequences]]\nkind = "clutter"\nlevel = "z"\n')
    one = '[[sequences]]\nkind = "similarity"\n'
    (place / "twice.toml").write_text(one + f"{one}frames = 30\n")
    (place / "label.toml").write_text(one + 2 * '[[trackers]]\nkind = "kams"\n')
    (place / "number.toml").write_text(one + '[[trackers]]\nkind = "kams"\nlabel = 3\n')
    arguments, message = BAD[case]
    assert call(monkeypatch, capfd, *arguments)[::2] == (2, f"servobench: {message}\n")


def result(tracker, seed, frames, auc, sequence="s", drawn=True):
    return Record(
        subject=sequence,
        subject_is="sequence",
        seed=seed,
        settings={"tracker": tracker, "family": "f", "drawn": drawn},
        outcome="LOST",
        success=False,
        measures={"frames_until_loss": float(frames), "auc": auc, "lost_auc": np.nan},
        versions={},
    )


def test_seeds_on_a_recording_are_one_observation_and_every_pair_of_trackers_is_corrected_for():
    kinds = {"good": 0.6, "middle": 0.5, "poor": 0.4}
    results = [
        result(tracker, seed, 100 * auc, auc + 0.01 * k, f"s{k}", drawn=False)
        for tracker, auc in kinds.items()
        for k in range(8)
        for seed in range(3)
    ]
    best, _, last = ranking.ranked(results)
    assert (best.runs, best.units, best.means["auc"].units) == (24, 8, 8)
    test = last.against_best
    assert (test.wins, test.losses) == (0, 8)
    assert last.p == pytest.approx(3 * 2 / 2**8)  # three pairs, each 8 to 0


def test_one_recording_has_no_interval():
    (rank,) = ranking.ranked([result("a", 0, 10, 0.4, drawn=False)])
    assert (rank.means["auc"].value, rank.means["auc"].known, rank.units) == (0.4, False, 1)


def test_trackers_are_ranked_and_tested_against_the_best():
    results = [result("a", s, 10, 0.4) for s in range(9)]
    results += [result("b", s, 30 if s < 8 else 5, 0.6) for s in range(9)]
    best, other = ranking.ranked(results)
    assert (best.tracker, best.against_best) == ("b", None)
    assert (other.against_best.wins, other.against_best.losses) == (1, 8)
    assert other.against_best.z == pytest.approx(2.0)
    assert other.p == pytest.approx(20 / 2**9)  # two-sided: 2 * (1 + 9) of 2^9 splits
    assert best.means["auc"].value == pytest.approx(0.6)
    assert "lost_auc" not in best.means
