"""All that is derived from a run stays what it is: table, recording, measures, plots, events.

The tracker is a script, so that no number depends on how a machine renders; the values lie in
tests/data/approved.
"""

import json
import shutil
from dataclasses import dataclass, replace
from operator import itemgetter

import numpy as np
import pyarrow.parquet as pq
import pytest

from servo.loop.episode import Episode
from servo.loop.events import events
from servo.loop.measure import MEASURES
from servo.loop.run_measures import summarise
from servo.output import plots
from servo.output.run_curves import RunCurves
from servo.output.run_folder import RunFolder
from servo.output.steps_table import TIMED
from servo.scenario.load import load
from servo.study.bounds import missed_bounds
from servo.study.run import Record
from servo.study.run_report import RunReport
from tracking.types import Estimate, State, Status

ROUNDING = 1e-4
"""Other processors round otherwise: a closed loop may differ by this share."""
CHANGES = (
    "run.duration=1.4",
    "run.latency=1",
    "run.ego=true",
    "camera.rate=24.0",
    "goal.angle_deg=20.0",
    "estimator.kind=kalman_cv",
    "controller.acceleration=0.6",
    "start.x=-25.0",
    "motion.kind=reversal",
    "motion.speed=0.2",
)
DROPPED = {"kind": "dropped_frames", "share": 0.3}
MACHINE = ("/__properties", "/plots/ms", "EncodedImage:blob", "Mesh3D:albedo_texture_buffer")
"""What of a recording depends on the machine."""


@dataclass(frozen=True)
class Script:
    """A tracker that drifts from where it began, is unsure for a while and then lost."""

    def build(self, rng):
        return Scripted(rng)


class Scripted:
    def __init__(self, rng):
        self.rng = rng

    def start(self, frame, region, state):
        self.state, self.count = state, 0

    def update(self, frame, ego=None):
        self.count += 1
        dx, dy, turn, grow = self.rng.normal(0, (0.3, 0.3, 0.004, 0.002))
        s = self.state
        drift = 0.0 if ego is None else 0.2 * ego[0]
        self.state = State(s.x + dx + 0.3 + drift, s.y + dy, s.theta + turn, s.scale * (1 + grow))
        status = Status.UNSURE if 10 <= self.count < 13 else Status.LOCKED
        status = Status.LOST if 18 <= self.count < 21 else status
        particles = np.column_stack(
            [self.state.vector + self.rng.normal(0, 1, (3, 4)), [1 / 3] * 3]
        )
        return Estimate(
            self.state,
            np.diag([0.3, 0.2, 1e-4, 1e-5]) * self.count,
            0.01 * self.count,
            status,
            ess=30.0 - self.count,
            evaluations=3,
            particles=particles,
        )


@pytest.fixture(scope="module")
def scripted(tmp_path_factory):
    """The steps of a run of 35 frames, its scenario, and the folder it has written."""
    folder = tmp_path_factory.mktemp("scripted")
    dropped = [f"disturbances.0.{key}={value}" for key, value in DROPPED.items()]
    scenario = replace(load("occlusion", [*CHANGES, *dropped], seed=3), tracker=Script())
    with Episode(scenario) as episode:
        written = RunFolder(folder, episode, rerun=True)
        steps = []
        for step in episode:
            written.add(step)
            steps.append(step)
        written.close()
    return steps, scenario, written


def report_of(scripted):
    steps, scenario, _ = scripted
    return summarise(steps, replace(scenario.measure, after=0.4), 1 / scenario.camera.rate)


def test_the_table_has_these_values(scripted, approved):
    table = pq.read_table(scripted[2].folder / "steps.parquet")
    kept = [n for n in table.column_names if not n.startswith(TIMED)]
    rows = table.select(kept).take(list(range(0, len(table), 3))).to_pydict()
    meanings = {f.name: f.metadata[b"meaning"].decode() for f in table.schema}
    approved("run/table", {"values": rows, "meanings": meanings}, ROUNDING)
    times = [table[n].to_numpy() for n in table.column_names if n.startswith(TIMED)]
    assert np.all(np.concatenate(times) < 60)  # in seconds


def test_the_measures_are_these(scripted, approved):
    report = report_of(scripted)
    missed = missed_bounds(
        report.outcome.name,
        report.measures,
        {"servo_rms_px": 1.0, "servo_peak_px": 500.0, "unseen_pct": 1.0, "outcome": "LIMIT_HIT"},
    )
    measures = {
        name: [report.measures[name], measure.unit, measure.meaning]
        for name, measure in MEASURES.items()
        if name != "step_ms"
    }
    found = {"measures": measures, "outcome": report.outcome, "missed": map(str, missed)}
    approved("run/measures", found | {"missed": [str(v) for v in missed]}, ROUNDING)
    shown = [s for s in scripted[0][1:] if s.frame.fresh]
    total = np.median([s.seconds.total for s in shown])
    assert report.measures["step_ms"] == pytest.approx(1e3 * total)


def test_these_events_happen(scripted, approved):
    steps, before, found = scripted[0], None, {}
    for step in steps:
        found[step.frame.index] = events(before, step)
        before = step
    approved("run/events", {frame: what for frame, what in found.items() if what})


def test_the_plots_show_this(scripted, drawn, approved):
    steps, _, written = scripted
    whole = RunCurves.of(pq.read_table(written.folder / "steps.parquet"), steps[0].scene.features)
    curves = replace(whole, table=whole.table.take([*range(0, len(steps), 2)]))
    figures = [plots.motion_figure(curves, "title"), plots.error_figure(curves, "title")]
    assert [figure.get_suptitle() for figure in figures] == [
        "title: the target's own motion",
        "title: errors",
    ]
    for name, figure in zip(("motion", "errors"), figures, strict=True):
        approved(f"run/plot-{name}", drawn(figure), ROUNDING)


def test_distances_of_rounding_alone_are_drawn_as_none(scripted):
    steps, _, written = scripted
    whole = RunCurves.of(pq.read_table(written.folder / "steps.parquet"), steps[0].scene.features)
    table = whole.table
    for name in ("servo_error_px", "tracking_error_px"):
        at = table.schema.get_field_index(name)
        table = table.set_column(at, name, [1e-14 * np.arange(len(table))])
    axes = plots.error_figure(replace(whole, table=table), "title").axes
    assert axes[1].get_ylim() == pytest.approx((-0.5, 0.5))  # the line is inside, and seen


def test_a_single_picture_that_was_dropped_is_shaded(scripted):
    steps, _, written = scripted
    whole = RunCurves.of(pq.read_table(written.folder / "steps.parquet"), steps[0].scene.features)
    times = whole.table["time_s"].to_numpy()
    names = np.where(np.arange(len(times)) == 4, "UNSURE", "LOCKED")
    at = whole.table.schema.get_field_index("status")
    table = whole.table.set_column(at, "status", [names])
    (shade,) = plots.error_figure(replace(whole, table=table), "title").axes[0].collections
    around = shade.get_paths()[0].vertices[:, 0]
    assert (around.min(), around.max()) == (times[4], times[5])


def test_motions_that_are_always_zero_are_not_drawn(scripted):
    steps, _, written = scripted
    whole = RunCurves.of(pq.read_table(written.folder / "steps.parquet"), steps[0].scene.features)

    def drawn_of(*at_rest):
        table = whole.table
        for name in at_rest:
            for which in ("estimated", "true"):
                at = table.schema.get_field_index(f"motion_{which}_{name}_m_s")
                table = table.set_column(at, table.field(at).name, [1e-14 * np.arange(len(table))])
        figure = plots.motion_figure(replace(whole, table=table), "title")
        return [axes.get_ylabel() for axes in figure.axes]

    xn, yn = "dxn/dt of the target [m/s]", "dyn/dt of the target [m/s]"
    assert drawn_of() == [xn, yn]
    assert drawn_of("xn") == [yn]
    assert drawn_of("xn", "yn") == [xn]  # a figure is never empty


@pytest.mark.newest
def test_the_recording_holds_these_values(scripted, approved):
    from rerun.chunk import RrdReader

    found = {}
    for chunk in RrdReader(str(scripted[2].folder / "run.rrd")).stream():
        batch = chunk.to_record_batch()
        if chunk.is_static:  # the newest row counts: a slow machine writes the paths more often
            batch = batch.slice(batch.num_rows - 1)
        frames = batch.column("frame").to_pylist() if "frame" in batch.schema.names else [0]
        for name in (n for n in batch.schema.names if ":" in n):
            at = f"{chunk.entity_path} {name}{' static' * chunk.is_static}"
            if not any(part in at for part in MACHINE):
                values = batch.column(name).to_pylist()
                if chunk.is_static:
                    found[at] = []  # the newest counts: a slow machine writes the ways more often
                    values = values[-1:]
                found.setdefault(at, []).extend(zip(frames, values, strict=True))
    kept = {at: sorted(rows, key=itemgetter(0))[::9] for at, rows in sorted(found.items())}
    kept = json.loads(json.dumps(kept, default=lambda b: b.decode(errors="replace")))
    approved("run/recording", kept, ROUNDING)


@pytest.mark.newest
def test_all_that_is_said_and_drawn_of_the_run(scripted, section, approved, tmp_path):
    steps, scenario, written = scripted
    report = report_of(scripted)
    record = Record(
        subject=scenario.name,
        seed=scenario.run.seed,
        outcome="LIMIT_HIT",
        success=False,
        measures=report.measures | {"step_ms": 1.5},
        missed=missed_bounds(
            "LIMIT_HIT", report.measures, {"servo_rms_px": 1.0, "servo_peak_px": 500.0}
        ),
    )
    written.finish(RunReport.of(record, scenario, steps[0].scene))
    folder = shutil.copytree(written.folder, tmp_path / "run")
    said = section(folder)
    for block in said["blocks"]:  # versions are those of this machine
        block["tables"] = [t for t in block["tables"] if t["head"] != ["package", "version"]]
    approved("run/report", said, ROUNDING)
    kept = json.loads((folder / "report.json").read_text())
    approved("run/report-json", kept | {"versions": sorted(kept["versions"])}, ROUNDING)


TILTED = ("start.x=30.0", "start.angle_deg=15.0", "start.scale=0.9", "motion.kind=circle")
ALL_DOF = 'controller.dof=["vx", "vy", "vz", "wx", "wy", "wz"]'
VARIANTS = {
    "arm": ("robot.kind=arm", ALL_DOF, "run.latency=2"),
    "level": (ALL_DOF, 'controller.secondary=["level", "centre"]', "sight.plane=known"),
    "limits": (
        ALL_DOF,
        'controller.secondary=["avoid_limits"]',
        "robot.kind=arm",
        "controller.weights=[1.0, 1.0, 1.0, 0.1, 0.1, 1.0]",
    ),
    "desired": ("controller.matrix=desired", "sight.depth=known", "controller.gain_far=0.8"),
    "mean": ("controller.matrix=mean", "believed.depth_factor=1.3", "features.scaling=paper"),
    "slow start": (
        "controller.smooth_start=3.0",
        "controller.fastest=0.1",
        "controller.fastest_turn=0.1",
        "sight.plane=estimated",
    ),
    "nearer": (
        "goal.depth_to=0.8",
        "goal.change_start=0.1",
        "goal.change_duration=0.5",
        "estimator.kind=error_kalman",
        "run.latency=3",
    ),
    "lost": ("controller.coast=0.05", "controller.search_after=0.05", "goal.x=20.0"),
    "fed forward": (
        'controller.feed_forward=["xn", "yn", "an", "theta"]',
        "run.ego=true",
        "region.x=3.0",
        "region.angle_deg=4.0",
        "region.width=1.1",
        "run.latency=0",
    ),
    "noisy": ("camera.width=200", "camera.height=160", "camera.rate=15.0", "goal.angle_deg=170.0"),
}


@pytest.mark.parametrize("name", VARIANTS)
def test_a_loop_with_other_settings_moves_like_this(name, approved):
    changes = ["run.duration=1.0", *TILTED, *VARIANTS[name]]
    scenario = replace(load("still", [*changes, "vary={}"], seed=5), tracker=Script())
    with Episode(scenario) as episode:
        rows = [
            {
                "joints": s.joints,
                "twist": s.command.twist,
                "features": s.features,
                "error": s.error,
                "motion": s.prediction.motion,
                "mode": s.command.mode,
                "true": [*s.truth.centre, s.truth.theta, s.truth.size],
                "tilt": s.tilt,
                "saturated": [s.command.saturated, s.limited],
            }
            for s in episode
        ]
    approved(f"loops/{name.replace(' ', '-')}", rows[::3], ROUNDING)
