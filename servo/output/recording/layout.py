"""The layout of recordings in Rerun's viewer, and the names of the entities of their pictures."""

from collections.abc import Sequence

import rerun.blueprint as rrb

from servo.output.room_view import EYE, LOOKS_AT

IMAGE = "world/eye/image"
"""Entity of the camera's picture in the recording of a run."""
PICTURE = "image"
"""The same in the recording of a track, which has no room."""
REPLAY = {
    "recorded": "Film",
    "drawn": "Simulation at the recorded posture",
    "difference": "Difference, three times",
}
"""Entities of the pictures of a replay, with their titles."""
UP = (0, 0, 1)


def blueprint_of_run(features: Sequence[str]) -> rrb.Blueprint:
    """Return the layout in Rerun's viewer of the recording of a run.

    The camera's picture and the scene are at the left, plots over time at the right, with a list of
    events below the plots.

    Args:
        features: Names of the run's image features.
    """
    eye = rrb.EyeControls3D(position=EYE, look_target=LOOKS_AT, eye_up=UP)

    def plot(name: str, title: str) -> rrb.TimeSeriesView:
        # At the left the legend would cover the transient.
        legend = rrb.Corner2D.RightTop
        return rrb.TimeSeriesView(origin=f"plots/{name}", name=title, plot_legend=legend)

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
    motion = [plot(f"motion/{name}", f"Target motion, {name}") for name in features]
    numbers = rrb.Vertical(
        plot("error", "Distance of the true centre from goal and estimate [px]"),
        rrb.Tabs(
            plot("features", "Feature errors"),
            plot("range", "Joints within their range"),
            plot("joints", "Joints"),
            plot("tilt", "Tilt of the camera [deg]"),
            plot("nis", "Innovation squared over its variance"),
        ),
        rrb.Horizontal(*[rrb.Tabs(*part) for part in (motion[0::2], motion[1::2]) if part]),
        rrb.Tabs(
            plot("twist/linear", "Camera velocity [m/s]"),
            plot("twist/angular", "Camera turn [rad/s]"),
        ),
        rrb.Tabs(
            plot("distance", "Distance in appearance"),
            plot("ess", "Effective sample size"),
            plot("ms", "Stages [ms]"),
        ),
        rrb.TextLogView(origin="events", name="Events"),
        row_shares=[3, 3, 3, 3, 2, 2],
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
        rrb.TimeSeriesView(origin=f"plots/{name}", name=title)
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
    """Return the viewer's layout of a replay: its three pictures side by side, and below them the
    median difference over time [grey levels].
    """
    pictures = [rrb.Spatial2DView(origin=name, name=title) for name, title in REPLAY.items()]
    curve = rrb.TimeSeriesView(origin="plots/difference", name="Median difference [grey levels]")
    rows = rrb.Vertical(rrb.Horizontal(*pictures), curve, row_shares=[2, 1])
    return rrb.Blueprint(rows, rrb.TimePanel(timeline="sim_time"), collapse_panels=True)
