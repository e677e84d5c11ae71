"""Runs trackers on sequences with known truth as jobs, and makes the records of the runs."""

import hashlib
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from servo.closing import closing
from servo.scenario.named_files import DIGITS, digest_of, digests, named_by
from servo.scenario.toml import Table
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
"""Series of a record: share of frames above each overlap threshold."""
PRECISION_CURVE = "precision_curve"
"""Series of a record: share of frames within each error threshold."""
LONGEST_LABEL = 60
"""Most characters of a tracker's label."""
NAMING = ("level", "colours")
"""Settings of painted sequences whose values are part of the sequence's name."""


@dataclass(frozen=True, slots=True)
class Contender:
    """A tracker that is run on sequences: its label in tables, and its settings."""

    label: str
    config: Any
    """The tracker's `Config`."""

    def __post_init__(self) -> None:
        """Check the label, which names the folder of the tracker's tracks.

        Raises:
            ValueError: The label cannot be the name of a folder.
        """
        label = self.label
        plain_name = label.isprintable() and not set(label) & {"/", "\\"} and label == label.strip()
        if not plain_name or not 0 < len(label) <= LONGEST_LABEL or label[0] == ".":
            raise ValueError(
                f"the label '{label}' cannot name a folder: expected 1 to {LONGEST_LABEL} "
                "printable characters without / and \\, no dot in front, and no space at either end"
            )

    def describe(self) -> Table:
        """Return kind and settings of the tracker, and the digests of its model files if it has
        some.
        """
        found: Table = {"kind": kind_of(self.config), "settings": as_json(self.config)}
        files = digests(named_by(self.config))
        return found | ({"files": files} if files else {})


@dataclass(frozen=True, slots=True)
class Generated:
    """A kind of painted (synthetic) sequence with its settings; each seed gives another
    sequence.
    """

    kind: str
    config: Any
    """The sequence's `Config`."""

    @property
    def name(self) -> str:
        """Return the kind of the painted sequence, followed by the level or the colours if the kind
        has such a setting.
        """
        found = [str(getattr(self.config, key)) for key in NAMING if hasattr(self.config, key)]
        return "-".join([self.kind, *found])

    def describe(self) -> Table:
        """Return kind and settings of the painted sequence."""
        return {"kind": self.kind, "settings": as_json(self.config)}

    def build(self, seed: int) -> Sequence:
        """Return the sequence of a seed, whose pictures are painted when they are read."""
        return self.config.build(np.random.default_rng([seed, *self.kind.encode()]))


@dataclass(frozen=True, slots=True)
class Recorded:
    """A recorded sequence of pictures with a file of the target's true positions, in a folder of
    sequences.
    """

    folder: Path
    name: str
    """Name of the sequence, which may be that of a folder inside."""
    truth_format: Format = Format.AUTO
    content: str = ""
    """Digest of the pictures and the truth."""

    @staticmethod
    def all_in(folder: Path, form: Format = Format.AUTO) -> list["Recorded"]:
        """Return the sequences in a folder, whose truth files have the format `form` (AUTO: each is
        recognised by its name and header).

        Raises:
            ValueError: There is no sequence, or a picture or truth cannot be read.
        """
        found = list[Recorded]()
        for sequence in read_all(folder, RATE, form):
            pictures = sequence.source
            assert isinstance(pictures, Folder)  # `read_all` makes no other one
            content = hashlib.sha256(sequence.truth.tobytes())
            content.update(" ".join(digest_of(str(file)) for file in pictures.files).encode())
            found.append(Recorded(folder, sequence.name, form, content.hexdigest()[:DIGITS]))
        return found

    def describe(self) -> Table:
        """Return the sequence's folder, name, format of the truth file, and digest of pictures and
        truth, by name.
        """
        return {
            "folder": str(self.folder.resolve()),
            "name": self.name,
            "truth_format": self.truth_format.name.lower(),
            "content": self.content,
        }

    def build(self, seed: int) -> Sequence:
        """Return the sequence, whose pictures are read when used; the seed has no effect.

        Raises:
            ValueError: The folder or a truth cannot be read any more.
        """
        found = read_all(self.folder, RATE, self.truth_format)
        return next(s for s in found if s.name == self.name)


Entry = Generated | Recorded
"""A kind of painted sequence, or a recorded sequence, of a suite; results of all seeds of one name
are averaged."""


@dataclass(frozen=True, slots=True)
class TrackedSequence:
    """A tracker and the sequence that it follows, which a job runs together."""

    contender: Contender
    entry: Entry

    @property
    def name(self) -> str:
        """Return the name of the sequence, which is the same for all seeds."""
        return self.entry.name

    def describe(self) -> Table:
        """Return kind and settings of the tracker and of the sequence."""
        return {"tracker": self.contender.describe(), "sequence": self.entry.describe()}

    def track_path(self, folder: Path, seed: int) -> Path:
        """Return the path of the CSV file with the estimates of a seed in a study's folder."""
        return folder / TRACKS / self.contender.label / f"{self.name}-{seed}.csv"

    def perform(self, job: Job, folder: Path) -> Record:
        """Let the tracker follow the sequence of a job, and return the record; the estimates are
        written to `track_path` in the folder.

        Raises:
            OSError: The track cannot be written.
            ValueError: A picture or the truth cannot be read, or the tracker refuses the region.
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
