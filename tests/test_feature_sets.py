"""A feature set that is not ours, from a file, through everything that loops over features."""

import importlib
import sys

import numpy as np
import pyarrow.parquet as pq
import pytest

import servo.features
from servo.cli import run_command
from servo.mistake import Mistake
from servo.report import run_section
from servo.scenario.load import load

FILE = '''"""Centroid and size of the silhouette, not normalised."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Config:
    """No settings."""

    def build(self, outline):
        return Centroid()


class Centroid:
    names, units = ("u", "v", "grown"), ("1", "1", "px")
    noise, feed_forward, sole_dof = np.full(3, 1e-4), ("u", "v"), {"grown": "vz"}

    def values(self, sight):
        m = sight.moments
        return np.array([m.xg, m.yg, -np.log(m.area) / 2])

    def matrix(self, sight):
        m, Z = sight.moments, 1 / sight.plane.C
        x, y = m.xg, m.yg
        return np.array([
            [-1 / Z, 0, x / Z, x * y, -(1 + x * x), y],
            [0, -1 / Z, y / Z, 1 + y * y, -x * y, -x],
            [0, 0, -1 / Z, -1.5 * y, 1.5 * x, 0],
        ])

    def error(self, values, goal):
        return values - goal

    def known(self, sight):
        return np.array([True, True, sight.size_known])

    def scales(self, goal):
        return np.ones(3)
'''
CHANGES = (
    "features.kind=centroid",
    "run.duration=1.5",
    "expect={}",
    "start.x=30",
    'controller.dof=["vx", "vy", "vz"]',
)


@pytest.fixture
def centroid(tmp_path, monkeypatch):
    """The kind "centroid", for the time of a test."""
    (tmp_path / "plugins").mkdir()
    (tmp_path / "plugins" / "centroid.py").write_text(FILE)
    servo.features.__path__.append(str(tmp_path / "plugins"))
    importlib.invalidate_caches()
    yield
    servo.features.__path__.remove(str(tmp_path / "plugins"))
    sys.modules.pop("servo.features.centroid", None)


@pytest.mark.parametrize("estimator", ["kalman_cv", "kalman_ca", "jump", "error_kalman", "imm"])
def test_every_estimator_takes_a_set_of_three(centroid, estimator):
    from measured import measured_run

    changes = [*CHANGES, f"estimator.kind={estimator}"]
    steps, report = measured_run(load("line", changes))
    assert steps[-1].error.shape == steps[-1].prediction.nis.shape == (3,)
    assert steps[0].servo_error > 25
    assert steps[-1].servo_error < 6  # the camera has followed 1.5 s with gain 2: e^-3 of 30 px
    assert report.measures["lost_pct"] == 0


@pytest.mark.newest
def test_table_plots_recording_and_report_have_its_three_features(centroid, tmp_path):
    folder = tmp_path / "out"
    run_command.run("line", CHANGES, 0, folder, quiet=True)
    names = pq.read_table(folder / "steps.parquet").column_names
    assert [n for n in names if n.startswith(("feature_", "motion_true_", "nis_"))] == [
        "feature_u",
        "feature_v",
        "feature_grown_px",
        "motion_true_u_per_s",
        "motion_true_v_per_s",
        "motion_true_grown_px_s",
        "nis_u",
        "nis_v",
        "nis_grown",
    ]
    assert (folder / "target_motion.png").stat().st_size > 10_000
    assert {f"plots/motion/{n}" for n in ("u", "v", "grown")} <= entities(folder / "run.rrd")
    assert "plots/motion/xn" not in entities(folder / "run.rrd")
    section = run_section.section(folder)
    figures = next(block for block in section.blocks if block.figures).figures
    assert [f.title for f in figures][2:] == [
        "The target's own motion: u",
        "The target's own motion: v",
    ]
    assert [key.label for key in figures[1].keys] == ["u [1]", "v [1]", "grown [px]"]


def test_a_law_that_feeds_forward_what_the_set_does_not_have_is_refused(centroid):
    from servo.loop.episode import Episode

    with pytest.raises(Mistake) as refused:
        Episode(load("line", [*CHANGES, 'controller.feed_forward=["xn"]']))
    assert str(refused.value) == (
        "line: controller.feed_forward: there is no feature 'xn'; there is u, v, grown"
    )


@pytest.mark.parametrize(
    ("name", "changes", "message"),
    [
        (
            "still",
            ["features.kind=points", "tracker.kind=kams"],
            "features 'points': the tracker follows no angle nor size of this target, and without it "
            "none of the features is known: choose another tracker or other features",
        ),
        (
            "turn_180_pose",
            ["tracker.kind=kams", "features.error=cMo"],
            "features 'pose': the tracker follows no angle nor size of this target, and without it "
            "none of the features is known: choose another tracker or other features",
        ),
        (
            "photometric",
            ["estimator.kind=true"],
            "photometric: estimator: this kind needs the target's true motion, which is not known "
            "where features or controller use the pictures themselves: choose another kind, such as the estimator none",
        ),
        (
            "photometric",
            ["goal.depth_to=0.7"],
            "photometric: goal.depth_to: features made of pixels compare with one picture, taken at "
            "the first goal, so the goal must not move: leave goal.depth_to out",
        ),
        (
            "photometric",
            ["camera.width=32", "camera.height=20"],
            "photometric: a picture of 32 x 20 px is too small for features made of pixels, which "
            "leave out 10 px at each side: set a larger camera.width and camera.height",
        ),
        (
            "photometric",
            ["controller.preset=paper"],
            'photometric: controller.feed_forward: xn, yn, an, theta (as in preset = "paper") are '
            'features of features.kind = "moments"; name some of this kind: x, y, z, rx, ry, rz',
        ),
    ],
)
def test_what_a_feature_set_cannot_do_is_a_sentence(name, changes, message):
    from measured import measured_run

    with pytest.raises(Mistake) as refused:
        measured_run(load(name, [*changes, "run.duration=0.2"]))
    assert str(refused.value) == message


def test_a_controller_without_features_leaves_their_columns_empty(tmp_path):
    changes = ["controller.kind=hold", "run.duration=0.3", "expect={}"]
    run_command.run("still", changes, 0, tmp_path / "out", quiet=True)
    table = pq.read_table(tmp_path / "out" / "steps.parquet")
    for name in ("feature_xn_m", "error_theta_rad", "motion_measured_xn_m_s", "nis_an"):
        assert np.isnan(table[name].to_numpy()).all()
    assert not table["command_vx_m_s"].to_numpy().any()
    run_section.section(tmp_path / "out")


def entities(path):
    from rerun.chunk import RrdReader

    return {chunk.entity_path.strip("/") for chunk in RrdReader(str(path)).stream()}


SCHEMES = ("points", "pose", "hybrid", "segment")
PAIRED = ("kalman_cv", "error_kalman", "imm", "kalman_cv")
"""The filter with which the plain command runs each scheme."""


def paired():
    """Every scheme with every kind of filter."""
    for kind, plain in zip(SCHEMES, PAIRED, strict=True):
        for estimator in dict.fromkeys(PAIRED):
            marks = () if estimator == plain else pytest.mark.wide
            yield pytest.param(kind, estimator, marks=marks)


@pytest.mark.parametrize(("kind", "estimator"), [*paired()])
def test_every_scheme_follows_a_moving_tag_with_every_kind_of_filter(kind, estimator):
    """In six degrees of freedom; without a filter the centre is 14 px behind (f v / Z lambda).

    `polar` does not: its matrix is ill-conditioned where the corners are around the middle.
    """
    from measured import measured_run

    changes = [
        f"features.kind={kind}",
        f"estimator.kind={estimator}",
        "tracker.kind=tag",
        "run.duration=2.0",
        "expect={}",
        "goal.y=20",
    ]
    steps, _ = measured_run(load("tag_line", changes))
    assert steps[-1].prediction.nis.shape == (len(steps[-1].error),)
    assert max(s.servo_error for s in steps[-15:]) < 4.0
    assert steps[-1].tilt < 0.05
