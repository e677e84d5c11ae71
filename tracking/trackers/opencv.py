"""Tracker of OpenCV by its name: MIL; Nano, Vit and DaSiamRPN with model files of the user; CSRT
and KCF where OpenCV's additional modules are installed.
"""

from dataclasses import dataclass

import numpy as np

from sim.ranges import File
from tracking.types import Trait
from tracking.wrapped.cv2_tracker import MODELS, Cv2Tracker
from tracking.wrapped.foreign_tracker import ForeignTracker, JudgeSettings
from tracking.wrapped.wrap import Wrapping


@dataclass(frozen=True, slots=True)
class Config(JudgeSettings):
    """OpenCV's name of the tracker, and settings by which its boxes are judged LOCKED."""

    traits = frozenset({Trait.FOREIGN})

    name: str = "MIL"
    """The class in OpenCV without "Tracker": "Nano", "Vit", "DaSiamRPN", "MIL", "CSRT", "KCF"."""
    model: File | tuple[File, ...] = ()
    """ONNX files: one for Vit, two for Nano (backbone, neckhead), three for DaSiamRPN (model,
    kernel_cls1, kernel_r1)."""

    def build(self, rng: np.random.Generator) -> ForeignTracker:
        """Return the tracker; OpenCV's own random state is seeded from the generator."""
        models = (self.model,) if isinstance(self.model, str) else self.model

        def make(seed: int) -> Cv2Tracker:
            return Cv2Tracker(self.name, models, seed)

        score = "score" if self.name in MODELS else None
        return Wrapping(make, "opencv", score, f"OpenCV's {self.name}").build(self, rng)
