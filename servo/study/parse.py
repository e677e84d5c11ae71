"""Loads studies from TOML files, or from the table [sweep] of a scenario's file."""

import itertools
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Annotated

from annotated_types import Ge, Le, MinLen
from pydantic import BaseModel

from servo.loop.measure import MEASURES
from servo.mistake import Mistake, check_known, check_rules
from servo.scenario.catalogue import sentence, shipped
from servo.scenario.draws import Value, flat
from servo.scenario.expected import SUCCESS_RATE
from servo.scenario.fill import STRICT, validated
from servo.scenario.load import parse as parse_scenario
from servo.scenario.named_files import digests, found_beside, named_in, path_of, read
from servo.scenario.toml import SAME_TIME, Table, assignment, is_table
from servo.study.plan import (
    ALL,
    ENDS,
    MOST_VALUES,
    Axis,
    Study,
    axes_of,
    check_apart,
    check_key,
    named_of,
)
from servo.study.scenario_run import Named, StudiedScenario

MOST_RUNS = 1_000_000
"""Most runs of a study."""
MOST_CHECKED = 2000
"""Most combinations of axis values that are checked before the first run."""
TRACKERS = "trackers"
"""Name of the axis of the trackers that a command line gives."""
SEEDS = 3
"""Number of seeds of a study that does not give them."""


class StudyTable(BaseModel):
    """The keys of a study's TOML file and their types, which pydantic checks: scenarios, settings
    of all runs (`set`), axes and drawn settings (`axes`, `named`), number or list of seeds, the
    compared axis, and bounds on mean measures.
    """

    model_config = STRICT
    scenario: str | Annotated[list[str], MinLen(1)]
    """Name or path of a scenario, a list of several, or "*" for all that are shipped."""
    set: Table = {}
    """Settings of all runs."""
    named: dict[str, Annotated[dict[str, Table], MinLen(1)]] = {}
    """Axes whose values are groups of settings: settings by name of the axis and of the group."""
    axes: Table = {}
    """Axes and drawn settings: values or a distribution by setting."""
    seeds: (
        Annotated[int, Ge(1), Le(MOST_RUNS)] | Annotated[list[Annotated[int, Ge(0)]], MinLen(1)]
    ) = SEEDS
    """Number of seeds, counted from 0, or a list of seeds."""
    compare: str | None = None
    """The axis whose values are compared; None: tracker.kind, if this is an axis."""
    expect: dict[str, float] = {}
    """Upper bounds on the means of measures, and the least success_rate, which hold for each
    combination of axis values."""


def load(
    name: str,
    changes: Sequence[str] = (),
    seeds: int | None = None,
    trackers: dict[str, dict[str, Value]] | None = None,
) -> Study:
    """Load a study that is shipped with servobench, or that is described by a TOML file: a study's
    own, or a scenario's with a table [sweep].

    Args:
        name: Name of a shipped study, or path of a TOML file.
        changes: Settings of all runs, such as "run.duration=5", as for --set.
        seeds: Number of seeds, counted from 0, in place of those in the file; None: the file's.
        trackers: Settings of trackers by label (see `tracker_tables`), which become the only axis
            in place of all axes and drawn settings of the file; None: the file's.

    Raises:
        Mistake: The file, a setting in it or a change is wrong, or there are too many runs.
    """
    path = path_of(name, "study")
    table, place = read(str(path))
    if "sweep" in table:
        sweep = table["sweep"]
        if not is_table(sweep):
            raise Mistake(f"{place}: sweep should be a table, not {sweep!r}")
        table = sweep
        table.setdefault("scenario", str(path))
    if seeds is not None:
        if seeds > MOST_RUNS:
            raise Mistake(f"--seeds {seeds}: give at most {MOST_RUNS:,}")
        table["seeds"] = seeds
    if trackers is not None:
        table |= {"axes": {}, "named": {TRACKERS: trackers}, "compare": TRACKERS}
    title = sentence(path.read_text(encoding="utf-8-sig"))
    return parsed(table, changes, path, place, title)


def parsed(table: Table, changes: Sequence[str], path: Path, place: str, title: str) -> Study:
    """Check the table of a study, whose keys are those of `StudyTable`, and return the study. The
    settings of its runs are checked too: each value of each axis (in at most 10,000 runs), and the
    first 2000 combinations.

    Args:
        table: The table, as read from TOML.
        changes: Settings of all runs, such as "run.duration=5", as for --set.
        path: The study's file, which need not exist: its stem is the study's name, and names of
            files in the table are looked up beside it first.
        place: Name of the file, which begins messages.
        title: A sentence that describes the study.

    Raises:
        Mistake: The table or a change is wrong, or there are more than a million runs.
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
        raise Mistake(
            f"{place}: this study has more runs than the limit, {MOST_RUNS:,}: give fewer values "
            "or seeds"
        )
    study = _compared(study, file.compare, place)
    _check(study, place)
    return study


def _changed(file: StudyTable, named: Named, changes: Sequence[str], place: str) -> Table:
    """Return the settings of all runs by dotted key.

    Args:
        file: The study's table, with settings in [set].
        named: Groups of settings of the study.
        changes: More settings, as for --set, which replace those of the file.
        place: The study's file, which begins messages.

    Raises:
        Mistake: A change is not "key=value", or a setting is also varied by an axis, cannot be set
            for all runs, or is in a table that is set as a whole.
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
        # Two settings of the same time may both be in one axis, in different groups of it.
        other = SAME_TIME.get(key, key)
        same = other if places.get(other, at) != at else key
        if same in places:
            raise Mistake(
                f"{place}: {places[same]}: {at} varies this setting already: leave one of them out"
            )
        places[key] = at
    return changed


def _compared(study: Study, asked: str | None, place: str) -> Study:
    """Return a copy of a study with the axis that is compared.

    Args:
        study: The study.
        asked: Name of the axis; None: tracker.kind if it is an axis, else none.
        place: The study's file, which begins messages.

    Raises:
        Mistake: The study has no axis of this name.
    """
    keys = study.keys
    if asked is None:
        return replace(study, compare="tracker.kind" if "tracker.kind" in keys else None)
    at = f"{place}: compare = {asked!r}"
    check_rules(
        (
            asked in [draw.key for draw in study.draws],
            f"{at}: this setting is drawn at random; name an axis of the study",
        ),
        (not keys, f"{at}: this study has no axis to compare: leave compare out"),
    )
    check_known([asked], keys, f"{place}: compare", "axis")
    return replace(study, compare=asked)


def _check(study: Study, place: str) -> None:
    """Check the settings of the first runs of a study, so that a mistake is found before hours of
    running: each value of each axis (in at most `MOST_VALUES` runs), and the first `MOST_CHECKED`
    combinations.

    Raises:
        Mistake: A setting is wrong; the message begins with `place` and the run's axis values.
    """
    cells = itertools.islice(replace(study, seeds=study.seeds[:1]).jobs(), MOST_CHECKED)
    for job in itertools.chain(itertools.islice(study.samples(), MOST_VALUES), cells):
        base = job.subject
        assert isinstance(base, StudiedScenario)
        # Mistakes of this table name their place already.
        table = base.table_of(job.seed, job.settings)
        try:
            parse_scenario(table, base.name, base.place, base.table)
        except Mistake as error:
            _check_base(base, place)
            settings = base.changes | job.settings
            where = ", ".join(f"{key} = {value}" for key, value in settings.items())
            raise Mistake(
                f"{place}: in the run with {where}: {error}" if where else f"{place}: {error}"
            ) from None


def _check_base(base: StudiedScenario, place: str) -> None:
    """Check a scenario without the study's changes.

    Raises:
        Mistake: A setting of the scenario is wrong; the message begins with the study's `place`.
    """
    try:
        parse_scenario(base.table, base.name, base.place)
    except Mistake as error:
        raise Mistake(str(error) if base.place == place else f"{place}: {error}") from None


def _bases(given: str | list[str], path: Path, place: str) -> tuple[StudiedScenario, ...]:
    """Return the scenarios of a study.

    Args:
        given: Names or paths, or "*" for all shipped scenarios.
        path: The study's file, beside which paths are looked up first.
        place: The study's file as messages name it.

    Raises:
        Mistake: There is no such scenario, its file cannot be read, or one is listed twice.
    """
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
            raise Mistake(
                f"{place}: scenario: '{at}' and '{bases[file].name}' are the same file: leave one "
                "of them out"
            )
        bases[file] = base
    return tuple(bases.values())


def _seeds(given: int | list[int], place: str) -> tuple[int, ...]:
    """Return the seeds of a study from their number, counted from 0, or from a list of them;
    `place` begins messages.

    Raises:
        Mistake: A seed is listed twice.
    """
    seeds = list(range(given)) if isinstance(given, int) else given
    if len(set(seeds)) < len(seeds):
        raise Mistake(f"{place}: the list seeds has the same value twice: leave one out")
    return tuple(seeds)


def _expect(bounds: dict[str, float], place: str) -> dict[str, float]:
    """Check that a study's bounds name known measures and that its success rate is from 0 to 1;
    return the bounds. `place` begins messages.

    Raises:
        Mistake: A name is not known, or the success rate is not from 0 to 1.
    """
    check_known(bounds, (SUCCESS_RATE, *MEASURES), f"{place}: expect")
    if not 0 <= bounds.get(SUCCESS_RATE, 1.0) <= 1:
        raise Mistake(f"{place}: expect.{SUCCESS_RATE} should be a share from 0 to 1")
    return bounds
