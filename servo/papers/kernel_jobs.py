"""The jobs of the claims about the multi-kernel trackers: sizes where motion blurs, and times."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from servo.bench.sequence_jobs import Contender, SequenceJob, track_path
from servo.papers.experiments import generated
from servo.papers.groups import Result
from sim.types import Frame
from tracking.evaluation.track_file import read
from tracking.sequences.painted.similarity import FAST
from tracking.sequences.sources import RATE

SIMILARITY = generated("similarity")


@dataclass(frozen=True, slots=True)
class Tracked:
    """A job: one tracker on one sequence, and how its size was off where motion blurs."""

    job: SequenceJob

    @property
    def key(self) -> str:
        return self.job.key

    def describe(self) -> dict[str, Any]:
        return self.job.describe() | {"sizes": FAST}

    def run(self, folder: Path) -> Result:
        """The measures, and ln of the found over the true size, blurred and else [%]."""
        result = self.job.run(folder)
        states = self.job.entry.build(self.job.seed).states
        assert states is not None
        off = 100 * np.log(read(track_path(folder, self.key)).states[:, 3] / states[:, 3])
        fast = slice(*(round(share * len(off)) for share in FAST))
        result["measures"] |= {
            "size_blurred": float(off[fast].mean()),
            "size_before": float(off[: fast.start].mean()),
        }
        return result


@dataclass(frozen=True, slots=True)
class Interleaved:
    """A job: the time of trackers that take each picture in turn."""

    contenders: tuple[Contender, ...]
    seed: int

    @property
    def key(self) -> str:
        return f"interleaved/{self.seed}"

    def describe(self) -> dict[str, Any]:
        trackers = [c.describe() for c in self.contenders]
        return {"trackers": trackers, "sequence": SIMILARITY.describe(), "seed": self.seed}

    def run(self, folder: Path) -> Result:
        """Median times [ms]."""
        del folder
        sequence = SIMILARITY.build(self.seed)
        trackers = [c.config.build(np.random.default_rng(self.seed)) for c in self.contenders]
        spent: list[list[float]] = []
        for k, picture in enumerate(sequence.source):
            assert picture.image is not None
            frame = Frame(picture.image, k / RATE, k)
            row: list[float] = []
            for tracker in trackers:
                began = perf_counter()
                if k == 0:
                    tracker.start(frame, sequence.region, sequence.start)
                else:
                    tracker.update(frame)
                row.append(1e3 * (perf_counter() - began))
            spent.append(row)
        return {"times": np.median(spent[1:], axis=0).tolist()}
