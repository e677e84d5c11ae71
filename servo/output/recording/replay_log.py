"""A replay as a Rerun recording: recorded pictures, those drawn again, and their difference."""

from collections.abc import Sequence

import rerun as rr

from servo.output.recording.destination import Recording
from servo.output.recording.layout import REPLAY, blueprint_of_replay
from servo.output.recording.log import JPEG_QUALITY
from servo.output.sinks import Timer
from sim.types import Image
from tracking.drawing.picture_bytes import encoded


class ReplayLog:
    """Writer of a replay (the pictures of a film, each beside the simulation's picture at the same
    posture of the robot) into a Rerun recording.
    """

    def __init__(self, recording: Recording, every: float = 1.0) -> None:
        """Begin a recording.

        Args:
            recording: Destination of the data.
            every: Wall-clock time between two flushes [s].
        """
        self._timer = Timer(every)
        self._file = recording
        self.close = recording.close
        self._rec = recording.begin("servobench_twin", blueprint_of_replay())

    def add(self, number: int, time: float, pictures: Sequence[Image], off: float) -> None:
        """Write the pictures of one time.

        Args:
            number: Number of the picture in the film.
            time: Its time in the film [s].
            pictures: The recorded one, the one drawn again, and their difference, RGB (H, W, 3).
            off: Median difference [grey levels].

        Raises:
            Refused: The destination takes no more data, such as a full disk.
        """
        self._rec.set_time("frame", sequence=number)
        # The timeline of runs, for `servobench view`.
        self._rec.set_time("sim_time", duration=time)
        for name, picture in zip(REPLAY, pictures, strict=True):
            image = rr.EncodedImage(
                contents=encoded(picture, JPEG_QUALITY), media_type="image/jpeg"
            )
            self._rec.log(name, image)
        self._rec.log("plots/difference", rr.Scalars(off))
        if self._timer.due():
            self._file.flush()
