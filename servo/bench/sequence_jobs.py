"""The trackers, sequences and jobs of a bench."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from servo.scenario.named_files import digests, named_by
from sim.kinds import kind_of
from tracking.evaluation.track import Track, follow
from tracking.evaluation.track_file import TrackFile
from tracking.evaluation.track_measures import Comparison, measure_all
from tracking.files import atomic
from tracking.files.json_text import as_json, number
from tracking.sequences.sequence import Sequence, read_all
from tracking.sequences.sources import RATE
from tracking.sequences.truth import Format

TRACKS = "tracks"
LONGEST_LABEL = 60
NAMING = ("level", "colours")
"""Settings of painted sequences that are part of their names."""


@dataclass(frozen=True, slots=True)
class Contender:
    """A tracker with its settings and its name in tables."""

    label: str
    config: Any
    """Its `Config`."""

    def __post_init__(self) -> None:
        """Refuse a label that cannot be the name of a folder, in which results are stored."""
        label = self.label
        plain_name = label.isprintable() and not set(label) & {"/", "\\"} and label == label.strip()
        if not plain_name or not 0 < len(label) <= LONGEST_LABEL or label[0] == ".":
            raise ValueError(
                f"'{label}' names a folder: 1 to {LONGEST_LABEL} characters without / and \\, "
                "no dot in front"
            )

    def describe(self) -> dict[str, Any]:
        """Kind and settings, and the digests of model files where it has some."""
        settings = as_json(self.config)
        found = {"kind": kind_of(self.config), "settings": settings}
        return found | {"files": files} if (files := digests(named_by(self.config))) else found


@dataclass(frozen=True, slots=True)
class Generated:
    """A painted sequence."""

    kind: str
    config: Any

    @property
    def name(self) -> str:
        """The kind, with the level or the colours if there are several."""
        found = [str(getattr(self.config, key)) for key in NAMING if hasattr(self.config, key)]
        return "-".join([self.kind, *found])

    def describe(self) -> dict[str, Any]:
        return {"kind": self.kind, "settings": as_json(self.config)}

    def build(self, seed: int) -> Sequence:
        return self.config.build(np.random.default_rng([seed, *self.kind.encode()]))


@dataclass(frozen=True, slots=True)
class Recorded:
    """One sequence of a folder."""

    folder: Path
    name: str
    truth_format: Format = Format.AUTO

    def describe(self) -> dict[str, Any]:
        form = self.truth_format.name.lower()
        return {"folder": str(self.folder.resolve()), "name": self.name, "truth_format": form}

    def build(self, seed: int) -> Sequence:
        del seed
        found = read_all(self.folder, RATE, self.truth_format)
        return next(s for s in found if s.name == self.name)


Entry = Generated | Recorded
"""A sequence of a suite; all seeds of one name are averaged together."""


@dataclass(frozen=True, slots=True)
class SequenceJob:
    """One tracker on one sequence with one seed."""

    contender: Contender
    entry: Entry
    seed: int

    @property
    def key(self) -> str:
        return f"{self.contender.label}/{self.entry.name}-{self.seed}"

    def describe(self) -> dict[str, Any]:
        return {
            "tracker": self.contender.describe(),
            "sequence": self.entry.describe(),
            "seed": self.seed,
        }

    def run(self, folder: Path) -> dict[str, Any]:
        """Measures and curves; the track is written to DIR/tracks."""
        sequence = self.entry.build(self.seed)
        path = track_path(folder, self.key)
        atomic.folder(folder, f"{TRACKS}/{self.contender.label}")
        tracker = self.contender.config.build(np.random.default_rng(self.seed))
        rows = TrackFile(path, sequence.region)
        shots = []
        try:
            for shot in follow(tracker, sequence.source, sequence.region, sequence.start):
                rows.add(shot)
                shots.append(shot.without_picture())
        finally:
            rows.close()
        track = Track.of(shots, sequence.region)
        comparison = Comparison.of(track, sequence.truth, sequence.states)
        return {
            "tracker": self.contender.label,
            "sequence": sequence.name,
            "family": self.entry.name,
            "seed": self.seed,
            "drawn": isinstance(self.entry, Generated),
            "frames": len(shots),
            "measures": {k: number(v) for k, v in measure_all(comparison).items()},
            "success": comparison.success().tolist(),
            "precision": comparison.precision().tolist(),
        }


def track_path(folder: Path, key: str) -> Path:
    """The file of a job's track."""
    return folder / TRACKS / f"{key}.csv"
