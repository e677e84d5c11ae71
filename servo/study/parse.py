"""A study from a TOML file or from the [sweep] table of a scenario; every message about a mistake
names its place.
"""

import itertools
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from servo.loop.measure import MEASURES
from servo.mistake import Mistake, check_known
from servo.scenario.catalogue import sentence, shipped
from servo.scenario.draws import Value
from servo.scenario.expected import SUCCESS_RATE
from servo.scenario.load import parse as parse_scenario
from servo.scenario.named_files import digests, found_beside, named_in, path_of, read
from servo.scenario.toml import assignment, is_number
from servo.study.axes import (
    ENDS,
    MOST_VALUES,
    Axis,
    axes_of,
    check_apart,
    check_key,
    flat,
    named_of,
)
from servo.study.bounds import check_expect
from servo.study.plan import Study
from servo.study.scenario_run import StudiedScenario

KEYS = ("scenario", "set", "named", "axes", "seeds", "compare", "expect")
ALL = "*"
SEEDS = 3
MOST_RUNS = 1_000_000
MOST_CHECKED = 2000
"""Default number of seeds; most runs; and most cells that are parsed before any is run,
so that a wrong setting is found at once."""
TRACKERS = "trackers"
"""Axis of the trackers that a command gives."""
COUNTABLE = 10**15
"""Larger numbers of runs are not written out."""


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
        table = {"scenario": str(path)} | _table(table["sweep"], f"{place}: sweep")
    check_known(table, KEYS, place)
    if seeds is not None:
        if seeds > MOST_RUNS:
            raise Mistake(f"--seeds {seeds}: the limit is {MOST_RUNS:,}")
        table["seeds"] = seeds
    if trackers is not None:
        table = table | {"axes": {}, "named": {TRACKERS: trackers}, "compare": TRACKERS}
    title = sentence(path.read_text(encoding="utf-8-sig"))
    return parsed(table, changes, path, place, title)


def parsed(
    table: dict[str, Any], changes: Sequence[str], path: Path, place: str, title: str
) -> Study:
    """Return the study of a table with the keys `KEYS`.

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
    bases = _bases(table.get("scenario"), path, place)
    table = found_beside(table, path.parent, *(base.table for base in bases))
    changed = _changed(table, changes, place)
    if changes:
        table["set"] = changed
    study = _study(table, changed, bases, path, place, title)
    _check(study, place)
    return study


def _changed(table: dict[str, Any], changes: Sequence[str], place: str) -> dict[str, Any]:
    """Settings of all runs, by key: those of [set] in the file, replaced by the command line's."""
    changed = flat(_table(table.get("set", {}), f"{place}: set"), f"{place}: set")
    places = {key: f"set.{key}" for key in changed}
    for item in changes:
        key, value = assignment(item)
        own = flat({key: value}, f"--set {item}")
        changed |= own
        places |= dict.fromkeys(own, f"--set {item}")
    axes = flat(_table(table.get("axes", {}), f"{place}: axes"), f"{place}: axes", ENDS)
    for key in changed:
        if key.split(".")[0] != "expect":
            check_key(key, f"{place}: {places[key]}")
        if key in axes:
            raise Mistake(f"{place}: {places[key]}: axes.{key} varies this setting already")
    check_apart(places | {key: f"axes.{key}" for key in axes}, place)
    for name, groups in named_of(_table(table.get("named", {}), f"{place}: named"), place).items():
        for key in {key for group in groups.values() for key in group}:
            if key in places or key in axes:
                other = places.get(key, f"axes.{key}")
                raise Mistake(f"{place}: {other}: named.{name} varies this setting already")
    return changed


def _study(
    table: dict[str, Any],
    changed: dict[str, Any],
    bases: tuple[StudiedScenario, ...],
    path: Path,
    place: str,
    title: str,
) -> Study:
    axes, draws = axes_of(_table(table.get("axes", {}), f"{place}: axes"), place)
    named = named_of(_table(table.get("named", {}), f"{place}: named"), place)
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
        seeds=_seeds(table.get("seeds", SEEDS), place),
        compare=None,
        expect=_expect(table.get("expect", {}), place),
    )
    if study.size > MOST_RUNS:
        runs = f"{study.size:,}" if study.size < COUNTABLE else f"more than {COUNTABLE:.0e}"
        raise Mistake(f"{place}: this makes {runs} runs; the limit is {MOST_RUNS:,}")
    return _compared(study, table.get("compare"), place)


def _compared(study: Study, asked: Any, place: str) -> Study:
    """The study with the axis that is compared; by default tracker.kind."""
    keys = study.keys
    if asked is None:
        return replace(study, compare="tracker.kind" if "tracker.kind" in keys else None)
    if asked in [draw.key for draw in study.draws]:
        raise Mistake(f"{place}: compare = {asked!r}: this is drawn; compare the values of an axis")
    if not isinstance(asked, str) or not keys:
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


def _bases(given: Any, path: Path, place: str) -> tuple[StudiedScenario, ...]:
    names: list[Any] = shipped() if given == ALL else given if isinstance(given, list) else [given]
    if not names or not all(isinstance(n, str) for n in names):
        raise Mistake(f'{place}: scenario should name a scenario, several in a list, or "*"')
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


def _seeds(given: Any, place: str) -> tuple[int, ...]:
    if _whole(given) and given > MOST_RUNS:
        raise Mistake(f"{place}: seeds = {given}: the limit is {MOST_RUNS:,}")
    seeds = list(range(given)) if _whole(given) else given
    if not isinstance(seeds, list) or not seeds or not all(_whole(s) for s in seeds):
        raise Mistake(f"{place}: seeds = {given!r}: how many, or a list of whole numbers from 0 on")
    if len(set(seeds)) < len(seeds):
        raise Mistake(f"{place}: seeds has the same value twice")
    return tuple(seeds)


def _expect(given: Any, place: str) -> dict[str, float]:
    bounds = _table(given, f"{place}: expect")
    check_known(bounds, (SUCCESS_RATE, *MEASURES), f"{place}: expect")
    for name, bound in bounds.items():
        if not is_number(bound):
            raise Mistake(f"{place}: expect.{name} = {bound!r}: a bound is a finite number")
        if name == SUCCESS_RATE and not 0 <= bound <= 1:
            raise Mistake(f"{place}: expect.{name} = {bound!r}: a share is from 0 to 1")
    return dict(bounds)


def _table(given: Any, place: str) -> dict[str, Any]:
    if not isinstance(given, dict):
        raise Mistake(f"{place} should be a table, not {given!r}")
    return given


def _whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0
