"""The bounds that a scenario sets for its own tracker and for others."""

from dataclasses import dataclass
from typing import Any

from servo.mistake import Mistake
from servo.scenario.catalogue import PLUGINS
from servo.scenario.toml import Table

TRACKER = "tracker"
ANY = "*"
"""Any tracker without a table of its own."""
DRAWN = "drawn."
"""Before the name of a bound in [expect.drawn], which holds where a seed has drawn settings."""
SUCCESS_RATE = "success_rate"
"""The only bound from below: the share of runs that succeed."""


@dataclass(frozen=True, slots=True)
class Expected:
    """The bounds of a scenario, by kind of tracker."""

    own: str
    """The kind of tracker in the scenario's file, which [expect] is made for."""
    expect: Table
    """[expect], without those of other trackers; those of drawn seeds by names such as
    drawn.servo_rms_px."""
    changed: Table
    """Bounds that --set or a study has changed; they hold for any tracker."""
    others: dict[str, Table]
    """[expect.tracker.KIND] by kind, or ANY; as `expect`."""

    @staticmethod
    def read(table: Table, written: Table, place: str) -> "Expected":
        """Return the bounds of a table; `written` is the table in its file, before changes.

        Raises:
            Mistake: A table of bounds is not a table, or one is for the scenario's own tracker.
        """
        given = table.get("expect", {})
        expect = _flat(given, f"{place}: expect")
        others = given.get(TRACKER, {})
        if not isinstance(others, dict) or not all(isinstance(b, dict) for b in others.values()):
            raise Mistake(f"{place}: expect.tracker should be a table of bounds by kind of tracker")
        own = tracker_of(written)
        before = written.get("expect", {})
        if own in others:
            raise Mistake(
                f"{place}: expect.tracker.{own}: this is the scenario's own tracker; its bounds "
                "stand in [expect] itself"
            )
        known = _flat(before, f"{place}: expect") if isinstance(before, dict) else {}
        as_written = {name for name in known if not name.startswith(DRAWN)}
        replaced = not as_written <= expect.keys()  # as a whole: --set expect={}
        changed = {name: b for name, b in expect.items() if replaced or b != known.get(name)}
        others = {kind: _flat(b, f"{place}: expect.tracker.{kind}") for kind, b in others.items()}
        return Expected(own, expect, changed, others)

    def made_for(self, kind: str) -> Table:
        """Return all bounds for a kind of tracker; an empty table if the file has none for it."""
        if kind == self.own:
            return self.expect
        return self.others.get(kind, self.others.get(ANY, {})) | self.changed

    def of(self, kind: str, *, drawn: bool = False) -> Table:
        """Return the bounds of a run, whose seed may have drawn settings."""
        found = self.made_for(kind)
        own, of_drawn = _parts(found)
        return own | of_drawn | _parts(self.changed)[0] if drawn else own

    @property
    def success(self) -> Any:
        """Return the outcome that counts as success for any tracker; None if the file has none."""
        return self.expect.get("outcome")

    def unjudged(self, kind: str) -> str:
        """Return a sentence if the file has bounds, but not for this kind; else an empty text."""
        if self.made_for(kind) or not self.expect:
            return ""
        return f"No verdict: the bounds are made for {self.own}, and there are none for {kind}."


def _flat(bounds: Any, place: str) -> Table:
    """Return a table of bounds with those of drawn seeds by names such as drawn.servo_rms_px.

    Raises:
        Mistake: `bounds` or its `drawn` is not a table.
    """
    if not isinstance(bounds, dict):
        raise Mistake(f"{place} should be a table of bounds, not {bounds!r}")
    found = {name: b for name, b in bounds.items() if name not in (TRACKER, DRAWN[:-1])}
    drawn = bounds.get(DRAWN[:-1], {})
    if not isinstance(drawn, dict):
        raise Mistake(f"{place}.drawn should be a table of bounds, not {drawn!r}")
    return found | {f"{DRAWN}{name}": b for name, b in drawn.items()}


def _parts(bounds: Table) -> tuple[Table, Table]:
    """Return the bounds of runs as written, and those of drawn seeds by their own names."""
    drawn = {name.removeprefix(DRAWN): b for name, b in bounds.items() if name.startswith(DRAWN)}
    return {name: b for name, b in bounds.items() if not name.startswith(DRAWN)}, drawn


def tracker_of(table: Table) -> str:
    """Return the kind of tracker in a scenario's table."""
    tracker = table.get(TRACKER, {})
    default = PLUGINS[TRACKER][1]
    return str(tracker.get("kind", default)) if isinstance(tracker, dict) else str(default)
