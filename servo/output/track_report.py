"""The report of a track: report.json of `servobench track`."""

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
    """Kind and settings that were given."""
    seed: int
    frames: int
    undecodable: list[str]
    """Names of the pictures that could not be read."""
    lost: int
    """Number of frames with status LOST."""
    measures: dict[str, Number | None]
    """Values of the measures by name, None if not finite; empty without a truth."""
    units: dict[str, str]
    """Units of the measures by name."""
