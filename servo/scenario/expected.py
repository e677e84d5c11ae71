"""The bounds on a run's measures in a scenario's table [expect], by kind of tracker."""

from dataclasses import dataclass

from servo.mistake import Mistake
from servo.scenario.catalogue import PLUGINS
from servo.scenario.toml import Table, is_table

TRACKER = "tracker"
ANY = "*"
"""In place of a kind of tracker: all trackers that [expect.tracker] does not name."""
DRAWN = "drawn."
"""Prefix of the names of bounds in [expect.drawn], which replace others in runs with drawn
settings."""
SUCCESS_RATE = "success_rate"
"""The only bound from below: the share of runs that succeed."""


@dataclass(frozen=True, slots=True)
class Expected:
    """The bounds of a scenario: upper bounds by measure, and the expected `outcome`, for its own
    tracker and for others.
    """

    own: str
    """Kind of the tracker in the scenario's file, to which [expect] applies."""
    expect: Table
    """The bounds in [expect], and those in [expect.drawn] by names such as drawn.servo_rms_px."""
    changed: Table
    """Bounds that --set or a study has changed; they apply to all trackers."""
    others: dict[str, Table]
    """The bounds in each table [expect.tracker.KIND], by kind or `ANY`."""

    @staticmethod
    def read(table: Table, written: Table, place: str) -> "Expected":
        """Read the bounds of a scenario.

        Args:
            table: The scenario's table, with changes by --set or a study.
            written: The table as it is in the scenario's file.
            place: The table's place, for messages.

        Raises:
            Mistake: `expect` or a table in it is not a table, or [expect.tracker] names the
                scenario's own tracker.
        """
        given = table.get("expect", {})
        expect = _flat(given, f"{place}: expect")
        others = given.get(TRACKER, {}) if is_table(given) else {}
        if not is_table(others) or not all(is_table(b) for b in others.values()):
            raise Mistake(f"{place}: expect.tracker should be a table of bounds by kind of tracker")
        own = tracker_of(written)
        before = written.get("expect", {})
        if own in others:
            raise Mistake(
                f"{place}: expect.tracker.{own}: {own} is the scenario's own tracker; write its "
                "bounds directly into [expect]"
            )
        known = _flat(before, f"{place}: expect") if is_table(before) else {}
        as_written = {name for name in known if not name.startswith(DRAWN)}
        replaced = not as_written <= expect.keys()  # as a whole: --set expect={}
        changed = {name: b for name, b in expect.items() if replaced or b != known.get(name)}
        of_kinds = {kind: _flat(b, f"{place}: expect.tracker.{kind}") for kind, b in others.items()}
        return Expected(own, expect, changed, of_kinds)

    def made_for(self, kind: str) -> Table:
        """Return all bounds for a kind of tracker, those for runs with drawn settings under names
        such as drawn.servo_rms_px; an empty table if the scenario has none for this tracker.
        """
        if kind == self.own:
            return self.expect
        return self.others.get(kind, self.others.get(ANY, {})) | self.changed

    def of(self, kind: str, *, drawn: bool = False) -> Table:
        """Return the bounds of a run by measure, with the expected `outcome`.

        Args:
            kind: Kind of the run's tracker.
            drawn: Whether the run's seed has drawn settings.
        """
        found = self.made_for(kind)
        own, of_drawn = _parts(found)
        return own | of_drawn | _parts(self.changed)[0] if drawn else own

    @property
    def success(self) -> object:
        """Return the outcome in [expect], which counts as success for every tracker, or None."""
        return self.expect.get("outcome")

    def unjudged(self, kind: str) -> str:
        """Return a sentence that explains why runs with a kind of tracker have no verdict, if the
        scenario has bounds only for other trackers; else "".
        """
        if self.made_for(kind) or not self.expect:
            return ""
        return f"No verdict: the bounds are made for {self.own}, and there are none for {kind}."


def _flat(bounds: object, place: str) -> Table:
    """Return a table of bounds with those in its table `drawn` by names such as
    drawn.servo_rms_px, and without its table `tracker`.

    Raises:
        Mistake: `bounds` or its `drawn` is not a table.
    """
    if not is_table(bounds):
        raise Mistake(f"{place} should be a table of bounds, not {bounds!r}")
    found = {name: b for name, b in bounds.items() if name not in (TRACKER, DRAWN[:-1])}
    drawn = bounds.get(DRAWN[:-1], {})
    if not is_table(drawn):
        raise Mistake(f"{place}.drawn should be a table of bounds, not {drawn!r}")
    return found | {f"{DRAWN}{name}": b for name, b in drawn.items()}


def _parts(bounds: Table) -> tuple[Table, Table]:
    """Split bounds into those for runs without drawn settings, and those with the prefix "drawn.",
    from which it is removed.
    """
    drawn = {name.removeprefix(DRAWN): b for name, b in bounds.items() if name.startswith(DRAWN)}
    return {name: b for name, b in bounds.items() if not name.startswith(DRAWN)}, drawn


def tracker_of(table: Table) -> str:
    """Return the kind of tracker that a scenario's table names, or the default kind."""
    tracker = table.get(TRACKER, {})
    default = PLUGINS[TRACKER][1]
    return str(tracker.get("kind", default)) if is_table(tracker) else default
