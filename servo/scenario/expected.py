"""The bounds that a scenario sets for its own tracker and for others."""

from dataclasses import dataclass
from typing import Any

from servo.mistake import Mistake
from servo.scenario.catalogue import PLUGINS

Table = dict[str, Any]
TRACKER = "tracker"
ANY = "*"
"""Any tracker without a table of its own."""


@dataclass(frozen=True, slots=True)
class Expected:
    """The bounds of a scenario, by kind of tracker."""

    own: str
    """The kind of tracker in the scenario's file, which [expect] is made for."""
    expect: Table
    """[expect], without those of other trackers."""
    changed: Table
    """Bounds that --set or a study has changed; they hold for any tracker."""
    others: dict[str, Table]
    """[expect.tracker.KIND] by kind, or ANY."""

    @staticmethod
    def read(table: Table, written: Table, place: str) -> "Expected":
        """Return the bounds of a table; `written` is the table in its file, before changes.

        Raises:
            Mistake: They are no tables, or the scenario's own tracker is among the others.
        """
        given = table.get("expect", {})
        if not isinstance(given, dict):
            raise Mistake(f"{place}: expect should be a table of bounds, not {given!r}")
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
        expect = {name: bound for name, bound in given.items() if name != TRACKER}
        known: Table = before if isinstance(before, dict) else {}
        replaced = not known.keys() - {TRACKER} <= expect.keys()  # as a whole: --set expect={}
        changed = {name: b for name, b in expect.items() if replaced or b != known.get(name)}
        return Expected(own, expect, changed, others)

    def of(self, kind: str) -> Table:
        """Return the bounds for a kind of tracker; none where none are made for it."""
        if kind == self.own:
            return self.expect
        return self.others.get(kind, self.others.get(ANY, {})) | self.changed

    @property
    def success(self) -> Any:
        """Return the outcome that counts as success for any tracker; None if there is none."""
        return self.expect.get("outcome")

    def unjudged(self, kind: str) -> str:
        """Return a sentence where there are bounds, but none for this kind; else nothing."""
        if self.of(kind) or not self.expect:
            return ""
        return f"No verdict: the bounds are made for {self.own}, and there are none for {kind}."


def tracker_of(table: Table) -> str:
    """Return the kind of tracker in a scenario's table."""
    tracker = table.get(TRACKER, {})
    default = PLUGINS[TRACKER][1]
    return str(tracker.get("kind", default)) if isinstance(tracker, dict) else str(default)
