from pathlib import Path

import pytest

from servo.mistake import Mistake
from servo.scenario import catalogue
from servo.scenario import load as s
from servo.study.parse import load as load_study
from tracking import trackers
from tracking.trackers import pf_ssd


def mistake(call, *args):
    with pytest.raises(Mistake) as found:
        call(*args)
    return str(found.value)


def written(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    return str(path)


TRACKERS = ", ".join(trackers.KINDS.names())

BAD = {
    "unknown table": ("[camra]\n", "mine.toml: there is no key 'camra'; did you mean 'camera'?"),
    "unknown key": (
        "[camera]\nwidht = 3\n",
        "mine.toml: camera: there is no key 'widht'; did you mean 'width'?",
    ),
    "unknown key without a near one": (
        "[goal]\nzzz = 3\n",
        "mine.toml: goal: there is no key 'zzz'; there is x, y, angle_deg, depth, depth_to, "
        "tilt_deg, tilt_towards_deg, change_start, change_duration",
    ),
    "wrong type": (
        "[camera]\nwidth = 320.5\n",
        "mine.toml: camera.width = 320.5: input should be a valid integer",
    ),
    "a string for a number": (
        '[run]\nduration = "long"\n',
        "mine.toml: run.duration = 'long': input should be a valid number",
    ),
    "out of range": (
        "[goal]\ndepth = 0.0\n",
        "mine.toml: goal.depth = 0.0: input should be greater than or equal to 0.01",
    ),
    "absurd": (
        '[tracker]\nkind = "pf_ssd"\nparticles = 1000000000\n',
        "mine.toml: tracker.particles = 1000000000: input should be less than or equal to 100000",
    ),
    "not a number": (
        "[goal]\nx = nan\n",
        "mine.toml: goal.x = nan: input should be a finite number",
    ),
    "unknown kind": (
        '[tracker]\nkind = "csrt"\n',
        f"mine.toml: tracker.kind: there is no kind 'csrt'; there is {TRACKERS}",
    ),
    "a table that is none": (
        "camera = 3\n",
        "mine.toml: camera should be a table of settings, not 3",
    ),
    "a list that is none": (
        "disturbances = 3\n",
        "mine.toml: disturbances should be a list of tables, not 3",
    ),
    "a disturbance without kind": (
        "[[disturbances]]\nstart = 1.0\n",
        "mine.toml: disturbances[0] needs a kind: one of board, brightness, dropped_frames, "
        "second_target, spot",
    ),
    "a wrong choice": (
        '[controller]\nkind = "ibvs"\ndof = ["vx", "up"]\n',
        "mine.toml: controller.dof.1 = 'up': input should be 'vx', 'vy', 'vz', 'wx', 'wy' or 'wz'",
    ),
    "broken TOML": (
        "[run]\nduration = = 3\n",
        "mine.toml: this is not TOML: Invalid value (at line 2, column 12)",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_every_mistake_is_one_sentence_with_its_place(tmp_path, case):
    text, message = BAD[case]
    assert mistake(s.load, written(tmp_path, text)) == message


def test_an_unknown_scenario_lists_what_there_is():
    assert mistake(s.load, "revrsal") == (
        "there is no scenario 'revrsal'; did you mean 'reversal'? (or give a .toml file)"
    )
    there = ", ".join(catalogue.shipped())
    assert mistake(s.load, "zzz") == (
        f"there is no scenario 'zzz'; there is {there} (or give a .toml file)"
    )


def test_a_missing_file_is_named():
    assert mistake(s.load, "nowhere/x.toml") == (
        "nowhere/x.toml: cannot read this scenario: No such file or directory"
    )


def test_a_file_that_is_not_text_is_named(tmp_path):
    path = tmp_path / "binary.toml"
    path.write_bytes(b"\xff\xfe\x00")
    assert mistake(s.load, str(path)).endswith(
        "cannot read this scenario: it is not UTF-8 text: save it as UTF-8, or give another file"
    )


def test_defaults_are_those_of_the_kinds():
    plain = s.load("still")
    assert plain.tracker == pf_ssd.Config()
    assert plain.settings()["tracker"]["kind"] == "pf_ssd"
    assert plain.settings()["tracker"]["noise"] == 0.1
    assert plain.settings()["run"] == {
        "duration": 6.0,
        "seed": 0,
        "latency": 1,
        "latency_ms": None,
        "tracker_ms": 0.0,
        "jitter_ms": 0.0,
        "ego": False,
    }


@pytest.mark.parametrize("name", catalogue.shipped())
def test_every_shipped_scenario_opens_with_its_command_and_has_bounds(name, root):
    lines = (root / "scenes" / f"{name}.toml").read_text().splitlines()
    assert lines[0] == f"# servobench run {name}"
    assert lines[1].startswith("# ")
    assert lines[1].endswith(".")
    shipped = s.load(name)
    fails = name in ("lost_for_good", "border_pose", "turn_150_desired", "turn_180_points")
    assert shipped.expect["outcome"] == ("TARGET_LOST" if fails else "CONVERGED")
    assert len(shipped.expect) > (5 if not fails else 2 if name == "lost_for_good" else 1)


def test_bounds_on_what_is_not_measured_are_refused():
    assert mistake(s.load, "still", ["expect.servo_rms=1.0"]) == (
        "--set expect.servo_rms=1.0: expect: there is no key 'servo_rms'; did you mean 'servo_rms_px'?"
    )
    assert mistake(s.load, "still", ["expect.settle_s=soon"]) == (
        "--set expect.settle_s=soon: expect.settle_s = 'soon': input should be a valid number"
    )
    for bound, shown in {
        "[1]": "[1]",
        "{}": "{}",
        "true": "True",
        "nan": "nan",
        "inf": "inf",
        "[[]]": "[[]]",
        "2020-01-01": "datetime.date(2020, 1, 1)",
        "10:00:00": "datetime.time(10, 0)",
    }.items():
        kind = "finite" if shown in ("nan", "inf") else "valid"
        assert mistake(s.load, "still", [f"expect.settle_s={bound}"]) == (
            f"--set expect.settle_s={bound}: expect.settle_s = {shown}: input should be a {kind} number"
        )
    for outcome in ("[1]", "{}", "3", "2020-01-01"):
        assert mistake(s.load, "still", [f"expect.outcome={outcome}"]).endswith(
            ": input should be 'CONVERGED', 'TIMED_OUT', 'TARGET_LOST', 'LIMIT_HIT' or 'DIVERGED'"
        )
    assert mistake(s.load, "still", ["expect.outcome=FINE"]).startswith(
        "--set expect.outcome=FINE: expect.outcome = 'FINE': input should be 'CONVERGED'"
    )


JUDGED = """# mine
# A car that stands.
[start]
x = 30.0

[tracker]
kind = "kams"

[expect]
outcome = "TIMED_OUT"
servo_rms_px = 2.0

[expect.tracker.frozen]
servo_rms_px = 9.0
"""


def judged(*changes, **parts):
    return s.load("mine.toml", changes, **parts)


@pytest.fixture
def mine(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "mine.toml"
    path.write_text(JUDGED)
    return path


def test_bounds_are_those_of_the_tracker_in_the_file_and_others_have_their_own(mine):
    assert judged().expect == {"outcome": "TIMED_OUT", "servo_rms_px": 2.0}
    assert judged("tracker.particles=9").expect == judged().expect
    assert judged("tracker.kind=frozen").expect == {"servo_rms_px": 9.0}
    assert judged("tracker.kind=frozen").unjudged == judged().unjudged == ""
    other = judged("tracker.kind=pf_ssd")
    assert (other.expect, other.table["expect"]) == ({}, {})
    assert other.unjudged == (
        "No verdict: the bounds are made for kams and frozen, and there are none for pf_ssd."
    )
    mine.write_text(JUDGED.replace('[expect]\noutcome = "TIMED_OUT"\nservo_rms_px = 2.0\n', ""))
    assert judged().unjudged == (
        "No verdict: the bounds are made for frozen, and there are none for kams."
    )
    mine.write_text(JUDGED)
    assert judged(tracker=other.tracker).expect == {}
    assert judged(tracker=other.tracker).unjudged == other.unjudged
    set_here = judged("expect.servo_rms_px=1.5", "tracker.kind=pf_ssd")
    assert set_here.expect == {"servo_rms_px": 1.5}
    assert judged("expect.tracker.pf_ssd.settle_s=1", "tracker.kind=pf_ssd").expect == {
        "settle_s": 1
    }
    assert other.bounds.expect["outcome"] == "TIMED_OUT"
    any_other = "expect.tracker.*.settle_s=2"
    assert judged(any_other, "tracker.kind=pf_ssd").expect == {"settle_s": 2}
    assert judged(any_other, "tracker.kind=frozen").expect == {"servo_rms_px": 9.0}
    assert judged(any_other).expect == judged().expect


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            "expect.tracker=3",
            "--set expect.tracker=3: expect.tracker = 3: this should be a table",
        ),
        (
            "expect.tracker.kams.settle_s=3",
            "--set expect.tracker.kams.settle_s=3: "
            "expect.tracker.kams: kams is the scenario's own tracker; write its bounds directly "
            "into [expect]",
        ),
        (
            "expect.tracker.kam.settle_s=3",
            "--set expect.tracker.kam.settle_s=3: "
            "expect.tracker: there is no tracker 'kam'; did you mean 'kams'?",
        ),
        (
            "expect.tracker.*.settle=3",
            "--set expect.tracker.*.settle=3: expect.tracker.*: there is no key 'settle'; did you mean 'settle_s'?",
        ),
        (
            "expect.tracker.frozen.settle=3",
            "--set expect.tracker.frozen.settle=3: "
            "expect.tracker.frozen: there is no key 'settle'; did you mean 'settle_s'?",
        ),
    ],
)
def test_a_mistake_in_the_bounds_of_other_trackers_is_one_sentence(mine, change, sentence):
    with pytest.raises(Mistake) as told:
        judged(change)
    assert str(told.value) == sentence


DRAWN = (
    JUDGED
    + """
[expect.tracker.frozen.drawn]
servo_rms_px = 20.0

[expect.drawn]
servo_rms_px = 4.0
settle_s = 2.0
success_rate = 0.9

[vary]
start.y = { uniform = [1.0, 2.0] }
"""
)


def test_seeds_that_draw_have_bounds_of_their_own(mine):
    mine.write_text(DRAWN)
    written = {"outcome": "TIMED_OUT", "servo_rms_px": 2.0}
    drawn = {"outcome": "TIMED_OUT", "servo_rms_px": 4.0, "settle_s": 2.0}
    assert (judged().expect, judged().success_rate) == (written, None)
    assert judged("vary={}", seed=3).expect == written
    assert (judged(seed=3).expect, judged(seed=3).success_rate) == (drawn, 0.9)


def test_bounds_of_drawn_seeds_need_draws(mine):
    mine.write_text(DRAWN.partition("[vary]")[0])
    with pytest.raises(Mistake) as told:
        judged()
    assert str(told.value) == (
        "mine.toml: expect.drawn is for runs with drawn settings, and no table [vary] draws any: "
        "add [vary], or leave expect.drawn out"
    )


def test_a_bound_that_is_set_holds_for_seeds_that_draw_too(mine):
    mine.write_text(DRAWN)
    assert judged("expect.servo_rms_px=1.5", seed=3).expect["servo_rms_px"] == 1.5
    assert judged("expect.drawn.servo_rms_px=1.5", seed=3).expect["servo_rms_px"] == 1.5
    assert judged("expect.drawn.servo_rms_px=1.5").expect["servo_rms_px"] == 2.0
    assert judged("expect={}", seed=3).expect == {}


def test_other_trackers_have_bounds_of_drawn_seeds_too(mine):
    mine.write_text(DRAWN)
    frozen = judged("tracker.kind=frozen", seed=3)
    assert (frozen.expect, frozen.success_rate) == ({"servo_rms_px": 20.0}, None)
    assert frozen.table["expect"] == {"servo_rms_px": 9.0, "drawn": {"servo_rms_px": 20.0}}
    assert judged("tracker.kind=frozen").expect == {"servo_rms_px": 9.0}
    set_here = judged("tracker.kind=frozen", "expect.drawn.settle_s=5", seed=3)
    assert set_here.expect == {"servo_rms_px": 20.0, "settle_s": 5}
    assert judged("tracker.kind=pf_ssd", seed=3).expect == {}


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            "expect.drawn=3",
            "--set expect.drawn=3: expect.drawn = 3: this should be a table of settings",
        ),
        (
            "expect.tracker.frozen.drawn=3",
            "--set expect.tracker.frozen.drawn=3: "
            "expect.tracker.frozen.drawn = 3: this should be a table of settings",
        ),
        (
            "expect.drawn.settle=3",
            "--set expect.drawn.settle=3: expect.drawn.settle = 3: there is no such key",
        ),
        (
            "expect.drawn.success_rate=2",
            "--set expect.drawn.success_rate=2: "
            "expect.drawn.success_rate = 2: input should be less than or equal to 1",
        ),
        (
            "expect.drawn.settle_s=soon",
            "--set expect.drawn.settle_s=soon: "
            "expect.drawn.settle_s = 'soon': input should be a valid number",
        ),
    ],
)
def test_a_mistake_in_the_bounds_of_drawn_seeds_is_one_sentence(mine, change, sentence):
    mine.write_text(DRAWN)
    with pytest.raises(Mistake) as told:
        judged(change)
    assert str(told.value) == sentence


def test_a_study_judges_each_tracker_by_its_own_bounds(mine):
    (mine.parent / "study.toml").write_text(
        '# x\n# Y.\nscenario = "mine.toml"\nseeds = 1\n[set]\nrun.duration = 0.1\n'
        '[axes]\ntracker.kind = ["kams", "frozen", "pf_ssd"]\n'
    )
    runs = [job.run(Path()).row for job in load_study("study.toml").jobs()]
    assert [[b["name"] for b in run["missed"]] for run in runs] == [
        ["servo_rms_px"],
        ["servo_rms_px"],
        [],
    ]
    assert [b["bound"] for run in runs for b in run["missed"]] == ["2.0", "9.0"]
    assert [run["success"] for run in runs] == [run["outcome"] == "TIMED_OUT" for run in runs]
