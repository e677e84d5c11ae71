"""What is known of a track at its end: report.json of `servobench track`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from servo.output.formats import Made, Number


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackReport(Made):
    """Source, tracker, losses and measures of a track."""

    FILE: ClassVar[str] = "report.json"
    KIND: ClassVar[str] = "track"
    FORMAT: ClassVar[int] = 1

    source: str
    tracker: dict[str, Any]
    """Kind and settings, as they were given."""
    seed: int
    frames: int
    undecodable: list[str]
    """Names of pictures that could not be read."""
    lost: int
    """Frames in which the tracker reported LOST."""
    measures: dict[str, Number | None]
    """None where a measure has no finite value; empty without a truth."""
    units: dict[str, str]
    """Of the measures, by name."""
