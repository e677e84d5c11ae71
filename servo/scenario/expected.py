"""The bounds on a run's measures that a scenario states in its table [expect], for each kind of
tracker.
"""

import functools
from dataclasses import dataclass
from enum import Enum
from typing import Annotated, Any

from annotated_types import Ge, Le
from pydantic import BaseModel, Strict, create_model

from servo.loop.measure import MEASURES
from servo.loop.run_measures import Outcome
from servo.mistake import check_rules, unknown
from servo.scenario.catalogue import PLUGINS
from servo.scenario.fill import STRICT, validated
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
    """What a scenario expects of its runs, for its own tracker and for others: upper bounds on
    measures by name, the `outcome`, and for seeds with drawn settings the least success rate.
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
        """Read and check the bounds of a scenario, and return them.

        Args:
            table: The scenario's table, with changes by the option --set or by a study.
            written: The table as it is in the scenario's file.
            place: Where the table comes from; it begins messages.

        Raises:
            Mistake: A tracker, a measure or an outcome is unknown, a bound is not a finite number,
                a success rate is not from 0 to 1, or [expect.tracker] names the scenario's own
                tracker.
        """
        at = f"{place}: expect"
        form, of_others = _forms()
        expect = _flat(form, table.get("expect", {}), at)
        known = _flat(form, written.get("expect", {}), at)
        own = tracker_of(written)
        kinds = PLUGINS[TRACKER][0].names()
        others: dict[str, Table] = {}
        for kind, bounds in expect.pop(TRACKER, {}).items():
            check_rules(
                (
                    kind == own,
                    f"{at}.tracker.{own}: {own} is the scenario's own tracker; write its bounds "
                    "directly into [expect]",
                ),
                (
                    kind not in (*kinds, ANY) and ":" not in kind,
                    f"{at}.tracker: {unknown(kind, kinds, 'tracker')}",
                ),
            )
            others[kind] = _flat(of_others, bounds, f"{at}.tracker.{kind}")
        as_written = {name for name in known if not name.startswith((DRAWN, TRACKER))}
        replaced = not as_written <= expect.keys()  # as a whole: --set expect={}
        changed = {name: b for name, b in expect.items() if replaced or b != known.get(name)}
        return Expected(own, expect, changed, others)

    def made_for(self, kind: str) -> Table:
        """Return all bounds for a kind of tracker by measure, with those that --set or a study has
        changed. Bounds that hold only for seeds with drawn settings have names with a prefix, such
        as drawn.servo_rms_px. The table is empty if the scenario has no bounds for this tracker.
        """
        if kind == self.own:
            return self.expect
        return self.others.get(kind, self.others.get(ANY, {})) | self.changed

    def of(self, kind: str, *, drawn: bool = False) -> Table:
        """Return the upper bounds that apply to one run by measure, and the expected `outcome`; an
        empty table if the scenario has none for this tracker.

        Args:
            kind: Kind of the run's tracker.
            drawn: Whether the run's seed has drawn settings: a bound in [expect.drawn] then
                replaces that of the same measure, unless --set or a study has changed the latter,
                and `success_rate` is returned too if it is set.
        """
        found = self.made_for(kind)
        own, of_drawn = _parts(found)
        return own | of_drawn | _parts(self.changed)[0] if drawn else own

    def unjudged(self, kind: str) -> str:
        """Return a sentence that explains why runs with a kind of tracker have no verdict, if the
        scenario has bounds, but only for other trackers; else "".
        """
        kinds = [*([self.own] if self.expect else []), *self.others]
        if self.made_for(kind) or not kinds:
            return ""
        judged = " and ".join(kinds)
        return f"No verdict: the bounds are made for {judged}, and there are none for {kind}."


@functools.cache  # building them takes longer than loading a scenario
def _forms() -> tuple[type[BaseModel], type[BaseModel]]:
    """Return the pydantic models of [expect] and of a table of bounds for another tracker."""
    outcome = Enum("outcome", [(name, name) for name in Outcome.__members__])
    bounds: dict[str, Any] = dict.fromkeys(MEASURES, (float, None))
    bounds["outcome"] = (Annotated[outcome, Strict(False)], None)
    share: dict[str, Any] = {SUCCESS_RATE: (Annotated[float, Ge(0), Le(1)], None)}
    drawn = create_model("drawn", __config__=STRICT, **bounds, **share)
    other = create_model("other", __config__=STRICT, **bounds, drawn=(drawn, None))
    return create_model("expect", __base__=other, tracker=(dict[str, Any], None)), other


def _flat(form: type[BaseModel], bounds: object, place: str) -> dict[str, Any]:
    """Return a table of bounds with those in its table `drawn` by names such as
    drawn.servo_rms_px; its table `tracker` is not checked.

    Raises:
        Mistake: A name is unknown, or a value has the wrong type or is out of range.
    """
    found = validated(form, bounds, f"{place}.").model_dump(mode="json", exclude_unset=True)
    if is_table(bounds):  # missed bounds are named in the order of the file
        found = {name: found[name] for name in bounds}
    drawn = found.pop("drawn", {})
    return found | {f"{DRAWN}{name}": bound for name, bound in drawn.items()}


def _parts(bounds: Table) -> tuple[Table, Table]:
    """Split bounds into those for runs without drawn settings, and those with the prefix "drawn.",
    from which it is removed.
    """
    drawn = {name.removeprefix(DRAWN): b for name, b in bounds.items() if name.startswith(DRAWN)}
    return {name: b for name, b in bounds.items() if not name.startswith(DRAWN)}, drawn


def tracker_of(table: Table) -> str:
    """Return the kind of tracker, such as "kams", that a scenario's table names by tracker.kind;
    the default kind if it names none.
    """
    tracker = table.get(TRACKER, {})
    default = PLUGINS[TRACKER][1]
    return str(tracker.get("kind", default)) if is_table(tracker) else default
