"""Bounds that every run misses, or none: found in the shipped scenarios, and said in others."""

import pytest

from servo.cli import main
from servo.scenario.catalogue import shipped
from servo.scenario.load import load
from servo.study.bounds import doubtful_bounds


@pytest.mark.parametrize("name", shipped())
def test_every_shipped_bound_can_be_kept_and_missed(name):
    scenario = load(name)
    duration = scenario.run.duration
    assert doubtful_bounds(scenario.bounds.expect, duration) == []
    for kind, bounds in scenario.bounds.others.items():
        assert doubtful_bounds(bounds, duration, kind) == []


@pytest.mark.parametrize(
    ("name", "bound", "why"),
    [
        ("retreat_m", 0.0, "rounding alone misses it; it should be above 0"),
        ("drawn.servo_rms_px", 0.0, "rounding alone misses it; it should be above 0"),
        ("lost_pct", -1.0, "every run misses it, as no measure is below 0"),
        ("lost_pct", 100.0, "no run misses it"),
        ("longest_off_s", 12.0, "no run of 12 s misses it"),
        ("settle_s", 16.0, "a run of 12 s misses it only where it never settles"),
    ],
)
def test_a_bound_that_judges_nothing_is_said(name, bound, why):
    assert doubtful_bounds({name: bound}, 12.0) == [f"expect.{name} = {bound:g}: {why}"]


@pytest.mark.parametrize(
    ("name", "bound"),
    [
        ("outcome", "CONVERGED"),
        ("lost_pct", 0.0),
        ("longest_off_s", 0.0),
        ("settle_s", 11.9),
        ("retreat_m", 0.005),
        ("servo_scale_peak_pct", 150.0),
        ("drawn.success_rate", 0.0),
    ],
)
def test_others_are_not_doubted(name, bound):
    assert doubtful_bounds({name: bound}, 12.0) == []


def test_a_check_says_it(tmp_path, capsys, monkeypatch):
    scenario = tmp_path / "mine.toml"
    text = "run.duration = 0.1\ntracker.kind = 'truth'\n[expect]\nretreat_m = 0.0\nlost_pct = 100\n"
    scenario.write_text(text)
    monkeypatch.setattr("sys.argv", ["servobench", "check", str(scenario), "--workers", "1"])
    with pytest.raises(SystemExit):
        main.main()
    said = " ".join(capsys.readouterr().err.split())
    assert "mine: expect.retreat_m = 0: rounding alone misses it; it should be above 0" in said
    assert "mine: expect.lost_pct = 100: no run misses it" in said
