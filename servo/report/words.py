"""Values as text, badges (coloured words) and tables, for an HTML report or a terminal."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # short commands print tables, and need no NumPy
    from tracking.statistics.comparisons import Interval

NOTHING = "\N{EN DASH}"
ROUNDING = 1e-12
"""Values below this are rounding errors of zero; no measure or setting is so small."""


class Tone(Enum):
    """Meaning of the colour of a badge (a coloured word): good, bad, or neither."""

    GOOD = "good"
    BAD = "bad"
    PLAIN = "plain"


@dataclass(frozen=True, slots=True)
class Badge:
    """A short text on a coloured ground in a report, such as a verdict; `tone` says whether it is
    good, bad or neither.
    """

    text: str
    tone: Tone

    @staticmethod
    def of(held: bool, good: str, bad: str | None = None) -> Badge:
        """Return a badge: a good one with the text `good` if `held`, else a bad one with the text
        `bad`, or with `good` if `bad` is None.
        """
        return Badge(good, Tone.GOOD) if held else Badge(bad or good, Tone.BAD)


Cell = str | Badge


@dataclass(frozen=True, slots=True)
class Table:
    """A table of texts for a report or a terminal: titles of the columns (`head`), rows of cells,
    and a note below. `words` and `faint` are numbers from 0: of the columns that are not numeric,
    and of the rows that are grey.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    words: Collection[int] = (0,)
    note: str = ""
    faint: Collection[int] = ()
    """Numbers of the rows that are grey."""


def shown(value: object) -> str:
    """Return a value as text: a float with three significant digits, or from 100 to a million as a
    whole number with commas, and 0 if it is as near to 0 as rounding errors are; a dash for None,
    nan and infinite values; yes or no for a bool; `str` of anything else.
    """
    if value is None:
        return NOTHING
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not isinstance(value, float):
        return str(value)
    if not math.isfinite(value):
        return NOTHING
    if abs(value) < ROUNDING:
        return "0"
    return f"{value:,.0f}" if 100 <= abs(value) < 1e6 else f"{value:.3g}"


def spread(interval: Interval | None, units: int = 0) -> str:
    """Return a mean with its 95 % interval as text, such as "2.1 (1.9 to 2.4)". It is the mean
    alone if the interval is unknown or has no width, and a dash for None.

    Args:
        interval: The mean and its interval.
        units: Usual number of independent repetitions; if the mean is over another number, this
            follows: "2.1 (1.9 to 2.4, n 5)". 0: it never does.
    """
    if interval is None:
        return NOTHING
    if not interval.known or interval.low == interval.high:
        return shown(interval.value)
    fewer = f", n {interval.units}" if units and interval.units != units else ""
    return f"{shown(interval.value)} ({shown(interval.low)} to {shown(interval.high)}{fewer})"


def basis(interval: Interval, unit: str) -> str:
    """Return what a mean is based on, such as "mean of 7 recordings, 95 %: 1.9 to 2.4"; without a
    known interval "mean of 7 recordings: no interval".

    Args:
        interval: The mean, its interval, and the number of repetitions.
        unit: Noun for a repetition in the singular, such as "recording".
    """
    over = f"mean of {counted(interval, unit)}"
    if not interval.known:
        return f"{over}: no interval"
    return f"{over}, 95 %: {shown(interval.low)} to {shown(interval.high)}"


def counted(interval: Interval | None, unit: str) -> str:
    """Return, as text, the number of repetitions over which a mean is taken, and the noun for them:
    "7 recordings" or "1 recording".

    Args:
        interval: The mean with this number; None counts as 0.
        unit: Noun for a repetition in the singular, such as "recording".
    """
    count = interval.units if interval else 0
    return f"{count} {unit}{'' if count == 1 else 's'}"


def listed(settings: Mapping[str, object]) -> str:
    """Return settings as a line of text, such as "camera.rate = 5, tracker.kind = kams"."""
    return ", ".join(f"{key} = {shown(value)}" for key, value in settings.items())


def cut(what: str, found: Sequence[object], most: int) -> str | None:
    """Return the sentence "The first 5 of 20 runs are shown."; None if the list is not longer than
    `most`.

    Args:
        what: Plural noun for the items, such as "runs".
        found: The list.
        most: Number of items that are shown.
    """
    return f"The first {most} of {len(found):,} {what} are shown." if len(found) > most else None
