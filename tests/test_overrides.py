"""Changes of a scenario on the command line: what they set, and which of them is blamed."""

import pytest

from servo.mistake import Mistake
from servo.scenario import load as s
from sim.kinds import kind_of


def mistake(name, changes):
    with pytest.raises(Mistake) as found:
        s.load(name, changes)
    return str(found.value)


@pytest.mark.parametrize(
    ("item", "message"),
    [
        ("tracker.kind", "this is not key=value, such as tracker.kind=frozen"),
        ("run.seed.x=3", "'run.seed.x' leads through 'seed', which is not a table: correct it"),
        (
            "disturbances.5.start=1",
            "'disturbances.5.start' leads through '5', which is not a table: correct it",
        ),
    ],
)
def test_mistakes_in_overrides(item, message):
    changes = ["run.seed=1", item]
    assert mistake("occlusion", changes) == f"--set {item}: {message}"


def test_an_override_of_an_unknown_key_is_an_unknown_key():
    assert mistake("still", ["run.sed=1"]) == (
        "--set run.sed=1: run: there is no key 'sed'; did you mean 'seed'?"
    )


def test_overrides_change_values_of_every_type():
    changed = s.load(
        "occlusion",
        [
            "camera.width=200",
            "goal.x=3",
            "controller.matrix=mean",
            "disturbances.0.start=2.5",
            'controller.dof=["vx", "vy"]',
            "world.visibility=true",
        ],
        seed=7,
    )
    assert (changed.camera.width, changed.goal.x, changed.controller.matrix) == (200, 3.0, "mean")
    assert changed.disturbances[0].start == 2.5
    assert changed.controller.dof == ("vx", "vy")
    assert changed.world.visibility is True
    assert changed.run.seed == 7
    largest = s.load("still", [f"run.seed={2**63 - 1}"])
    assert largest.run.seed == 2**63 - 1


def test_setting_another_kind_clears_the_rest_of_its_table():
    assert s.load("circle").controller.feed_forward == ("xn", "yn", "theta")
    kept = s.load("circle", ["controller.kind=ibvs"]).controller
    assert kept.feed_forward == ("xn", "yn", "theta")
    back = s.load("circle", ["controller.kind=hold", "controller.kind=ibvs"]).controller
    assert back.feed_forward is None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            ["camera.width=320", "run.latency=500", "run.seed=3"],
            "--set run.latency=500: run.latency = 500: input should be less than or equal to 100",
        ),
        (
            ["tracker.kind=frozen", "tracker.particles=9"],
            "--set tracker.particles=9: tracker: there is no key 'particles'; this kind has no "
            "settings",
        ),
        (
            ["run.latency=500", "run.latency=3", "run.latency=501"],
            "--set run.latency=501: run.latency = 501: input should be less than or equal to 100",
        ),
        (
            ["disturbances.0.start=1"],
            "--set disturbances.0.start=1: 'disturbances.0.start' leads through '0', which is not "
            "a table: correct it",
        ),
        (
            ["disturbances=[{ kind = 'spot' }]", "disturbances.00.start=1"],
            "--set disturbances.00.start=1: 'disturbances.00.start' leads through '00', which is "
            "not a table: correct it",
        ),
        (
            ["disturbances=[{ kind = 'spot' }]", "disturbances.0=1"],
            "--set disturbances.0=1: 'disturbances.0' should end with the number of an item that is there and is no table, counted from 0, such as start.pose.2, or with a key of a table there, such as disturbances.0.start",
        ),
        (
            ["start.pose=[0, 0, 1, 0, 0, 0]", "start.pose.6=1"],
            "--set start.pose.6=1: 'start.pose.6' should end with the number of an item that is there and is no table, counted from 0, such as start.pose.2, or with a key of a table there, such as disturbances.0.start",
        ),
        (
            ['run."lat.ency"=2'],
            "--set run.\"lat.ency\"=2: run: there is no key 'lat.ency'; did you mean 'latency'?",
        ),
        (
            [f"run.{'a.' * 30}b=1"],
            f"--set run.{'a.' * 30}b=1: tables and lists are nested too deep; the limit is 20 levels",
        ),
        (["sweep=3"], "--set sweep=3: sweep should be a table, not 3"),
        (
            ["controller.weights=[1, 2]"],
            "--set controller.weights=[1, 2]: controller.weights.2: a value is missing",
        ),
        (
            ["controller.dof=vx"],
            "--set controller.dof=vx: controller.dof = 'vx': this should be a list",
        ),
    ],
)
def test_the_override_that_is_wrong_is_blamed_and_no_other(changes, message):
    assert mistake("still", changes) == message


def test_a_file_that_is_wrong_is_blamed_whatever_is_changed(tmp_path):
    (tmp_path / "mine.toml").write_text("[run]\nlatency = 500\n")
    assert mistake(str(tmp_path / "mine.toml"), ["run.seed=3", "camera.width=9"]) == (
        "mine.toml: run.latency = 500: input should be less than or equal to 100"
    )


def test_the_last_of_two_overrides_holds_and_an_earlier_one_may_be_wrong():
    changes = ["run.latency=2", "run.latency=500", " run . latency = 0x03"]
    assert s.load("still", changes).run.latency == 3


def test_a_name_with_dots_stands_in_quotes():
    changes = ['expect.tracker."mine.py:Name".servo_rms_px=3', "expect.tracker.kams.servo_rms_px=4"]
    others = s.load("still", changes).bounds.others
    assert others["mine.py:Name"] == {"servo_rms_px": 3}
    assert others["kams"] == {"servo_rms_px": 4}
    wrong = 'expect.tracker."mine.py:Name"=3'
    assert mistake("still", [wrong]) == (
        f"--set {wrong}: expect.tracker.mine.py:Name should be a table of settings, not 3"
    )


def test_a_setting_before_the_kind_of_its_table_counts_as_one_after_it():
    for changes in (
        ["controller.gain=3", "controller.kind=qp"],
        ["controller.kind=qp", "controller.gain=3"],
    ):
        law = s.load("still", changes).controller
        assert (kind_of(law), law.gain) == ("qp", 3.0)
