"""The public benchmarks: their worlds, scores by hand, rows, and what is refused."""

import copy
import dataclasses
import hashlib
import json
import shlex
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import tiny_onnx
from publish import FEW, FIRST_PAGE, PAGES, with_tables

from servo.bench import audit
from servo.bench import benchmark as benchmarks
from servo.bench.benchmark import Band, World, condition_of, load
from servo.bench.contestant import Contestant, Division, contestants, scale_of
from servo.bench.names import NAMES
from servo.bench.row import (
    TAUS,
    Row,
    check_version,
    curve_of,
    row_of,
    shipped_rows,
    slow_of,
)
from servo.bench.score import Difficulty, Discrimination, effects, item_rest, standings
from servo.bench.world_run import OVERLAP, WITHIN, errors_of, jobs_of
from servo.bench.world_score import (
    DIGITS,
    ERROR,
    LAST,
    PICTURE,
    WorldScore,
    area_within,
    score_errors,
    world_score,
)
from servo.cli import benchmark_command, main
from servo.loop.episode import Episode
from servo.loop.part_failures import PartFailed
from servo.mistake import Mistake
from servo.report import benchmark_section
from servo.scenario.part_names import settings_of
from servo.scenario.toml import copied, put
from servo.study.execute import Workers, execute
from servo.study.run import ClusterLost, Record
from servo.types import Command
from sim import world as sim_world
from sim.files import picture_name

DIGEST = 64 * "0"
BENCH = ("benchmark", "servo-v1", "--workers", "1")


@pytest.fixture(scope="module", params=NAMES)
def public(request):
    return load(request.param)


def row(name, areas, division="CLOSED", **more):
    worlds = {f"plain-{i:02}": WorldScore(area, area >= 0.9, "") for i, area in enumerate(areas)}
    fields = dict.fromkeys(("command", "benchmark", "hash", "machine"), "x")
    given = {"band": "dev", "settings": {}, "track_ms": 1.0, "versions": {}}
    given |= {"digest": DIGEST, "curve": [0.5] * len(TAUS)} | more
    return Row(contestant=name, division=division, worlds=worlds, **fields, **given)


def test_worlds_are_balanced_within_each_condition(public):
    for condition in public.conditions:
        worlds = public.worlds_of(condition, Band("v1"))
        assert len({w.seed for w in worlds}) == len(worlds) == public.worlds
        uniform = {} if condition.severity else condition.ranges
        for key, (low, high) in uniform.items():
            if isinstance(low, int):
                continue  # numbers of things, which are rounded
            parts = [(w.settings[key] - low) / (high - low) * len(worlds) for w in worlds]
            rounded = 2e-6 / (high - low) * len(worlds)
            beyond = np.sort(parts) - np.arange(len(worlds))
            assert beyond.min() >= -rounded
            assert beyond.max() <= 1 + rounded
        for factor, levels in condition.factors.items():
            counts = [sum(w.levels[factor] == level for w in worlds) for level in levels]
            few = public.worlds < len(levels)  # some occur twice, others never
            assert max(counts) - min(counts) <= (2 if few else 1)


def test_a_severity_moves_each_setting_from_its_mild_value():
    draft = load("goal-v1")
    worst = next(c for c in draft.conditions if c.name == "all")
    worlds = draft.worlds_of(worst, Band("dev"))
    sizes = np.array([world.size for world in worlds])
    assert sorted(np.floor(draft.worlds * sizes)) == [*range(draft.worlds)]
    low, high = worst.ranges["start.tilt_deg"]
    for world in worlds:
        assert world.size * low <= world.settings["start.tilt_deg"] + 1e-5
        assert world.settings["start.tilt_deg"] <= world.size * high + 1e-5
        assert 1 - world.settings["start.scale"] <= world.size * 0.6 + 1e-5
        assert isinstance(world.settings["clutter.number"], int)


def test_bands_share_no_seed(public):
    bands = [Band("dev"), Band("v1"), Band("sealed", "a headline", "abc")]
    seeds = [{w.seed for w in public.every_world(band)} for band in bands]
    assert not seeds[0] & seeds[1]
    assert not (seeds[0] | seeds[1]) & seeds[2]
    assert max(seeds[0]) < 1000
    other = {w.seed for w in public.every_world(Band("sealed", "another headline", "abc"))}
    assert not seeds[2] & other


def test_sealed_seeds_stay_those_of_the_frozen_benchmark_the_digest_and_the_value():
    """Anybody can draw the sealed worlds of a published row again, with any later version."""
    found = load("loop-v1").every_world(Band("sealed", "a headline", "abc"))
    assert [(world.key, world.seed) for world in (found[0], found[1], found[-1])] == [
        ("plain-00", 894743184989),
        ("plain-01", 444122274789),
        ("camouflage-29", 872531158945),
    ]


def test_every_world_is_a_valid_scenario(public):
    ends = [one.settings for one in scale_of(public)]
    for world in public.every_world(Band("dev"), 3):
        for settings in ends:
            scenario = public.scenario_of(world, settings)
            assert scenario.run.seed == world.seed


def test_the_frozen_versions_are_those_of_the_published_rows(public):
    public.check_frozen()
    for published in shipped_rows(public):
        assert published.hash == public.hash
        assert published.band == "v1"
        assert published.rendering in ("", public.rendering)
        assert len(published.worlds) == public.worlds * len(public.conditions)


def test_a_changed_default_is_refused(public):
    key = next(iter(public.frozen))
    changed = replace(public, frozen=public.frozen | {key: "other"})
    with pytest.raises(Mistake, match="when the benchmark was frozen"):
        changed.check_frozen()
    assert changed.hash != public.hash


@pytest.mark.parametrize(
    ("name", "constant"),
    [
        ("loop-v1", "FARTHEST"),
        ("loop-v1", "HELD_SIZE"),
        ("loop-v1", "HELD_SHARE"),
        ("servo-v1", "ARRIVED_MM"),
        ("servo-v1", "ARRIVED_DEG"),
        ("servo-v1", "NEAR_MM"),
        ("servo-v1", "NEAR_DEG"),
    ],
)
def test_a_changed_measure_is_refused(monkeypatch, name, constant):
    monkeypatch.setattr(benchmarks, constant, 0.5)
    with pytest.raises(Mistake, match=f"score.{constant.lower()} is 0.5 in this version, and was"):
        load(name).check_frozen()


def test_a_later_version_hashes_its_measures(public, monkeypatch):
    """What is frozen by `tests/tools/freeze.py` has the measures among its settings."""
    later = [replace(public, frozen=public.settings(), pinned={})]
    monkeypatch.setattr(benchmarks, "FARTHEST", 3.0)
    monkeypatch.setattr(benchmarks, "ARRIVED_MM", 3.0)
    later.append(replace(public, frozen=public.settings(), pinned={}))
    assert later[0].hash != later[1].hash


def test_the_hashes_are_those_of_the_manual():
    assert [load(name).hash for name in NAMES] == [
        "0e73a6c113ce7067",
        "6c7cee5e2e9f263e",
        "80b0be61c9e23cb1",
        "4a832359b0d1a289",
        "099184571350d486",
        "734e2e1421d5ad10",
        "728d1dddd65c04ec",
    ]


def test_the_defaults_of_home_contestants_are_those_of_their_rows(public):
    """The file has each row's settings at the commit that added it, from the history of git."""
    before = json.loads(Path("tests/data/home_settings.json").read_text())
    rows = [row for row in shipped_rows(public) if row.division == "HOME"]
    for one in rows:
        now = public.resolved(one.settings)
        for key, value in before[f"{public.name}/{one.contestant}"].items():
            assert now[key] == value, f"{one.contestant}: {key}"


def test_any_edit_of_the_file_is_another_version(public):
    edited = benchmarks.parsed(public.name, public.text + "\n", public.frozen, "")
    assert edited.hash != public.hash


def test_each_condition_has_a_scale_of_its_own():
    """In `easy` standing still has .6 and the truth 1, in `hard` .2 and .6: a point is .004 there."""

    def of(name, *areas, benchmark="x"):
        keys = ("easy-00", "easy-01", "hard-00", "hard-01")
        worlds = {k: WorldScore(a, held=False) for k, a in zip(keys, areas, strict=True)}
        return replace(row(name, []), worlds=worlds, benchmark=benchmark)

    ends = [("still", 0.6, 0.6, 0.2, 0.2), ("truth", 1.0, 1.0, 0.6, 0.6)]
    mine = ("mine", 0.9, 0.7, 0.6, 0.4)
    [own] = standings([of(*each) for each in (*ends, mine)])
    assert own.points == pytest.approx(
        {"easy-00": 75, "easy-01": 25, "hard-00": 100, "hard-01": 50}
    )
    assert own.score.value == pytest.approx(62.5)
    # Worlds are 25 points from their conditions' means: two degrees of freedom for four worlds.
    [first] = standings([of(*each, benchmark="loop-v1") for each in (*ends, mine)])
    assert first.score.value == pytest.approx(62.5)
    stratified, whole = (s.score.high - s.score.low for s in (own, first))
    deviations = [np.sqrt(4 * 25**2 / 2), np.std([75, 25, 100, 50], ddof=1)]
    assert stratified / whole == pytest.approx(deviations[0] / deviations[1], rel=1e-6)


def test_the_area_is_that_under_the_curve():
    errors = np.array([0.1, 0.4, 1.7, 3.0, np.inf])
    taus = np.linspace(0.0, 2.0, 200_001)
    curve = [(errors <= tau).mean() for tau in taus[::100]]
    assert area_within(errors, 2.0) == pytest.approx(np.mean(curve), abs=1e-3)


def test_scores_by_hand():
    """Areas .2 (still) and .8 (truth) fix the scale: a point is .006."""
    rows = [row("still", [0.2] * 4), row("truth", [0.8] * 4)]
    rows += [row("good", [0.8, 0.8, 0.5, 0.5]), row("poor", [0.2, 0.2, 0.5, 0.2])]
    first, second = standings(rows)
    assert (first.name, second.name) == ("good", "poor")
    assert first.score.value == pytest.approx(75.0)
    assert second.score.value == pytest.approx(12.5)
    # Points 100, 100, 50, 50 have no skewness: mean +- t s / sqrt(n), with t(3) = 3.18245.
    half = 3.18245 * np.sqrt(4 * 25**2 / 3) / np.sqrt(4)
    assert (first.score.low, first.score.high) == pytest.approx((75 - half, 75 + half), abs=1e-3)
    # Points 0, 0, 50, 0: mean 12.5, deviation 25, skewness (3 * -.5^3 + 1.5^3) / 4 = .75. Hall's
    # W + g W^2 / 3 + g^2 W^3 / 27 + g / (6 n) is t / sqrt(n), with W = (12.5 - end) / 25.
    for end, t in ((second.score.low, 3.18245), (second.score.high, -3.18245)):
        w = (12.5 - end) / 25
        hall = w + 0.75 * w**2 / 3 + 0.75**2 * w**3 / 27 + 0.75 / 24
        assert hall == pytest.approx(t / np.sqrt(4), abs=1e-4)
    assert list(first.points.values()) == pytest.approx([100, 100, 50, 50])
    # Three wins and a tie of four worlds.
    assert first.beats_next == pytest.approx(3.5 / 4)
    assert second.beats_next is None
    # Four worlds are too few to tell two contestants apart.
    assert (first.first, first.last) == (1, 2)


def test_ranks_part_where_one_is_always_better():
    rng = np.random.default_rng(0)
    areas = rng.uniform(0.3, 0.6, 30)
    rows = [row("still", [0.1] * 30), row("a", areas + 0.2), row("b", areas), row("c", areas)]
    best, *others = standings(rows)
    assert (best.name, best.first, best.last) == ("a", 1, 1)
    assert [(s.first, s.last) for s in others] == [(2, 3), (2, 3)]


def test_ranks_compare_what_the_score_is_the_mean_of():
    """`exact` is better in 24 of 30 worlds, and loses its target in six: Wilcoxon prefers it."""
    rows = [row("still", [0.1] * 30), row("safe", [0.80] * 30)]
    rows += [row("exact", [0.81] * 24 + [0.1] * 6)]
    first, second = standings(rows)
    assert (first.name, first.beats_next) == ("safe", 0.2)
    # t = .132 / (.289 / sqrt(30)) = 2.51: p = .018
    assert (first.first, first.last, second.first, second.last) == (1, 1, 2, 2)


def test_a_table_needs_what_fixes_its_scale():
    with pytest.raises(Mistake, match="are missing: run the benchmark for 'still' too"):
        standings([row("a", [1.0])])


def test_worlds_that_tell_nothing_are_counted():
    rows = [row("still", [0.0] * 3), row("a", [1.0, 1.0, 0.0]), row("b", [1.0, 0.0, 0.0])]
    rows.append(row("frozen", [0.0] * 3))
    assert Difficulty.of(standings(rows)) is None  # two contestants say nothing
    rows.append(row("c", [1.0, 0.0, 0.0]))
    assert Difficulty.of(standings(rows)) == Difficulty(nobody=1, everybody=1, worlds=3)


def test_item_rest_correlations_are_those_of_numpy():
    points = np.random.default_rng(0).normal(size=(5, 4)) + np.arange(5)[:, None]
    points[:, 3] = 1.0
    found = item_rest(points)
    assert np.isnan(found[3])
    for world in range(3):
        rest = np.delete(points, world, axis=1).mean(axis=1)
        assert found[world] == pytest.approx(np.corrcoef(points[:, world], rest)[0, 1])


def test_worlds_that_agree_tell_contestants_apart():
    """Four worlds with the same order of three contestants, whose first two differ by 10 +- 10."""
    still = row("still", [0.0] * 4, "SCALE")
    rows = [row("a", [0.9, 0.7, 0.9, 0.7]), row("b", [0.7] * 4), row("c", [0.2] * 4), still]
    found = Discrimination.of(standings(rows))
    assert found.agreeing == 1.0
    assert found.halves == pytest.approx(0.99, abs=0.01)
    spread = np.std([20, 0, 20, 0], ddof=1)
    assert found.needed == pytest.approx((2.8 * spread / 10) ** 2)
    assert Discrimination.of(standings([*rows[:2], still])) is None
    assert Discrimination.of(standings([row(n, [0.5] * 4) for n in "abc"] + [still])) is None
    alike = [
        row("a", [0.9, 0.7]),
        row("b", [0.7, 0.9]),
        row("c", [0.2, 0.1]),
        row("still", [0.0] * 2),
    ]
    assert Discrimination.of(standings(alike)).needed == np.inf


def test_all_but_frozen_hold_69_worlds_of_the_published_rows():
    """Counted here from the files, as an audit did."""
    rows = [
        json.loads(path.read_text()) for path in Path("scenes/benchmarks/rows/loop-v1").iterdir()
    ]
    others = [
        dict(zip(r["worlds"]["world"], r["worlds"]["held"], strict=True))
        for r in rows
        if r["contestant"] not in ("still", "truth", "frozen")
    ]
    easy = sum(all(held[key] for held in others) for key in others[0])
    sentence = benchmark_section.difficulty_of(shipped_rows(load("loop-v1")))
    assert easy == 69
    assert sentence.endswith(f"and {easy} by every contestant but frozen.")


def test_main_effects_are_means_over_worlds():
    loop = load("loop-v1")
    worlds = loop.worlds_of(loop.conditions[0], Band("dev"))
    areas = [1.0 if w.levels["target"] == "car" else 0.0 for w in worlds]
    table = standings([row("still", [0.0] * 30), row("a", areas)])
    found = {e.level: e.points.value for e in effects(worlds, table) if e.factor == "target"}
    assert found == pytest.approx({"car": 100.0, "plate": 0.0, "box": 0.0, "mesh": 0.0})


def test_the_slowest_tracker_that_holds():
    one = row("a", [0.5], slow={"0": 1.0, "33": 0.7, "66": 0.5, "100": 0.4, "200": 0.6})
    still = row("still", [0.1])
    (standing,) = standings([still, one])
    assert standing.slowest == 66.0
    frozen = row("frozen", [0.2], slow=dict.fromkeys(one.slow, 0.5))
    assert {s.name: s.slowest for s in standings([still, one, frozen])} == {
        "a": 33.0,  # at 66 ms it holds no more than what looks at no picture
        "frozen": None,
    }


def test_holding_and_arriving_are_judged_from_a_record():
    errors = np.full(100, 0.5, np.float32)
    errors[:6] = 1.5
    record = Record(
        subject="plain",
        seed=0,
        settings={PICTURE: "ab" * 32, LAST: "cd" * 32},
        outcome="CONVERGED",
        success=True,
        measures={"end_position_mm": 9.0, "end_rotation_deg": 0.5, "out_of_view_pct": 0.0},
        series={ERROR: errors},
    )
    held = world_score("held", record)
    assert held == WorldScore(
        pytest.approx(0.94 * 0.75 + 0.06 * 0.25), held=False, picture="ab" * 6, last="cd" * 6
    )
    assert world_score("arrives", record).held
    for name, value in (("end_rotation_deg", 1.5), ("out_of_view_pct", 0.4)):
        missed = replace(record, measures=record.measures | {name: value})
        assert world_score("arrives", missed) == WorldScore(
            0.0, held=False, picture="ab" * 6, last="cd" * 6
        )


def test_a_row_of_another_version_is_refused(public):
    with pytest.raises(Mistake, match="results of two versions cannot be compared"):
        check_version(public, row("a", [1.0]))


@pytest.mark.parametrize(
    ("given", "changes", "division"),
    [
        ("mean_shift", (), Division.HOME),
        ("mine=kams:paper", (), Division.HOME),
        ("mine=collections:Counter", (), Division.CLOSED),
        ("mine=collections:Counter", ("tracker.particles=8",), Division.OPEN),
        ("mine=trax:python mine.py", (), Division.CLOSED),
        ("mine=program:python mine.py", (), Division.CLOSED),
        ("mine=onnx:vit.onnx", (), Division.CLOSED),
        ("mine=opencv", ("tracker.name=MIL",), Division.OPEN),
        ("mean_shift", ("controller.gain=2",), Division.OPEN),
    ],
)
def test_divisions(given, changes, division):
    (one,) = contestants(load("loop-v1"), [given], changes)
    assert one.division is division


@pytest.mark.parametrize(
    ("name", "given", "change", "sentence"),
    [
        (
            "loop-v1",
            "x=nosuch:X",
            "tracker.kind=truth",
            "the tracker 'truth' cannot take part, because it uses more than pictures",
        ),
        (
            "loop-v1",
            "kams",
            "run.duration=0.2",
            "--set run.duration: this setting belongs to the worlds of loop-v1: a contestant may "
            "change settings of [tracker], [features] and [controller] only",
        ),
        (
            "servo-v2",
            "hybrid",
            "tracker.noise=0",
            "--set tracker.noise: this setting belongs to the worlds of servo-v2: a contestant may "
            "change settings of [features] and [controller] only",
        ),
        ("servo-v2", "hybrid", "believed.depth_factor=1", "--set believed.depth_factor: this"),
        ("goal-v1", "sift", "at_goal.camera_noise=0", "--set at_goal.camera_noise: this"),
        ("goal-v1", "photometric", "features.kind=pose", "does not use the picture at the goal"),
    ],
)
def test_a_contestant_changes_neither_the_worlds_nor_what_it_is_told(name, given, change, sentence):
    with pytest.raises(Mistake) as found:
        contestants(load(name), [given], [change])
    assert sentence in str(found.value)


@pytest.mark.parametrize(
    ("given", "settings"),
    [
        ("pose, qp", {"features.kind": "pose", "controller.kind": "qp"}),
        ("weighted", {"features.kind": "weighted"}),
        ("broyden", {"features.kind": "points", "controller.kind": "broyden"}),
    ],
)
def test_a_law_is_entered_by_the_name_of_its_features_or_its_controller(given, settings):
    (one,) = contestants(load("servo-v1"), [given])
    assert (one.settings, one.division) == (settings, Division.HOME)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        (["truth"], "the tracker 'truth' cannot take part"),
        (["x="], "write NAME=KIND"),
        (["kams", "kams"], "two contestants are called 'kams'"),
        (["still=kams"], "two contestants are called 'still'"),
    ],
)
def test_a_contestant_that_cannot_be(given, sentence):
    with pytest.raises(Mistake) as found:
        contestants(load("loop-v1"), given)
    assert sentence in str(found.value)


def test_the_digest_of_a_contestant_covers_its_program(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    program = tmp_path / "mine.py"
    program.write_text("a = 1\n")
    settings = {"tracker.kind": "trax", "tracker.command": "python mine.py"}
    one = Contestant("mine", settings, Division.CLOSED)
    before = one.digest
    program.write_text("a = 2\n")
    assert one.digest != before
    assert len(before) == len(hashlib.sha256().hexdigest())


@pytest.mark.parametrize(
    "given",
    ["m=pk.t:T", "m=trax:python -m tracking.exported.trax_server pk.t:T", "m=trax:python pk/t.py"],
)
@pytest.mark.parametrize("changed", ["pk/t.py", "pk/beside.py"])
def test_the_digest_of_a_contestant_covers_its_package(tmp_path, monkeypatch, given, changed):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pk").mkdir()
    for name in ("t.py", "beside.py"):
        (tmp_path / "pk" / name).write_text("a = 1\n")
    (one,) = contestants(load("loop-v1"), [given])
    before = one.digest
    (tmp_path / "other.txt").write_text("of nobody\n")
    assert one.digest == before
    (tmp_path / changed).write_text("a = 2\n")
    assert one.digest != before


def test_the_digest_of_a_contestant_covers_a_list_of_numbers():
    servo_v2 = load("servo-v2")
    weights = ["controller.weights=[1,1,1,1,1,0]", "controller.weights=[1,1,1,1,1,0.5]"]
    first, second = (contestants(servo_v2, ["points"], [change])[0] for change in weights)
    assert first.settings["controller.weights"] == [1, 1, 1, 1, 1, 0]
    settings = json.dumps(first.settings, sort_keys=True).encode()
    assert first.digest == hashlib.sha256(settings).hexdigest() != second.digest
    assert not first.is_unknown


def test_the_digest_of_a_law_covers_the_modules_beside_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("my_law.py", "helper.py"):
        (tmp_path / name).write_text("a = 1\n")
    one = Contestant("m", {"controller.kind": "my_law:Law"}, Division.OPEN)
    before = one.digest
    (tmp_path / "helper.py").write_text("a = 2\n")
    assert one.digest != before


@pytest.mark.parametrize(
    ("files", "settings"),
    [
        ("vit.onnx", ['name="Vit"', 'model="vit.onnx"']),
        ("back.onnx,vit.onnx", ['name="Nano"', 'model=["back.onnx", "vit.onnx"]']),
    ],
)
def test_a_network_is_a_guest_and_its_digest_covers_its_files(
    tmp_path, monkeypatch, files, settings
):
    monkeypatch.chdir(tmp_path)
    (one,) = contestants(load("loop-v1"), [f"mine=onnx:{files}"])
    assert one.division is Division.CLOSED
    words = shlex.split(one.settings["tracker.command"])
    assert words[1:] == ["-m", "tracking.exported.program_server", "opencv", *settings]
    before = one.digest
    (tmp_path / "vit.onnx").write_bytes(tiny_onnx.vit((0.31, 0.21)))
    assert one.digest != before


@pytest.mark.parametrize(
    ("command", "reason"),
    [("nosuchprogram -x", "No such file or directory"), ('"a', "No closing quotation")],
)
def test_a_command_without_a_program_is_refused_before_anything_runs(
    monkeypatch, tmp_path, capfd, command, reason
):
    monkeypatch.chdir(tmp_path)
    words = ["loop-v1", "--quick", "--tracker", f"mine=trax:{command}", "--out", "o"]
    code, _, err = call(monkeypatch, capfd, "benchmark", *words)
    assert code == 2
    assert err == f"servobench: TraX server '{command}' cannot be started: {reason}\n"
    assert not (tmp_path / "o").exists()


def test_a_silent_program_is_refused_before_anything_runs(monkeypatch, tmp_path, capfd):
    monkeypatch.chdir(tmp_path)
    words = ["loop-v1", "--quick", "--tracker", "mine=trax:cat", "--set", "tracker.loading=0.2"]
    assert call(monkeypatch, capfd, "benchmark", *words, "--out", "o") == (
        2,
        "waiting at most 0.2 s for the first answer of 'cat'\n",
        "servobench: TraX server 'cat' failed: it did not send 'hello' within 0.2 s\n",
    )
    assert not (tmp_path / "o").exists()


def test_a_class_that_cannot_be_imported_is_refused_before_anything_runs(
    monkeypatch, tmp_path, capfd
):
    monkeypatch.chdir(tmp_path)
    words = ["loop-v1", "--quick", "--tracker", "mine=nosuch:Class", "--out", "o"]
    code, _, err = call(monkeypatch, capfd, "benchmark", *words)
    assert code == 2
    assert err.endswith("'nosuch:Class' cannot be imported: No module named 'nosuch'\n")
    assert err.count("\n") == 1
    assert not (tmp_path / "o").exists()


def test_an_unfinished_benchmark_has_a_page(monkeypatch, capfd, short):
    monkeypatch.setattr(benchmark_command, "complete_jobs", lambda *given: 0)
    command = ["benchmark", "servo-v1", "--law", "points", "--quick", "--out", "o"]
    assert call(monkeypatch, capfd, *command)[0] == 0
    assert call(monkeypatch, capfd, "report", "o")[0] == 0
    page = (short / "o" / "report.html").read_text()
    assert "<p>This benchmark is not finished: 0 of 4 runs. The command below goes on" in page


def test_a_slow_tracker_runs_more_often_and_the_scale_does_not():
    loop = load("loop-v1")
    worlds = loop.every_world(Band("dev"), 1)
    every = [*scale_of(loop), *contestants(loop, ["frozen"])]
    jobs = jobs_of(loop, every, worlds)
    assert len(jobs) == 3 * 12 + len(loop.slow.values)
    assert len({job.digest for job in jobs}) == len(jobs)


@pytest.fixture
def short(monkeypatch, tmp_path):
    """servo-v1 with its first task only."""
    return shortened(monkeypatch, tmp_path)


def shortened(monkeypatch, folder):
    monkeypatch.chdir(folder)
    whole = load("servo-v1")
    scenario = whole.scenario | {"run": {"duration": 1.0, "latency": 0}}
    kept = {"camera.rate": whole.frozen["camera.rate"]}
    cut = replace(whole, conditions=whole.conditions[:1], scenario=scenario, frozen=kept)
    monkeypatch.setattr(benchmark_command, "load", lambda _: cut)
    monkeypatch.setattr(benchmark_section, "load", lambda _: cut)
    return folder


def call(monkeypatch, capfd, *arguments):
    monkeypatch.setattr("sys.argv", ["servobench", *arguments])
    with pytest.raises(SystemExit) as left:
        main.main()
    out, err = capfd.readouterr()
    return left.value.code, out, err


@pytest.mark.usefixtures("no_progress")
def test_a_row_from_the_command_line_is_verified_bit_for_bit(monkeypatch, capfd, short):
    quick = [*BENCH, "--quick", "--law", "points"]
    code, out, err = call(monkeypatch, capfd, *quick, "--out", "o", "--submit", "row.json")
    assert (code, err) == (0, "")
    assert "points" in out
    assert (short / "row.parquet").is_file()
    verify = [*BENCH, "--verify", "row.json"]
    notes = (
        "  note: the row is of a quick run: 2 of 42 worlds\n"
        "  note: the row's medians (time, camera path, corners out of view) are unchecked\n"
    )
    agreed = f"points: 2 of 2 repeated worlds agree, bit for bit\n{notes}"
    assert call(monkeypatch, capfd, *verify)[:2] == (0, agreed)
    assert call(monkeypatch, capfd, "report", "o")[0] == 0
    assert "Points by condition" in (short / "o" / "report.html").read_text()
    table = json.loads((short / "row.json").read_text())
    table["worlds"]["area"] = [abs(area - 1e-9) for area in table["worlds"]["area"]]
    (short / "row.json").write_text(json.dumps(table))
    assert call(monkeypatch, capfd, *verify)[:2] == (
        0,
        "points: 0 of 2 repeated worlds agree, bit for bit\n"
        f"  2 more worlds agree except for rounding by another processor\n{notes}",
    )


@pytest.mark.usefixtures("no_progress")
def test_workers_that_are_lost_end_a_verification_with_a_sentence(monkeypatch, capfd, root):
    def lost(jobs, workers):
        raise ClusterLost("the local cluster is gone")

    monkeypatch.setattr(benchmark_command, "execute", lost)
    row = str(root / "scenes" / "benchmarks" / "rows" / "servo-v1" / "hybrid.json")
    assert call(monkeypatch, capfd, *BENCH, "--verify", row) == (
        1,
        "",
        "servobench: the local cluster is gone; the row is not verified: verify it again\n",
    )


@pytest.mark.usefixtures("no_progress")
def test_a_bench_does_not_go_on_with_another_guest(monkeypatch, capfd, short):
    law = short / "guest_law.py"
    law.write_text("import numpy as np\n\n\ndef hold(seen, task):\n    return np.zeros(6)\n")
    monkeypatch.syspath_prepend(short)
    words = ["servo-v1", "--quick", "--workers", "1", "--law", "m=guest_law:hold", "--out", "o"]
    assert call(monkeypatch, capfd, "benchmark", *words)[0] == 0
    law.write_text(law.read_text() + "# another one\n")
    assert call(monkeypatch, capfd, "benchmark", *words)[::2] == (
        2,
        "servobench: o: this folder holds another study (its settings differ: code.m); choose "
        "another folder with --out\n",
    )


@pytest.fixture(scope="module")
def published(tmp_path_factory):
    """The folder of a row of that benchmark and its errors, as --submit wrote them."""
    folder = tmp_path_factory.mktemp("published")
    command = [*BENCH, "--quick", "--law", "points", "--out", "o", "--submit", "row.json"]
    with pytest.MonkeyPatch.context() as monkeypatch:
        shortened(monkeypatch, folder)
        monkeypatch.setattr("sys.argv", ["servobench", *command])
        with pytest.raises(SystemExit) as left:
            main.main()
        assert left.value.code == 0
    return folder


@pytest.fixture
def sent(monkeypatch, capfd, short, published):
    """That row as somebody sends it; call it with a change, and it is audited."""
    for name in ("row.json", "row.parquet"):
        shutil.copy(published / name, short)
    table = json.loads((short / "row.json").read_text())

    def audited(change):
        changed = copy.deepcopy(table)
        change(changed)
        (short / "row.json").write_text(json.dumps(changed))
        return call(monkeypatch, capfd, *BENCH, "--verify", "row.json")[:2]

    return audited


def _one_area(row):
    row["worlds"]["area"][0] = 0.5


def _one_held(row):
    row["worlds"]["held"][0] = not row["worlds"]["held"][0]


def _without_second_world(row):
    for column in row["worlds"].values():
        del column[1]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (_one_area, "turn-00 differs"),
        (_one_held, "turn-00 differs"),
        (
            _without_second_world,
            "the row's worlds differ from those of its band: turn-01",
        ),
        (
            lambda row: row.update(curve=[0.5] * 41),
            "the Parquet file gives another curve than the row",
        ),
        (lambda row: row.update(slow={"100": 1.0}), "other shares held by slower trackers"),
        (
            lambda row: row.update(division="SCALE"),
            "the row's division is scale; it should be home",
        ),
        (lambda row: row.update(digest=DIGEST), "the contestant's settings or files differ"),
        (lambda row: row["settings"].update(x=1), "the contestant's settings or files differ"),
    ],
)
def test_what_somebody_writes_into_a_row_is_found_out(sent, change, sentence):
    code, out = sent(change)
    assert code == 1
    assert sentence in out


def test_a_row_of_a_later_version_is_whole_and_has_its_errors():
    benchmark = load("goal-v1")
    (sift,) = contestants(benchmark, ["sift"])
    (published,) = (row for row in shipped_rows(benchmark) if row.contestant == "sift")
    quick = {world.key for world in benchmark.every_world(Band("v1"), 2)}
    part = {key: score for key, score in published.worlds.items() if key in quick}
    faults, _ = audit.audit(benchmark, replace(published, worlds=part), sift, None)
    assert faults == [
        "the row is of a quick run: 18 of 360 worlds",
        "its Parquet file with the errors of each run is missing: `--submit` writes it beside the "
        "JSON file",
    ]


def test_sealed_worlds_of_other_code_are_no_row_of_this_code():
    """Who changes a comment gets other worlds: a row's digest must be the one known before VALUE."""
    benchmark = load("loop-v1")
    (mine,) = contestants(benchmark, ["m=collections:Counter"])
    sent = row("m", [], "CLOSED", band="sealed", value="a headline", digest=DIGEST)
    faults, _ = audit.audit(benchmark, sent, mine, None)
    assert "the contestant's settings or files differ from those given here" in faults
    first, second = (
        benchmark.every_world(Band("sealed", "a headline", digest), 1)
        for digest in (mine.digest, DIGEST)
    )
    assert not {w.seed for w in first} & {w.seed for w in second}


def test_a_digest_is_printed_before_anything_runs(monkeypatch, capfd, tmp_path):
    monkeypatch.chdir(tmp_path)
    code, out, _ = call(monkeypatch, capfd, *BENCH, "--law", "points", "--quick", "--dry-run")
    (points,) = contestants(load("servo-v1"), ["points"])
    assert (code, out.splitlines()[0]) == (0, f"points: digest {points.digest}")


def test_published_rows_that_fix_the_scale_are_not_run_again(monkeypatch, capfd, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("servo.cli.jobs.tried", lambda missing: (1.0, []))
    public = load("servo-v1")
    words = [*BENCH, "--law", "points", "--quick", "--dry-run"]

    def count(band):
        worlds = len(public.every_world(Band(band), 2))
        code, out, _ = call(monkeypatch, capfd, *words, "--band", band)
        assert code == 0
        return int(out.split(" runs,")[0].split()[-1].replace(",", "")) / worlds

    assert count("dev") == 1 + len(scale_of(public))
    assert count("v1") == 1
    rows = [r for r in shipped_rows(public) if r.contestant != scale_of(public)[0].name]
    monkeypatch.setattr(benchmark_command, "shipped_rows", lambda _: rows)
    assert count("v1") == 1 + len(scale_of(public))


def test_pictures_of_published_worlds_are_known_and_those_of_sealed_worlds_are_not():
    """A contestant that sees nothing, but knows published digests, could replay a row's commands."""
    benchmark = load("goal-v1")
    (sift,) = contestants(benchmark, ["sift"])
    published = {s.picture for r in shipped_rows(benchmark) for s in r.worlds.values()} - {""}

    def is_known(band):
        near = benchmark.every_world(band)[-benchmark.worlds]
        with Episode(benchmark.scenario_of(near, sift.settings)) as episode:
            image = next(iter(episode)).frame.image
        return hashlib.sha256(image.tobytes()).hexdigest()[:DIGITS] in published

    assert is_known(Band("v1"))
    assert not is_known(Band("sealed", "a headline", sift.digest))


def test_an_audit_repeats_worlds_that_nobody_knows_before():
    worlds = load("loop-v1").every_world(Band("v1"))
    first, second = (audit.sample(worlds, np.random.default_rng(seed)) for seed in (1, 2))
    assert len({w.key for w in first}) == len(second) == 36
    assert first != second
    assert len(audit.sample(worlds[:12], np.random.default_rng(1))) == 10


def test_a_row_of_a_tracker_is_compared_with_the_errors_beside_it():
    loop = load("loop-v1")
    (kams,) = contestants(loop, ["kams"])
    keys = [world.key for world in loop.every_world(Band("dev"), 2)]
    rng = np.random.default_rng(0)
    errors = {(key, 0.0): rng.uniform(0, 3, 20) for key in keys}
    errors |= {("reversal-00", 100.0): np.zeros(20), ("reversal-01", 100.0): np.full(20, 9.0)}
    worlds = {key: score_errors(errors[key, 0.0]) for key in keys}
    table = row("kams", [], "HOME", digest=kams.digest, settings=kams.settings)
    honest = replace(
        table,
        worlds=worlds,
        slow=slow_of(loop, errors),
        curve=curve_of([errors[key, 0.0] for key in keys]),
    )
    assert honest.slow["100"] == 0.5
    assert audit.audit(loop, honest, kams, errors)[0] == []
    better = worlds | {"plain-00": WorldScore(0.9, held=True)}
    for changed, fault in (
        (
            replace(honest, worlds=better),
            "the Parquet file gives other scores than the row: plain-00",
        ),
        (
            replace(honest, slow=honest.slow | {"100": 1.0}),
            "the Parquet file gives other shares held by slower trackers than the row",
        ),
    ):
        assert audit.audit(loop, changed, kams, errors)[0] == [fault]
    fewer = {key: e for key, e in errors.items() if key[0] != "plain-00"}
    assert audit.audit(loop, honest, kams, fewer)[0] == [
        "the Parquet file has other worlds than the row: plain-00"
    ]


def test_errors_in_500ths_agree_with_the_row_that_was_made_of_exact_ones(tmp_path):
    loop = load("loop-v1")
    (kams,) = contestants(loop, ["kams"])
    keys = [world.key for world in loop.every_world(Band("dev"), 2)]
    rng = np.random.default_rng(1)
    exact = {key: np.float32(rng.choice([0.0, 0.05, 1.0, 2.0, np.inf], 40) + 4e-4) for key in keys}
    records = [
        SimpleNamespace(settings={"world": key, "slow": 0.0}, series={"error_sizes": e})
        for key, e in exact.items()
    ]
    (tmp_path / "row.parquet").write_bytes(audit.errors_parquet(records))
    errors = audit.read_errors(tmp_path / "row.parquet")
    assert set(errors[keys[0], 0.0]) <= {0.0, 0.05, 1.0, 2.0, 2.002}
    made = replace(
        row("kams", [], "HOME", digest=kams.digest, settings=kams.settings),
        worlds={key: score_errors(e) for key, e in exact.items()},
        curve=curve_of(list(exact.values())),
    )
    assert audit.audit(loop, made, kams, errors)[0] == []
    for more in (1.1e-3, -1.1e-3):  # the scores may be off by half a 500th over 2 sizes
        first = made.worlds[keys[0]]
        other = replace(first, area=first.area + more)
        changed = replace(made, worlds=made.worlds | {keys[0]: other})
        assert audit.audit(loop, changed, kams, errors)[0] == [
            f"the Parquet file gives other scores than the row: {keys[0]}"
        ]
    over = [min(1.0, share + 0.05) for share in made.curve[2:]]
    changed = replace(made, curve=[*made.curve[:2], *over])
    assert audit.audit(loop, changed, kams, errors)[0] == [
        "the Parquet file gives another curve than the row"
    ]


def test_a_file_that_has_no_errors_of_a_row_is_a_sentence(tmp_path):
    (tmp_path / "row.parquet").write_bytes(b"PAR1 and no more")
    with pytest.raises(Mistake, match=r"row.parquet: this is not the file of errors that"):
        audit.read_errors(tmp_path / "row.parquet")


def test_sealed_worlds_are_those_of_the_value(monkeypatch, capfd, short):
    command = ["benchmark", "servo-v1", "--law", "points", "--quick", "--workers", "1"]
    for value in "ab":
        assert call(monkeypatch, capfd, *command, "--sealed", value, "--out", value)[0] == 0
    rows = [Row.read(short / value / "rows" / "points.json") for value in "ab"]
    assert [row.value for row in rows] == ["a", "b"]
    assert [row.band for row in rows] == ["sealed", "sealed"]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ("loop-v1 --tracker nobody", "there is no contestant 'nobody'; shipped are 'annealed', 'c"),
        ("loop-v1 --trackers kams", "Error: No such option '--trackers'."),
        ("loop-v1 --submit x.json", "--submit needs one contestant"),
        ("loop-v1 --sealed x", "--sealed needs one contestant"),
        (
            "loop-v1 --sealed x --tracker m=nomod:T",
            "draws worlds from the code of 'm', but this code was not",
        ),
        (
            "clutter --band v1",
            "'clutter' is not one of 'loop-v2', 'loop-v2-size', 'loop-v2-all', 'servo-v2', 'goal-v1', ",
        ),
        (
            "goal-v1 --law pose",
            "'pose' cannot take part, because it does not use the picture at the goal",
        ),
        ("loop-v1 --verify gone.json", "gone.json: cannot read this file"),
        (
            "loop-v1 --verify gone.json --dry-run",
            "--dry-run has no effect with --verify: leave one of them out",
        ),
    ],
)
def test_wrong_options_end_in_a_sentence(monkeypatch, capfd, tmp_path, arguments, sentence):
    monkeypatch.chdir(tmp_path)
    code, _, err = call(monkeypatch, capfd, "benchmark", *arguments.split())
    assert code == 2
    assert sentence in err


def test_missing_pictures_are_named_before_anything_runs(monkeypatch, capfd, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(picture_name, "find_spec", lambda _: None)
    code, out, err = call(monkeypatch, capfd, "benchmark", "goal-v1", "--law", "sift", "--quick")
    assert (code, out) == (2, "")
    assert err.startswith("servobench: ground.file = 'skimage:")
    assert err.endswith(": scikit-image is not installed: install servobench[pictures]\n")
    assert not list(tmp_path.iterdir())


class OfRun(dict):
    """Columns of a run: a target of 100 x 100 px that is 1 m long."""

    first = SimpleNamespace(
        truth=SimpleNamespace(
            corners=100.0 * np.array([[0, 0], [1, 0], [1, 1], [0, 1]]), size=100.0
        )
    )

    def __len__(self):
        return len(self["servo"])


@pytest.mark.parametrize(
    ("what", "expected"),
    [
        ("centre", [0.5, 0.5, 0.5, 0.5, np.inf]),
        ("size", [0.5, 2.0, 1.0, 0.5, np.inf]),
        ("all", [0.5, 2.0, 3.0, 2.0, np.inf]),
    ],
)
def test_the_error_is_the_largest_of_those_that_the_benchmark_counts(what, expected):
    """50 px of 100; depths exp(.4) and exp(-.2) of the goal's; 45 deg, and 330 for -30."""
    run = OfRun(
        servo=np.full(4, 50.0),
        goal_size=np.full(4, 100.0),
        size=100.0 * np.exp([0.0, -0.4, 0.2, 0.0]),
        turned=np.radians([0.0, 0.0, 45.0, 330.0]),
    )
    assert errors_of(run, 5, what) == pytest.approx(expected)


@pytest.mark.wide
def test_a_tracker_also_gets_pictures_of_a_camera_that_it_does_not_steer():
    loop = load("loop-v2")
    worlds = loop.worlds_of(loop.conditions[0], Band("dev"))
    frozen = contestants(loop, ["frozen"])
    jobs = jobs_of(loop, [*scale_of(loop), *frozen], worlds)
    with_driver = {j.settings["world"] for j in jobs if j.subject.driver is not None}
    assert with_driver == {f"fast-{n:02}" for n in range(6)}
    alone = next(j for j in jobs if j.settings["contestant"] == "frozen").run(Path())
    later = next(j for j in jobs_of(loop, frozen, worlds[6:7])).run(Path())
    # The truth keeps the target in the middle, where `frozen` believes it; in its own loop it is gone.
    assert alone.measures[WITHIN] > 90
    assert 0.1 < alone.measures[OVERLAP] < 0.9
    assert alone.series[ERROR][-1] > 5
    assert not {WITHIN, OVERLAP} & later.measures.keys()
    published = row_of(loop, Band("dev"), frozen[0], [alone, later], "")
    assert published.measures[OVERLAP] == round(alone.measures[OVERLAP], 4)


def test_contestants_with_settings_of_their_own_have_a_table_of_their_own():
    scale, home, closed = row("still", [0.1], "SCALE"), row("a", [0.5], "HOME"), row("b", [0.5])
    free = row("c", [0.9], "OPEN")
    tables = benchmark_section.by_division([scale, home, free, closed])
    assert tables == {"": [scale, home, closed], ", open division": [free, scale, home]}
    assert benchmark_section.by_division([scale, home]) == {"": [scale, home]}
    assert benchmark_section.by_division([free, scale]) == {", open division": [free, scale]}


def test_a_benchmark_may_be_a_change_of_another_one():
    loop, size = load("loop-v2"), load("loop-v2-size")
    assert [c.name for c in size.conditions] == [c.name for c in loop.conditions]
    world = size.every_world(Band("dev"), 1)[0]
    assert "start.scale" in world.settings
    assert "start.scale" not in loop.every_world(Band("dev"), 1)[0].settings
    assert size.scenario_of(world, {}).controller.dof == ("vx", "vy", "vz")
    assert "benchmarks/loop-v2.toml" in size.files


def test_rows_and_their_parts_are_made_of_all_worlds():
    loop = load("loop-v1")
    record = Record(
        subject="reversal",
        seed=0,
        settings={PICTURE: "", LAST: "", "contestant": "a", "world": "reversal-00", "slow": 0.0},
        outcome="CONVERGED",
        success=True,
        measures={"track_ms": 2.0},
        series={ERROR: np.array([0.5, 1.0, 2.5], np.float32)},
    )
    late = replace(record, settings=record.settings | {"slow": 33.0})
    one = Contestant("a", {}, Division.OPEN)
    found = row_of(loop, Band(), one, [record, late], "")
    assert found.slow == {"0": 0.0, "33": 0.0}
    assert found.curve[10] == pytest.approx(1 / 3, abs=1e-4)
    assert found.worlds["reversal-00"].area == pytest.approx((0.75 + 0.5) / 3)


@pytest.mark.wide
def test_the_shipped_rows_have_a_page(monkeypatch, capfd, tmp_path):
    monkeypatch.chdir(tmp_path)
    for name, count in (("loop-v1", 21), ("servo-v1", 13), ("servo-v2", 13)):
        assert call(monkeypatch, capfd, "report", name)[0] == 0
        page = (tmp_path / f"{name}.html").read_text()
        assert page.count("<td>home</td>") + page.count("<td>closed</td>") == count
        assert "Points by property of the world" in page
    assert "others, see" not in (tmp_path / "loop-v1.html").read_text()


def test_a_benchmark_without_rows_has_no_page(monkeypatch, capfd):
    monkeypatch.setattr(benchmark_section, "shipped_rows", lambda _: [])
    assert call(monkeypatch, capfd, "report", "goal-v1")[::2] == (
        2,
        "servobench: goal-v1 has no published results yet: run `servobench benchmark goal-v1`, and "
        "give the folder that it writes\n",
    )


def test_a_row_without_a_condition_has_an_empty_cell_there(public):
    first, *others = shipped_rows(public)
    missing = public.conditions[0].name
    part = {key: won for key, won in first.worlds.items() if condition_of(key) != missing}
    rows = [replace(first, worlds=part), *others]
    (block, _) = benchmark_section.blocks_of(public, public.every_world(Band("v1")), {"": rows})
    (points,) = (each for each in block.figures if each.title == "Points by condition")
    cells = len(public.conditions) * len(standings(rows))
    assert len(points.drawing.axes[0].texts) == cells - 1


def test_a_row_without_a_world_of_the_others_is_a_sentence():
    rows = [
        row("still", [0.0] * 3),
        replace(row("a", [1.0]), worlds={"x-00": WorldScore(1.0, True)}),
    ]
    sentence = (
        "^there is no world in which each of 'a', 'still' has a result: run the benchmark again for"
    )
    with pytest.raises(Mistake, match=sentence):
        standings(rows)


def test_home_rows_are_grey_and_guests_are_named(public):
    rows = shipped_rows(public)
    table = benchmark_section.standings_table(public, rows)
    guests = {
        "loop-v1": {"mil", "dlib", "kcf", "csrt"},
        "loop-v2": {"nano", "dlib", "kcf", "csrt"},
        "loop-v2-size": {"nano"},
        "goal-v1": {"imitated"},
    }.get(public.name, set())
    full = {of[0] for i, of in enumerate(table.rows) if i not in table.faint}
    assert full == (guests or {of[0] for of in table.rows})
    (section,) = [benchmark_section.published_section(public.name)]
    keys = {key.label for key in section.blocks[0].figures[0].keys}
    numbers = {"servo-v1": 12, "servo-v2": 12, "goal-v1": 7, "loop-v2-all": 11}
    assert guests <= keys
    assert len(keys) == numbers.get(public.name, 14)


def test_other_pictures_have_a_table_of_their_own():
    loop = load("loop-v1")
    rows = shipped_rows(loop)
    kams = next(row for row in rows if row.contestant == "kams")
    worlds = {key: replace(w, picture="ab" * 6) for key, w in kams.worlds.items()}
    copied = replace(kams, contestant="copy", worlds=worlds)
    first, other = benchmark_section.by_pictures(loop, [copied, *rows]).items()
    assert first == (loop.rendering, rows)
    assert [row.contestant for row in other[1]] == ["copy", "still", "truth"]
    groups = dict((first, other))
    blocks = benchmark_section.blocks_of(loop, loop.every_world(Band("v1")), groups)
    assert [b.title for b in blocks][2:] == [
        f"Contestants, pictures {copied.rendering}",
        f"Points by property of the world, pictures {copied.rendering}",
    ]


def test_a_guest_of_the_public_worlds_stands_beside_the_shipped_rows():
    loop = load("loop-v1")
    shipped = shipped_rows(loop)
    kams = next(row for row in shipped if row.contestant == "kams")
    guest = replace(kams, contestant="guest")
    every = benchmark_section.beside_published(loop, [guest])
    assert len(every) == len(shipped) + 1
    few = replace(guest, worlds=dict(list(guest.worlds.items())[:2]))
    assert benchmark_section.beside_published(loop, [few]) == [few]
    assert benchmark_section.beside_published(loop, [kams]) == [
        kams,
        *(row for row in shipped if row is not kams and row.contestant != "kams"),
    ]


@pytest.mark.processes
def test_a_class_runs_in_a_process_that_gets_pictures_only(monkeypatch, capfd, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(SPY)
    whole = load("loop-v1")
    scenario = whole.scenario | {"run": {"duration": 0.1, "latency": 1}}
    kept = {"camera.rate": whole.frozen["camera.rate"]}
    cut = replace(whole, conditions=whole.conditions[:1], scenario=scenario, frozen=kept, slow=None)
    monkeypatch.setattr(benchmark_command, "load", lambda _: cut)
    monkeypatch.setattr(benchmark_command, "QUICK", 1)
    command = ["benchmark", "loop-v1", "--tracker", "m=mine:Spy", "--quick", "--workers", "1"]
    code, out, _ = call(monkeypatch, capfd, *command, "--out", "o")
    assert code == 0
    assert "closed" in out
    first = Row.read(tmp_path / "o" / "rows" / "m.json")
    assert (tmp_path / "seen").read_text() == "tracking.exported.program_server"
    for world in first.worlds.values():
        assert world.last not in ("", world.picture)
    assert first.resolved["tracker.timeout"] == 30.0


SPY = """
import pathlib
import sys


class Spy:
    def init(self, image, rect):
        self.rect = rect
        name = sys.modules["__main__"].__spec__.name
        pathlib.Path("seen").write_text(name)

    def update(self, image):
        return True, self.rect
"""


def test_a_level_in_a_few_worlds_has_no_effect_told():
    loop = load("loop-v1")
    worlds = loop.every_world(Band("dev"), 2)
    areas = np.random.default_rng(0).uniform(size=len(worlds))
    keyed = {w.key: WorldScore(float(a), held=False) for w, a in zip(worlds, areas, strict=True)}
    table = standings([replace(row(n, []), worlds=keyed) for n in ("still", "a")])
    found = effects(worlds, table)
    assert all(e.points.units >= 5 for e in found)
    assert {"light.azimuth_deg", "light.elevation_deg"} <= {e.factor for e in found}
    lit = [e for e in found if e.factor == "light.elevation_deg"]
    assert [e.points.units for e in lit] == [8, 8, 8]


def test_the_manuals_show_the_shipped_rows():
    for page in PAGES:
        text = page.read_text()
        most = FEW if page == FIRST_PAGE else None
        assert with_tables(text, most) == text, (
            f"{page}: python tests/tools/publish.py writes its tables"
        )


def test_machines_find_the_rows_and_their_fields():
    folder = Path("scenes/benchmarks")
    dataset = json.loads((folder / "croissant.json").read_text())
    fields = {f.name for f in dataclasses.fields(Row)}
    for files, records, name in zip(
        dataset["distribution"], dataset["recordSet"], NAMES, strict=True
    ):
        assert files["includes"] == f"rows/{name}/*.json"
        paths = [f["source"]["extract"]["jsonPath"] for f in records["field"]]
        assert {path.removeprefix("$.") for path in paths} <= fields


@pytest.mark.parametrize(
    ("before", "after", "sentence"),
    [
        (
            '"dev"',
            '"x"',
            "the content of this file is wrong: band: input should be 'dev', 'v1' or 'sealed'",
        ),
        (
            DIGEST,
            "x",
            "the content of this file is wrong: digest: string should match pattern '^[0-9a-f]{64}$'",
        ),
        (
            '"area":[1.0]',
            '"area":[1e308]',
            "the content of this file is wrong: worlds.plain-00.area: input should be less than or equal to 1",
        ),
        (
            '"slow":{}',
            '"slow":{"a":1}',
            "the content of this file is wrong: slow.a.[key]: string should match pattern",
        ),
        (
            '"curve":[',
            '"curve":[0.5,',
            "the content of this file is wrong: curve: list should have at most 41 items after validation, not 42",
        ),
        *[
            (
                '"area":[1.0]',
                wrong,
                "the content of this file is wrong: worlds: value error, columns of equal length are needed: world, area, held and, if known, picture, last; repeat",
            )
            for wrong in ('"area":[1.0,1.0]', '"area":1.0', '"area":null', '"world":["x","y"]')
        ],
        (
            '"world":["plain-00"],',
            "",
            "the content of this file is wrong: worlds: value error, columns of equal length are needed: world, area, held and, if known, picture, last; repeat",
        ),
    ],
)
def test_an_alien_row_is_refused(tmp_path, before, after, sentence):
    path = row("a", [1.0]).write(tmp_path, "row.json")
    assert before in path.read_text()
    path.write_text(path.read_text().replace(before, after))
    with pytest.raises(Mistake) as refused:
        Row.read(path)
    assert str(refused.value).startswith(f"{path}: {sentence}")


def test_a_third_of_the_lamps_is_named_by_its_ends():
    worlds = [
        World("plain", k, k, {"light.azimuth_deg": 10.0 * k}, {}) for k in reversed(range(15))
    ]
    table = standings([row("still", [0.0] * 15), row("a", [0.1 * (k // 5) for k in range(15)])])
    found = {e.level: e.points for e in effects(worlds, table)}
    assert {level: points.value for level, points in found.items()} == pytest.approx(
        {"0 to 40": 0.0, "50 to 90": 10.0, "100 to 140": 20.0}
    )
    assert [points.units for points in found.values()] == [5, 5, 5]
    assert effects(worlds[:14], table)[-1].level == "60 to 100"  # four worlds are too few


class Breaking:
    """A law that raises an error in the fourth picture."""

    def start(self, task):
        self.left = 3

    def command(self, seen, posture, dt):
        self.left -= 1
        if self.left < 0:
            raise RuntimeError("no more")
        return Command(np.zeros(6))


def test_a_run_ends_where_the_simulation_is_unstable_but_not_where_a_law_fails(
    monkeypatch, tmp_path
):
    loop = load("servo-v1")
    worlds = loop.every_world(Band("dev"), 1)[:1]
    failing = Contestant("breaks", settings_of("controller", f"{__name__}:Breaking"), Division.OPEN)
    [job] = jobs_of(loop, [failing], worlds)
    with pytest.raises(PartFailed, match="no more"):
        job.subject.perform(job, tmp_path)
    [still, *_] = jobs_of(loop, scale_of(loop), worlds)
    step = sim_world.World.step
    left = iter(range(3))

    def unstable(world, twists):
        if next(left, None) is None:
            raise sim_world.Unstable("it shakes")
        return step(world, twists)

    monkeypatch.setattr(sim_world.World, "step", unstable)
    record = still.subject.perform(still, tmp_path)
    errors = record.series[ERROR]
    assert np.isfinite(errors).tolist() == [True] * 3 + [False] * (len(errors) - 3)


class Leaving:
    """A tracker whose second object, which gets the pictures of the open loop, exits."""

    objects = 0

    def init(self, image, rect):
        Leaving.objects += 1
        self.rect = rect

    def update(self, image):
        if Leaving.objects > 1:
            raise SystemExit("no more")
        return True, self.rect


def test_a_tracker_that_exits_in_the_open_loop_is_a_failure_and_the_next_run_is_done(monkeypatch):
    monkeypatch.setattr(Leaving, "objects", 0)
    loop = load("loop-v2")
    worlds = loop.every_world(Band("dev"), 1)[:1]
    short = replace(loop, scenario=loop.scenario | {"run": {"duration": 0.1, "latency": 0}})
    leaving = Contestant("leaves", settings_of("tracker", f"{__name__}:Leaving"), Division.OPEN)
    jobs = jobs_of(short, [leaving, *scale_of(short)[:1]], worlds)
    with Workers() as workers:
        [(_, failure), (_, record)] = execute(jobs, workers)
    assert failure.mistake == f"tracker '{__name__}:Leaving': SystemExit: no more"
    assert len(record.series[ERROR]) == 3


def test_a_run_that_does_not_arrive_has_a_sheet_though_its_target_is_near(tmp_path):
    goal = load("goal-v1")
    [still, *_] = jobs_of(goal, scale_of(goal), goal.every_world(Band("dev"), 1)[-1:])
    short = copied(still.subject.table)
    put(short, "run.duration", 0.2, "")
    record = replace(still.subject, table=short).perform(still, tmp_path)
    assert record.series[ERROR].max() < 0.2  # target sizes: by the rule of "held" it would hold
    assert record.sheet is not None
