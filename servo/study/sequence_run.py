"""Runs trackers on sequences of pictures whose true outlines are known, as jobs, and makes the
records of the runs.
"""

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
from tracking.evaluation.track import Track, follow, remarks
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
REMARKS = "remarks"
"""Setting of a record: sentences about pictures that cannot be read, or change their size."""
PRECISION_CURVE = "precision_curve"
"""Series of a record: share of frames within each error threshold."""
LONGEST_LABEL = 60
"""Most characters of a tracker's label."""
NAMING = ("level", "colours")
"""Settings of painted sequences whose values are part of the sequence's name."""


@dataclass(frozen=True, slots=True)
class Contender:
    """A tracker that is compared with others on sequences of pictures: its label in tables, and its
    settings (a `Config`, which builds the tracker).
    """

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
        """Return the tracker's kind and settings by the keys "kind" and "settings"; if the settings
        name files that can be read, such as models, also their digests by path, by the key "files".
        """
        found: Table = {"kind": kind_of(self.config), "settings": as_json(self.config)}
        files = digests(named_by(self.config))
        return found | ({"files": files} if files else {})


@dataclass(frozen=True, slots=True)
class Generated:
    """A kind of painted (synthetic) sequence of pictures with its settings (a `Config`); each seed
    gives another sequence.
    """

    kind: str
    config: Any
    """The sequence's `Config`."""

    @property
    def name(self) -> str:
        """Return the kind of the painted sequence, followed by the values of its settings "level"
        and "colours" if it has them, such as "clutter-a".
        """
        found = [str(getattr(self.config, key)) for key in NAMING if hasattr(self.config, key)]
        return "-".join([self.kind, *found])

    def describe(self) -> Table:
        """Return kind and settings of the painted sequence, by the keys "kind" and "settings"."""
        return {"kind": self.kind, "settings": as_json(self.config)}

    def build(self, seed: int) -> Sequence:
        """Return the painted sequence of a seed; its pictures are painted when they are read."""
        return self.config.build(np.random.default_rng([seed, *self.kind.encode()]))


@dataclass(frozen=True, slots=True)
class Recorded:
    """A recorded sequence of pictures, with a file of the target's true positions, in a folder that
    may hold several sequences. `content` is a digest of pictures and truth.
    """

    folder: Path
    name: str
    """Name of the sequence, which may be that of a folder inside."""
    truth_format: Format = Format.AUTO
    content: str = ""
    """Digest of the pictures and the truth."""

    @staticmethod
    def all_in(folder: Path, form: Format = Format.AUTO) -> list["Recorded"]:
        """Return the sequences of a folder: its own one, if it has pictures or truth files
        (positions of the target), else those of all folders in it. `form` is the format of the
        truth files; with AUTO, each is recognised by its name, header and numbers, and by the files
        beside it.

        Raises:
            ValueError: There is no sequence; a folder has only pictures or only a truth; or a truth
                cannot be read, has no recognised format, does not fit the pictures, or has no
                target in the first one.
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
        """Return the sequence's folder (absolute path), name, format of the truth file, and digest
        of pictures and truth, by the keys "folder", "name", "truth_format" and "content".
        """
        return {
            "folder": str(self.folder.resolve()),
            "name": self.name,
            "truth_format": self.truth_format.name.lower(),
            "content": self.content,
        }

    def build(self, seed: int) -> Sequence:
        """Return the sequence, whose pictures are read from the folder when they are used; the seed
        has no effect.

        Raises:
            ValueError: The folder or a truth file in it cannot be read any more, or the sequence is
                no longer there.
        """
        for found in read_all(self.folder, RATE, self.truth_format):
            if found.name == self.name:
                return found
        raise ValueError(
            f"{self.folder}: the sequence '{self.name}' is no longer there: restore it"
        )


Entry = Generated | Recorded
"""A kind of painted sequence, or a recorded sequence, of a suite; results of all seeds of one name
are averaged."""


@dataclass(frozen=True, slots=True)
class TrackedSequence:
    """A tracker (`contender`) and the sequence of pictures, painted (synthetic) or recorded, in
    which it follows a target in a job (`entry`).
    """

    contender: Contender
    entry: Entry

    @property
    def name(self) -> str:
        """Return the name of the sequence, which is the same for all seeds."""
        return self.entry.name

    def describe(self) -> Table:
        """Return the descriptions of the tracker and of the sequence, by the keys "tracker" and
        "sequence".
        """
        return {"tracker": self.contender.describe(), "sequence": self.entry.describe()}

    def track_path(self, folder: Path, seed: int) -> Path:
        """Return the path of the CSV file with the tracker's estimates for a seed:
        tracks/LABEL/SEQUENCE-SEED.csv in a study's folder.
        """
        return folder / TRACKS / self.contender.label / f"{self.name}-{seed}.csv"

    def perform(self, job: Job, folder: Path) -> Record:
        """Let the tracker follow the sequence with the seed of a job, and return the record (the
        results). The tracker's estimates are written to the file `track_path` in `folder`.

        Raises:
            OSError: That file cannot be written.
            ValueError: A picture or the truth cannot be read, or the tracker refuses the target's
                region in the first picture.
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
                REMARKS: ". ".join(remarks(shots)),
            },
            command=job.command,
            outcome="COMPLETED" if measures["completed"] else "LOST",
            success=bool(measures["completed"]),
            measures=measures,
            series={SUCCESS_CURVE: comparison.success(), PRECISION_CURVE: comparison.precision()},
            seconds=time.perf_counter() - began,
        )
