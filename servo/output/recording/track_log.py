"""A track (a tracker's estimates for a sequence of pictures) as a Rerun recording: pictures,
estimate, truth, particles, confidence, time.
"""

import rerun as rr

from servo.output.recording.destination import Recording
from servo.output.recording.layout import PICTURE, blueprint_of_track
from servo.output.recording.log import JPEG_QUALITY
from servo.output.recording.solids import outline
from servo.output.sinks import Timer
from sim.types import Array
from tracking.drawing import colours
from tracking.drawing.picture_bytes import encoded
from tracking.evaluation.track import Shot
from tracking.types import Region


class TrackLog:
    """Sink (receiver of the pictures of a track) that writes each picture, with the tracker's
    estimate and the true outline, into a Rerun recording. `region` is the target's region in the
    first picture; `every` is the wall-clock time between two flushes [s].
    """

    def __init__(self, recording: Recording, region: Region, every: float = 1.0) -> None:
        """Begin a recording.

        Args:
            recording: Destination of the data.
            region: The target's region in the first picture.
            every: Wall-clock time between two flushes [s].
        """
        self._region = region
        self._timer = Timer(every)
        self._file = recording
        self.close = recording.close
        self.abandon = recording.abandon
        self._rec = recording.begin("servobench_track", blueprint_of_track())

    def add(self, shot: Shot, truth: Array | None) -> None:
        rec = self._rec
        estimate = shot.estimate
        rec.set_time("frame", sequence=shot.index)
        # The timeline of runs, for `servobench view`.
        rec.set_time("sim_time", duration=shot.picture.time)
        if shot.picture.image is not None:
            data = encoded(shot.picture.image, JPEG_QUALITY)
            rec.log(PICTURE, rr.EncodedImage(contents=data, media_type="image/jpeg"))
        corners = estimate.outline(self._region)
        rec.log(f"{PICTURE}/estimate", outline(corners, colours.STATUS[estimate.status]))
        if truth is not None:
            rec.log(f"{PICTURE}/truth", outline(truth, colours.TRUTH))
        if estimate.particles is not None:
            points = rr.Points2D(estimate.particles[:, :2], colors=colours.PARTICLES, radii=0.5)
            rec.log(f"{PICTURE}/particles", points)
        rec.log("plots/confidence", rr.Scalars(shot.confidence))
        rec.log("plots/ms", rr.Scalars(1e3 * shot.seconds))
        rec.log("plots/evaluations", rr.Scalars(float(estimate.evaluations)))
        if self._timer.due():
            self._file.flush()
