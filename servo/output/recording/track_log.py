"""A track as a Rerun recording: pictures, estimate, truth, particles, confidence, time."""

from __future__ import annotations

import rerun as rr
import rerun.blueprint as rrb

from servo.output.recording.archetypes import Recording, outline
from servo.output.recording.log import JPEG_QUALITY
from sim.types import Array
from tracking.drawing.annotated_video import COLOURS
from tracking.drawing.picture_bytes import encoded
from tracking.evaluation.track import Shot
from tracking.types import Region

IMAGE = "image"
WHITE = (255, 255, 255)
AMBER = (255, 190, 40)


class TrackLog:
    """Writer of the recording of one track."""

    def __init__(self, recording: Recording, region: Region, at_once: int) -> None:
        """Begin a recording; the data of so many pictures is sent at once."""
        self._region = region
        self._at_once = at_once
        self._file = recording
        self._rec = recording.begin("servobench_track", _blueprint())

    def add(self, shot: Shot, truth: Array | None) -> None:
        rec = self._rec
        estimate = shot.estimate
        rec.set_time("frame", sequence=shot.index)
        rec.set_time(
            "sim_time", duration=shot.picture.time
        )  # the timeline of runs, for `servobench view`
        if shot.picture.image is not None:
            data = encoded(shot.picture.image, JPEG_QUALITY)
            rec.log(IMAGE, rr.EncodedImage(contents=data, media_type="image/jpeg"))
        corners = estimate.outline(self._region)
        rec.log(f"{IMAGE}/estimate", outline(corners, COLOURS[estimate.status]))
        if truth is not None:
            rec.log(f"{IMAGE}/truth", outline(truth, WHITE))
        if estimate.particles is not None:
            points = rr.Points2D(estimate.particles[:, :2], colors=AMBER, radii=0.5)
            rec.log(f"{IMAGE}/particles", points)
        rec.log("plots/confidence", rr.Scalars(shot.confidence))
        rec.log("plots/ms", rr.Scalars(1e3 * shot.seconds))
        rec.log("plots/evaluations", rr.Scalars(float(estimate.evaluations)))
        if (shot.index + 1) % self._at_once == 0:
            self._file.flush()

    def close(self) -> None:
        self._file.close()

    def abandon(self) -> None:
        """Leave the recording as it is; nothing more is logged."""


def _blueprint() -> rrb.Blueprint:
    plots = [
        rrb.TimeSeriesView(origin=f"plots/{name}", name=title)
        for name, title in (
            ("confidence", "Confidence: 1 - distance"),
            ("ms", "Time of the tracker [ms]"),
            ("evaluations", "Histograms read"),
        )
    ]
    view = rrb.Spatial2DView(
        origin=IMAGE, name="Estimate green (locked), amber (unsure), red (lost); truth white"
    )
    columns = rrb.Horizontal(view, rrb.Vertical(*plots), column_shares=[2, 1])
    return rrb.Blueprint(columns, collapse_panels=True)
