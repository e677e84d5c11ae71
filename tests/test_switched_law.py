"""The law of the tutorial, from a package, where its two halves alone fail."""

from pathlib import Path

import pytest
from measured import measured_run
from tutorial_pages import saved_files

from servo.scenario.load import load

PACKAGE = Path(__file__).parent / "data" / "switched"
PAGE = Path(__file__).parents[1] / "servo" / "tutorials" / "a_law_that_switches.md"


@pytest.mark.wide
def test_it_arrives_where_points_retreats_and_pose_loses_the_target(monkeypatch):
    """There `points` retreats by 0.67 m on a way of 2.55 m (scenario border_points), and `pose`
    loses a corner (border_pose)."""
    law = (PACKAGE / "switched" / "law.py").read_text()
    assert saved_files(PAGE.read_text()) == {"switched/law.py": law}
    monkeypatch.syspath_prepend(PACKAGE)
    settings = ["controller.kind=switched.law:Config", "run.duration=7.0", "expect={}"]
    _, report = measured_run(load("border_pose", settings))
    measures = report.measures
    assert report.outcome.name == "CONVERGED"
    assert measures["retreat_m"] == pytest.approx(0.18, abs=0.02)
    assert measures["camera_path_m"] == pytest.approx(1.60, abs=0.05)
    assert measures["end_position_mm"] < 5
    assert measures["end_rotation_deg"] < 0.3
    assert measures["lost_pct"] == measures["out_of_view_pct"] == 0
