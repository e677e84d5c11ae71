"""The layout of recordings in Rerun's viewer, and the names of the entities of their pictures."""

from collections.abc import Sequence

import rerun.blueprint as rrb

from servo.output.room_view import EYE, LOOKS_AT

IMAGE = "world/eye/image"
"""Entity of the camera's picture in the recording of a run."""
PICTURE = "image"
"""Entity of the picture in the recording of a track, which has no room."""
REPLAY = {
    "recorded": "Film",
    "drawn": "Simulation at the recorded posture",
    "difference": "Difference, three times",
}
"""Entities of the pictures of a replay, with their titles."""
UP = (0, 0, 1)
VELOCITY = "Velocity [m/s]: x red, y green, z blue; measured darker"
"""Title that names the colours of the six lines: a legend would be higher than the plot."""


def blueprint_of_run(features: Sequence[str]) -> rrb.Blueprint:
    """Return the layout in Rerun's viewer of the recording of a run.

    The camera's picture and the scene are at the left, plots over time at the right, with a list of
    events at the bottom.

    Args:
        features: Names of the run's image features.
    """
    eye = rrb.EyeControls3D(position=EYE, look_target=LOOKS_AT, eye_up=UP)

    pictures = rrb.Vertical(
        rrb.Spatial2DView(origin=IMAGE, name="Camera: estimate green, goal red, truth white"),
        rrb.Tabs(
            rrb.Spatial3DView(origin="world", name="Robot", eye_controls=eye, line_grid=False),
            rrb.Spatial3DView(
                origin="world",
                name="Following the target",
                eye_controls=rrb.EyeControls3D(tracking_entity="world/target", eye_up=UP),
                line_grid=False,
            ),
        ),
    )
    motion = [_plot(f"motion/{name}", f"Target: d{name}/dt") for name in features]
    numbers = rrb.Vertical(
        _plot("error", "Distance from goal, and of the estimate [px]"),
        rrb.Tabs(
            _plot("features", "Feature errors"),
            _plot("nis", "Normalised innovation squared"),
        ),
        rrb.Horizontal(*[rrb.Tabs(*part) for part in (motion[0::2], motion[1::2]) if part]),
        rrb.Tabs(
            _plot("twist/linear", VELOCITY, legend=False),
            _plot("twist/angular", "Turn [rad/s]", legend=False),
            _plot("range", "Joints in their range"),
            _plot("joints", "Joints"),
            _plot("tilt", "Tilt [deg]", legend=False),
        ),
        rrb.Horizontal(
            rrb.Tabs(
                _plot("distance", "Appearance distance", legend=False),
                _plot("ess", "Effective sample size", legend=False),
                _plot("ms", "Stages [ms]"),
            ),
            rrb.TextLogView(origin="events", name="Events: hidden, lost, found, at a limit"),
            column_shares=[3, 2],
        ),
    )
    columns = rrb.Horizontal(pictures, numbers, column_shares=[1, 1])
    return rrb.Blueprint(
        columns, rrb.TimePanel(timeline="sim_time", state="collapsed"), collapse_panels=True
    )


def blueprint_of_track() -> rrb.Blueprint:
    """Return the layout in Rerun's viewer of the recording of a track (a tracker on a sequence of
    pictures): the picture at the left; at the right plots over time of confidence, time of the
    tracker [ms] and number of histograms that it read.
    """
    plots = [
        _plot(name, title, legend=False)
        for name, title in (
            ("confidence", "Confidence: 1 - distance"),
            ("ms", "Time of the tracker [ms]"),
            ("evaluations", "Histograms read"),
        )
    ]
    view = rrb.Spatial2DView(
        origin=PICTURE, name="Estimate green (locked), amber (unsure), red (lost); truth white"
    )
    columns = rrb.Horizontal(view, rrb.Vertical(*plots), column_shares=[2, 1])
    return rrb.Blueprint(columns, collapse_panels=True)


def blueprint_of_replay() -> rrb.Blueprint:
    """Return the layout in Rerun's viewer of the recording of a replay (a recorded film drawn again
    by the simulation): the recorded picture, the drawn one and their difference side by side, and
    below them the median difference over time [grey levels].
    """
    pictures = [rrb.Spatial2DView(origin=name, name=title) for name, title in REPLAY.items()]
    curve = rrb.TimeSeriesView(origin="plots/difference", name="Median difference [grey levels]")
    rows = rrb.Vertical(rrb.Horizontal(*pictures), curve, row_shares=[2, 1])
    return rrb.Blueprint(rows, rrb.TimePanel(timeline="sim_time"), collapse_panels=True)


def _plot(name: str, title: str, *, legend: bool = True) -> rrb.TimeSeriesView:
    """Return a plot over time; `legend`: whether it names its lines."""
    corner = rrb.Corner2D.RightTop  # at the left the legend would cover the transient
    shown = rrb.PlotLegend(corner, visible=legend)
    return rrb.TimeSeriesView(origin=f"plots/{name}", name=title, plot_legend=shown)
