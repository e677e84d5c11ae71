"""Runs of trackers on sequences with a truth: their subjects, and their records."""

from __future__ import annotations

import hashlib
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from servo.closing import closing
from servo.scenario.named_files import DIGITS, digest_of, digests, named_by
from servo.study.run import SEQUENCE, Job, Record
from sim.kinds import kind_of
from tracking.evaluation.track import Track, follow
from tracking.evaluation.track_file import TrackFile
from tracking.evaluation.track_measures import Comparison, measure_all
from tracking.evaluation.warm_up import warm_up
from tracking.files import atomic
from tracking.files.json_text import as_json
from tracking.sequences.sequence import Sequence, read_all
from tracking.sequences.sources import RATE, Folder
from tracking.sequences.truth import Format

TRACKS = "tracks"
TRACKER = "tracker"
SUCCESS_CURVE = "success_curve"
"""Share of frames above each overlap threshold."""
PRECISION_CURVE = "precision_curve"
"""Share of frames within each error threshold."""
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
        """Refuse a label that cannot be the name of a folder, in which tracks are stored."""
        label = self.label
        plain_name = label.isprintable() and not set(label) & {"/", "\\"} and label == label.strip()
        if not plain_name or not 0 < len(label) <= LONGEST_LABEL or label[0] == ".":
            raise ValueError(
                f"'{label}' names a folder: 1 to {LONGEST_LABEL} characters without / and \\, "
                "no dot in front"
            )

    def describe(self) -> dict[str, Any]:
        """Kind and settings, and the digests of model files where it has some."""
        found = {"kind": kind_of(self.config), "settings": as_json(self.config)}
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
        """Kind and settings."""
        return {"kind": self.kind, "settings": as_json(self.config)}

    def build(self, seed: int) -> Sequence:
        """Paint it."""
        return self.config.build(np.random.default_rng([seed, *self.kind.encode()]))


@dataclass(frozen=True, slots=True)
class Recorded:
    """One sequence of a folder."""

    folder: Path
    name: str
    truth_format: Format = Format.AUTO
    content: str = ""
    """Digest of its pictures and its truth."""

    @staticmethod
    def all_in(folder: Path, form: Format = Format.AUTO) -> list[Recorded]:
        """Return the sequences of a folder.

        Raises:
            ValueError: As for `read_all`.
        """
        found = list[Recorded]()
        for sequence in read_all(folder, RATE, form):
            pictures = sequence.source
            assert isinstance(pictures, Folder)  # `read_all` makes no other one
            content = hashlib.sha256(sequence.truth.tobytes())
            content.update(" ".join(digest_of(str(file)) for file in pictures.files).encode())
            found.append(Recorded(folder, sequence.name, form, content.hexdigest()[:DIGITS]))
        return found

    def describe(self) -> dict[str, Any]:
        """Where it is, and what is in it."""
        return {
            "folder": str(self.folder.resolve()),
            "name": self.name,
            "truth_format": self.truth_format.name.lower(),
            "content": self.content,
        }

    def build(self, seed: int) -> Sequence:
        """Read it."""
        found = read_all(self.folder, RATE, self.truth_format)
        return next(s for s in found if s.name == self.name)


Entry = Generated | Recorded
"""A sequence of a suite; all seeds of one name are averaged together."""


@dataclass(frozen=True, slots=True)
class TrackedSequence:
    """A subject: a sequence that a tracker follows."""

    contender: Contender
    entry: Entry

    @property
    def name(self) -> str:
        """Name of the sequence, the same for all seeds."""
        return self.entry.name

    def describe(self) -> dict[str, Any]:
        """Tracker and sequence."""
        return {"tracker": self.contender.describe(), "sequence": self.entry.describe()}

    def track_path(self, folder: Path, seed: int) -> Path:
        """The file of a track in a study's folder."""
        return folder / TRACKS / self.contender.label / f"{self.name}-{seed}.csv"

    def perform(self, job: Job, folder: Path) -> Record:
        """Follow the sequence; the track is written into the folder.

        Raises:
            OSError: The track cannot be written.
        """
        began = time.perf_counter()
        sequence = self.entry.build(job.seed)
        atomic.folder(folder, f"{TRACKS}/{self.contender.label}")
        warm_up(self.contender.config)  # the time for each picture is measured
        tracker = self.contender.config.build(np.random.default_rng(job.seed))
        rows = TrackFile(self.track_path(folder, job.seed), sequence.region)
        shots = []
        with closing(rows.close):
            for shot in follow(tracker, sequence.source, sequence.region, sequence.start):
                rows.add(shot)
                shots.append(shot.without_picture())
        track = Track.of(shots, sequence.region)
        comparison = Comparison.of(track, sequence.truth, sequence.states)
        measures = measure_all(comparison)
        return Record(
            number=job.number,
            subject=sequence.name,
            subject_is=SEQUENCE,
            seed=job.seed,
            settings={
                **job.settings,
                "family": self.name,
                "drawn": isinstance(self.entry, Generated),
                "frames": len(shots),
            },
            command=job.command,
            outcome="COMPLETED" if measures["completed"] else "LOST",
            success=bool(measures["completed"]),
            measures=measures,
            series={SUCCESS_CURVE: comparison.success(), PRECISION_CURVE: comparison.precision()},
            seconds=time.perf_counter() - began,
        )
