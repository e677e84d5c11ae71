"""Tracker of OpenCV by its name: MIL; Nano, Vit and DaSiamRPN with model files of the user; CSRT
and KCF where OpenCV's additional modules are installed.
"""

from dataclasses import dataclass

from sim.ranges import File
from tracking.guests.cv2_tracker import MODELS, Cv2Tracker
from tracking.guests.guest import GuestSettings
from tracking.guests.own_thread import TimedGuest
from tracking.guests.wrap import Wrapping
from tracking.types import Trait


@dataclass(frozen=True, slots=True)
class Config(GuestSettings):
    """Settings of one of OpenCV's trackers: OpenCV's name of it without "Tracker", such as "MIL",
    the ONNX files of its networks if it has any, and settings of any tracker of another author.
    """

    traits = frozenset({Trait.FOREIGN})

    name: str = "MIL"
    """The class in OpenCV without "Tracker": "Nano", "Vit", "DaSiamRPN", "MIL", "CSRT", "KCF"."""
    model: File | tuple[File, ...] = ()
    """ONNX files: one for Vit, two for Nano (backbone, neckhead), three for DaSiamRPN (model,
    kernel_cls1, kernel_r1)."""

    def guest(self, seed: int) -> TimedGuest:
        """Return OpenCV's tracker with its networks loaded, in a thread of its own; `seed` seeds
        the random numbers of OpenCV and of the C library in the whole process.

        Raises:
            ValueError: OpenCV has no such tracker, the tracker needs another number of model files,
                one cannot be read or loaded within `loading` s, or `least_confidence` is set for a
                tracker that reports none.
        """
        models = (self.model,) if isinstance(self.model, str) else self.model

        def make(seed: int) -> Cv2Tracker:
            return Cv2Tracker(self.name, models, seed)

        confidence = "score" if self.name in MODELS else None
        place = f"OpenCV's {self.name}"
        if confidence is None and self.least_confidence > 0:
            raise ValueError(
                f"{place} reports no confidence, but least_confidence = {self.least_confidence:g} "
                "needs one: set least_confidence to 0"
            )
        return Wrapping(make, "opencv", confidence, place, rounds=True).timed(seed, self)
