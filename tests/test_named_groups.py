"""Named groups of settings in a study, and the ways that its page draws of them."""

from dataclasses import replace

import numpy as np
import pytest

from servo.report import study_data, study_paths
from servo.study import store
from servo.study.parse import load
from servo.study.store import StudyFile

NAMED = """# mine
# Two schemes from two starts.
scenario = "small_hybrid"
seeds = [3]
compare = "scheme"

[set]
run.duration = 0.2
measure.after = 0.1
expect = { outcome = "TIMED_OUT" }

[named.scheme."corners, desired"]
features.kind = "points"
controller.matrix = "desired"

[named.scheme."target"]
features = { kind = "pose", error = "cMo" }

[named.begin]
near = { start.pose = [0.0, 0.0, 1.1, 0.0, 0.0, 20.0] }
far = { start.pose = [0.0, 0.0, 1.5, 0.0, 0.0, 20.0] }
"""


@pytest.mark.wide
def test_named_groups_are_axes_and_their_page_draws_the_ways(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(NAMED)
    study = load("mine.toml")
    runs = list(study.jobs())
    assert [r.settings for r in runs[:2]] == [
        {"scheme": "corners, desired", "begin": "near"},
        {"scheme": "corners, desired", "begin": "far"},
    ]
    parsed = [r.subject.parsed(r.seed, r.settings) for r in runs]
    assert [type(s.features).__module__ for s in parsed[1:3]] == [
        "servo.features.points",
        "servo.features.pose",
    ]
    assert [s.start.pose[2] for s in parsed] == [1.1, 1.5, 1.1, 1.5]
    assert parsed[0].controller.matrix == "desired"
    assert "--set features.kind=points" in runs[0].command
    with store.opened(tmp_path / "out", StudyFile.of(study, "me")) as kept:
        for run in runs:
            kept.add(run, run.run(kept.folder))
    found = study_data.load(tmp_path / "out")
    pictures = study_paths.paths(found)
    assert [p.title for p in pictures] == ["begin = near", "begin = far"]
    first = found.series[0]
    assert first["camera_z_m"][0] == pytest.approx(-1.1, abs=0.01)
    assert first["corner0_u_px"][0] == pytest.approx(320 - 600 * 0.1 * 0.598 / 1.1, abs=1.0)
    assert "<svg" in pictures[0].svg
    # A camera that goes far away is drawn in a box of its own.
    first["camera_z_m"] = first["camera_z_m"] + np.linspace(0, -50, len(first["camera_z_m"]))
    rows = [dict(row) | {"success": row["run"] > 0} for row in found.rows]
    axes = study_paths.paths(replace(found, rows=rows))[0].drawing.axes[::2]
    assert [ax.get_zlim()[1] for ax in axes] == pytest.approx([1.1 * 51.1, 1.21], abs=0.15)
    assert axes[0].get_zlabel() == "-z [m]"
    # The target is a square of 0.2 m below the path.
    square = [[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1], [-0.1, -0.1]]
    np.testing.assert_allclose(np.transpose(axes[0].lines[1].get_data_3d()[:2]), square)
    # Runs of other seeds, and runs without a path, are not drawn.
    moved = first | {"camera_z_m": first["camera_z_m"] - 100}
    other = [dict(row, run=row["run"] + 10, seed=1) for row in found.rows]
    failed = [dict(row, run=row["run"] + 20) for row in found.rows]
    with_others = replace(
        found,
        rows=[*found.rows, *other, *failed],
        series=found.series | {row["run"]: moved for row in other},
    )
    assert [p.svg for p in study_paths.paths(with_others)] == [
        p.svg for p in study_paths.paths(found)
    ]
