"""A study from a TOML file or from the [sweep] table of a scenario; every message about a mistake
names its place.
"""

import itertools
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Annotated

from annotated_types import Ge, Le, MinLen
from pydantic import BaseModel

from servo.loop.measure import MEASURES
from servo.mistake import Mistake, check_known
from servo.scenario.catalogue import sentence, shipped
from servo.scenario.draws import Value
from servo.scenario.expected import SUCCESS_RATE
from servo.scenario.fill import STRICT, validated
from servo.scenario.load import parse as parse_scenario
from servo.scenario.named_files import digests, found_beside, named_in, path_of, read
from servo.scenario.toml import Table, assignment
from servo.study.axes import (
    ENDS,
    MOST_VALUES,
    Axis,
    Named,
    axes_of,
    check_apart,
    check_key,
    flat,
    named_of,
)
from servo.study.bounds import check_expect
from servo.study.plan import Study
from servo.study.scenario_run import StudiedScenario

ALL = "*"
MOST_RUNS = 1_000_000
"""Most runs of a study."""
MOST_CHECKED = 2000
"""Most cells that are parsed before any is run, so that a wrong setting is found at once."""
TRACKERS = "trackers"
"""Axis of the trackers that a command gives."""
COUNTABLE = 10**15
"""Larger numbers of runs are not written out."""
Seed = Annotated[int, Ge(0)]


SEEDS = 3
"""Number of seeds of a study that names none."""


class StudyTable(BaseModel):
    """The keys of a study's file."""

    model_config = STRICT
    scenario: str | Annotated[list[str], MinLen(1)]
    """A scenario, several, or "*" for all that are shipped."""
    set: Table = {}
    """Settings of all runs."""
    named: dict[str, Annotated[dict[str, Table], MinLen(1)]] = {}
    """Groups of settings by the name of their axis and their own."""
    axes: Table = {}
    seeds: Annotated[int, Ge(1), Le(MOST_RUNS)] | Annotated[list[Seed], MinLen(1)] = SEEDS
    """How many seeds from 0 on, or a list of them."""
    compare: str | None = None
    """The axis whose values are compared."""
    expect: dict[str, float] = {}
    """Bounds that every cell must keep."""


def load(
    name: str,
    changes: Sequence[str] = (),
    seeds: int | None = None,
    trackers: dict[str, dict[str, Value]] | None = None,
) -> Study:
    """A study by its shipped name or by the path of a TOML file.

    Args:
        name: Of the study.
        changes: Settings of all runs, as for --set.
        seeds: Replaces the seeds of the file by 0, 1, ... up to this number.
        trackers: Settings of trackers by their names, which replace the axis `tracker.kind`.

    Raises:
        Mistake: The user's mistake, in one sentence.
    """
    path = path_of(name, "study")
    table, place = read(str(path))
    if "sweep" in table:
        if not isinstance(table["sweep"], dict):
            raise Mistake(f"{place}: sweep should be a table, not {table['sweep']!r}")
        table = {"scenario": str(path)} | table["sweep"]
    if seeds is not None:
        if seeds > MOST_RUNS:
            raise Mistake(f"--seeds {seeds}: the limit is {MOST_RUNS:,}")
        table["seeds"] = seeds
    if trackers is not None:
        table = table | {"axes": {}, "named": {TRACKERS: trackers}, "compare": TRACKERS}
    title = sentence(path.read_text(encoding="utf-8-sig"))
    return parsed(table, changes, path, place, title)


def parsed(table: Table, changes: Sequence[str], path: Path, place: str, title: str) -> Study:
    """Return the study of a table with the keys of `StudyTable`.

    Args:
        table: As in a TOML file.
        changes: Settings of all runs, as for --set.
        path: The file, or the one in which the table would be: files beside it count as named
            from there, and its stem is the study's name.
        place: Names the table in messages.
        title: The study's sentence.

    Raises:
        Mistake: The user's mistake, in one sentence.
    """
    bases = _bases(validated(StudyTable, table, f"{place}: ").scenario, path, place)
    table = found_beside(table, path.parent, *(base.table for base in bases))
    file = validated(StudyTable, table, f"{place}: ")
    named = named_of(file.named, place)
    changed = _changed(file, named, changes, place)
    if changes:
        table["set"] = changed
    axes, draws = axes_of(file.axes, place)
    groups = tuple(Axis(key, tuple(groups)) for key, groups in named.items())
    files = digests(named_in(table, *(base.table for base in bases)))
    bases = tuple(
        replace(base, study=path.name, changes=changed, named=named, files=files) for base in bases
    )
    study = Study(
        name=path.stem,
        title=title,
        table=table,
        bases=bases,
        files=files,
        axes=(*groups, *axes),
        draws=draws,
        seeds=_seeds(file.seeds, place),
        compare=None,
        expect=_expect(file.expect, place),
    )
    if study.size > MOST_RUNS:
        runs = f"{study.size:,}" if study.size < COUNTABLE else f"more than {COUNTABLE:.0e}"
        raise Mistake(f"{place}: this makes {runs} runs; the limit is {MOST_RUNS:,}")
    study = _compared(study, file.compare, place)
    _check(study, place)
    return study


def _changed(file: StudyTable, named: Named, changes: Sequence[str], place: str) -> Table:
    """Return the settings of all runs by key: those of the file's [set], and the command line's.

    Raises:
        Mistake: A setting is varied as well, or cannot be set for all runs.
    """
    changed = flat(file.set, f"{place}: set")
    places = {key: f"set.{key}" for key in changed}
    for item in changes:
        own = flat(dict([assignment(item)]), f"--set {item}")
        changed |= own
        places |= dict.fromkeys(own, f"--set {item}")
    for key, at in places.items():
        if key.split(".")[0] != "expect":
            check_key(key, f"{place}: {at}")
    axes = flat(file.axes, f"{place}: axes", ENDS)
    check_apart(places | {key: f"axes.{key}" for key in axes}, place)
    varied = [(key, f"axes.{key}") for key in axes]
    for name, groups in named.items():
        varied += [(key, f"named.{name}") for key in dict.fromkeys(chain(*groups.values()))]
    for key, at in varied:
        if key in places:
            raise Mistake(f"{place}: {places[key]}: {at} varies this setting already")
        places[key] = at
    return changed


def _compared(study: Study, asked: str | None, place: str) -> Study:
    """Return a study with the axis that is compared; by default tracker.kind."""
    keys = study.keys
    if asked is None:
        return replace(study, compare="tracker.kind" if "tracker.kind" in keys else None)
    if asked in [draw.key for draw in study.draws]:
        raise Mistake(f"{place}: compare = {asked!r}: this is drawn; compare the values of an axis")
    if not keys:
        raise Mistake(f"{place}: compare = {asked!r}: this should be the name of an axis")
    check_known([asked], keys, f"{place}: compare", "axis")
    return replace(study, compare=asked)


def _check(study: Study, place: str) -> None:
    """Parse the first MOST_VALUES samples and the first MOST_CHECKED cells, so that a wrong setting
    is reported before hours of running.
    """
    cells = itertools.islice(replace(study, seeds=study.seeds[:1]).jobs(), MOST_CHECKED)
    for job in itertools.chain(itertools.islice(study.samples(), MOST_VALUES), cells):
        base = job.subject
        assert isinstance(base, StudiedScenario)
        # Mistakes of this table name their place already.
        table = base.table_of(job.seed, job.settings)
        try:
            check_expect(parse_scenario(table, base.name, base.place, base.table))
        except Mistake as error:
            _check_base(base, place)
            settings = base.changes | job.settings
            where = ", ".join(f"{key} = {value}" for key, value in settings.items())
            raise Mistake(
                f"{place}: where {where}: {error}" if where else f"{place}: {error}"
            ) from None


def _check_base(base: StudiedScenario, place: str) -> None:
    """Refuse a scenario that is wrong even without the study's changes."""
    try:
        check_expect(parse_scenario(base.table, base.name, base.place))
    except Mistake as error:
        raise Mistake(str(error) if base.place == place else f"{place}: {error}") from None


def _bases(given: str | list[str], path: Path, place: str) -> tuple[StudiedScenario, ...]:
    """Return the scenarios of a study, each file once."""
    names = shipped() if given == ALL else [given] if isinstance(given, str) else given
    bases: dict[Path, StudiedScenario] = {}
    for name in names:
        beside = path.parent / name
        at = str(beside) if name.endswith(".toml") and beside.is_file() else name
        try:
            base = StudiedScenario(at, *read(at))
            file = path_of(at).resolve()
        except Mistake as error:
            raise Mistake(f"{place}: scenario: {error}") from None
        if file in bases:
            raise Mistake(f"{place}: scenario: '{at}' and '{bases[file].name}' are the same file")
        bases[file] = base
    return tuple(bases.values())


def _seeds(given: int | list[int], place: str) -> tuple[int, ...]:
    """Return the seeds of a study, which are counted or listed."""
    seeds = list(range(given)) if isinstance(given, int) else given
    if len(set(seeds)) < len(seeds):
        raise Mistake(f"{place}: seeds has the same value twice")
    return tuple(seeds)


def _expect(bounds: dict[str, float], place: str) -> dict[str, float]:
    """Return bounds on measures and on the share of runs that succeed."""
    check_known(bounds, (SUCCESS_RATE, *MEASURES), f"{place}: expect")
    if not 0 <= bounds.get(SUCCESS_RATE, 1.0) <= 1:
        raise Mistake(f"{place}: expect.{SUCCESS_RATE} should be a share from 0 to 1")
    return bounds
