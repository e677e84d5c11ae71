"""Loading of scenarios from TOML files as frozen values; each error names the file or option."""

import dataclasses
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from servo.loop.settings import Setup
from servo.mistake import Mistake, check_rules, unknown
from servo.scenario import arguments, keywords, toml
from servo.scenario.calibration import calibrated
from servo.scenario.catalogue import LISTS, PLUGINS
from servo.scenario.draws import AS_WRITTEN, Draw, draws_of, flat
from servo.scenario.expected import SUCCESS_RATE, Expected, tracker_of
from servo.scenario.fill import WrongSetting, fill, fill_plugin
from servo.scenario.keywords import Change
from servo.scenario.named_files import read
from servo.scenario.recording import SECTION, recorded_parts, with_recording
from servo.scenario.tables import KEYS, SECTIONS, SETTABLE, TABLES, config_of, section_of
from servo.scenario.toml import Table, copied, is_table, put, with_settings
from sim import kinds
from sim.installed import Trusted
from sim.timing import Rates

NO_PARTS: Mapping[str, object] = {}
MOST_FRAMES = 360_000
"""Most frames of a run, as in an hour at 100 Hz: with 6 kB a frame, kept to the end, 2 GB."""


@dataclass(frozen=True, slots=True)
class Scenario(Setup):
    """A scenario that has been loaded: all settings of a run, the TOML table that they come from,
    the values drawn for the seed, and the upper bounds that the run's measures should keep.
    """

    table: Table = field(repr=False)
    """The scenario's TOML table, with all changes and the settings of the calibration file."""
    expect: dict[str, float | str]
    """Upper bounds on measures by name, and the expected `outcome`, for its tracker and seed."""
    bounds: Expected
    """The bounds for all trackers."""
    drawn: Table = field(default_factory=dict)
    """The settings that were drawn for this seed, and their values."""
    success_rate: float | None = None
    """Least share of drawn seeds that end as expected; None: all of them, or this run has no drawn
    settings."""

    @property
    def unjudged(self) -> str:
        """A sentence that says that a run has no verdict, if the scenario has bounds only for other
        trackers; else "".
        """
        return self.bounds.unjudged(kinds.kind_of(self.tracker)) if not self.expect else ""

    @property
    def rates_changed(self) -> dict[str, float]:
        """Rates of physics and drives that a run uses [Hz] where they differ from the settings,
        because a frame must have a whole number of physics steps; by name of the setting, such as
        "world.physics_rate".
        """
        asked = self.world.physics_rate, self.world.drive_rate, self.camera.rate
        return Rates.of(*asked).changed(*asked)

    def settings(self) -> Table:
        """Return all settings of the run, defaults included: a table for each section, and for
        `disturbances` a list of tables.
        """
        found: Table = {name: dataclasses.asdict(getattr(self, name)) for name in SECTIONS}
        found |= {name: _described(getattr(self, name)) for name in PLUGINS}
        found |= {name: [_described(item) for item in getattr(self, name)] for name in LISTS}
        return found


def _described(config: object) -> Table:
    """Return the settings of a component's `Config`, a dataclass or not, with its `kind` first."""
    if dataclasses.is_dataclass(config) and not isinstance(config, type):
        settings: Table = dataclasses.asdict(config)
    else:
        settings = vars(config)
    # The kind is the component's own even if it has a field of this name.
    return {"kind": ""} | settings | {"kind": kinds.kind_of(config)}


def load(
    name: str | Path, overrides: Sequence[str] = (), seed: int | None = None, **settings: object
) -> Scenario:
    """Load a scenario, a shipped one by its name or one from a TOML file, with changes of its
    settings.

    >>> load("still", ["run.duration=2"], gain=1.5).frames
    60

    Args:
        name: Name or path, such as "reversal" or "mine/slow.toml".
        overrides: Changes of settings, such as "tracker.kind=frozen", as for --set of the command
            line; of several changes of one setting the last one counts.
        seed: Replaces run.seed; None: it stays.
        **settings: More changes, such as gain=1.5, tracker="kams" or camera={"noise": 3.0}; also a
            component of yours, such as tracker=MyTracker: a `Config` (instance or class), a tracker
            that `tracking.wrap` accepts, or another object, class or function that needs no
            `Config`, such as motion=MyMotion with a method `at`. Its settings can be changed in the
            same call.

    Raises:
        Mistake: The file cannot be read, or a setting, a component or a bound is wrong; in one
            sentence.
    """
    name = arguments.name(name, "scenario")
    own = keywords.own_parts(settings)
    changes = [
        Change(f"{key}.kind", Trusted(kinds.kind_of(config)), key) for key, config in own.items()
    ]
    texts = arguments.texts(overrides)
    changes += [Change(*toml.assignment(text), f"--set {text}") for text in texts]
    if seed is not None:
        changes.append(Change("run.seed", toml.plain(seed), f"--seed {seed}"))
    parts = {key: settings[key] for key in settings if key in PLUGINS and key not in own}
    others = {key: value for key, value in settings.items() if key not in PLUGINS}
    changes += keywords.of_keywords(parts, SETTABLE)
    file, place = read(name)
    if others:  # the kinds are known now, and so is every setting's name
        known = _names_of_settings(_changed(file, changes), own)
        changes += keywords.of_keywords(others, SETTABLE, known)
    return parse(_changed(file, changes), Path(name).stem, place, file, changes, own)


def _changed(file: Table, changes: Sequence[Change]) -> Table:
    """Return a copy of a scenario's table, as read from its file, with changes.

    Raises:
        Mistake: A value is one that `toml.check` refuses, or the path of a setting is one that
            `toml.put` refuses.
    """
    table = copied(file)
    for change in changes:
        if change.key in toml.SAME_TIME:
            toml.drop(table, toml.SAME_TIME[change.key])
    # A new kind clears the other settings of its table, so those that change too come after it.
    for change in sorted(
        changes, key=lambda change: change.key.removesuffix(".kind") not in PLUGINS
    ):
        toml.check({change.key: change.value}, change.place)
        put(table, *change)
    return table


def _names_of_settings(table: Table, own: Mapping[str, object]) -> list[str]:
    """Return the names of all settings of a scenario, such as "start.x".

    Args:
        table: The scenario's table, not checked yet; settings of an unknown kind are left out.
        own: Components that are given as objects of Python, by table.
    """
    found = list[str]()
    for section in (*SECTIONS, *PLUGINS):
        given = table.get(section)
        kind = str(given.get("kind", "")) if is_table(given) else ""
        part = own.get(section)
        is_own = part is not None and kind == kinds.kind_of(part)
        config = type(part) if is_own else config_of(section, kind)
        if config is None:
            continue
        with suppress(Exception):  # code of others; parsing reports it
            found += flat({section: _described(config())}, section)
    return found


def parse(
    table: Table,
    name: str,
    place: str,
    written: Table | None = None,
    changes: Sequence[Change] = (),
    own: Mapping[str, object] = NO_PARTS,
) -> Scenario:
    """Check a scenario's TOML table, draw the settings of its table [vary] for its seed, and return
    the scenario.

    Args:
        table: The table, with all changes.
        name: The scenario's name.
        place: The scenario's file, for messages.
        written: The table without changes, for whose tracker the bounds in [expect] are made; None:
            the same table.
        changes: The changes that are already in `table`, in their order; messages name the one that
            set a wrong value.
        own: Settings (`Config`) of components that are given as objects of Python, by table.

    Raises:
        Mistake: A table, a setting or a bound is wrong.
    """
    toml.check(table, place)

    def where(*settings: str) -> str:
        return keywords.place_of(changes, place, *settings)

    for key in table:
        if key not in KEYS:
            raise Mistake(f"{where(key)}: {unknown(key, KEYS)}")
    if "camera" in table:
        table = table | {"camera": calibrated(table["camera"], f"{where('camera')}: camera")}
    if written is not None:  # a change replaces a draw: a wrong one in the file would go unseen
        draws_of(written.get("vary", {}), f"{place}: vary")
    draws = draws_of(table.get("vary", {}), f"{where('vary')}: vary")
    written_out = {key: value for key, value in table.items() if key != "vary"}
    is_recorded = SECTION in table
    try:
        fixed = with_recording(written_out, where(SECTION))
        values = {key: _filled(key, fixed, own) for key in TABLES}
        drawn = _drawn(draws, fixed, values["run"].seed, own)
        if drawn:
            fixed = with_recording(with_settings(written_out, drawn, place), where(SECTION))
            changed = TABLES if is_recorded else {section_of(key) for key in drawn}
            values |= {key: _filled(key, fixed, own) for key in changed}
        values |= recorded_parts(values[SECTION])
        run: Any = fixed.get("run", {})
        if "latency" in run and run.get("latency_ms") is not None:
            sentence = "run: latency and latency_ms give the same delay; leave one of them out"
            raise WrongSetting(sentence, "run.latency")
    except WrongSetting as error:
        # The settings of a calibration file have the place of the option that names the file.
        named = ("camera.calibration",) if section_of(error.setting) == "camera" else ()
        sentence = f"{where(error.setting, *named)}: {error}"
        raise Mistake(sentence) from error.__cause__
    file = table if written is None else written
    bounds = Expected.read(table, file, where("expect"))
    duration = values["run"].duration
    rate = values["camera"].rate
    expect = file.get("expect")
    sweep = table.get("sweep", {})
    check_rules(
        (not is_table(sweep), f"{where('sweep')}: sweep should be a table, not {sweep!r}"),
        (
            is_table(expect) and bool(expect.get("drawn")) and "vary" not in file,
            f"{where('expect')}: expect.drawn is for runs with drawn settings, and no table [vary] "
            "draws any: add [vary], or leave expect.drawn out",
        ),
        (
            duration * rate > MOST_FRAMES,
            f"{where('run.duration', 'camera.rate')}: run.duration = {duration:g} s at "
            f"camera.rate = {rate:g} Hz is {duration * rate:,.0f} frames; the limit is "
            f"{MOST_FRAMES:,}: shorten the run, or lower the rate",
        ),
    )
    kind = tracker_of(table)
    if kind != bounds.own:
        made = {f"expect.{name}": bound for name, bound in bounds.made_for(kind).items()}
        table = with_settings(table | {"expect": {}}, made, place)
    kept: dict[str, Any] = bounds.of(kind, drawn=bool(drawn))
    return Scenario(
        name=name,
        table=table,
        success_rate=kept.pop(SUCCESS_RATE, None),
        expect=kept,
        bounds=bounds,
        drawn=drawn,
        **values,
    )


def _filled(key: str, table: Table, own: Mapping[str, object]) -> Any:
    """Return the dataclass of the settings in a table of a scenario; of a list of tables, a tuple.

    Args:
        key: Name of the table, such as "camera".
        table: The scenario's table.
        own: Components that are given as objects of Python, by table.

    Raises:
        WrongSetting: A setting in the table is unknown or has a wrong value.
    """
    if key in SECTIONS:
        return fill(SECTIONS[key], table.get(key, {}), key)
    if key in PLUGINS:
        kinds_of_part, default = PLUGINS[key]
        return fill_plugin(kinds_of_part, table.get(key, {}), key, default, own.get(key))
    items = table.get(key, [])
    if not isinstance(items, list):
        raise WrongSetting(f"{key} should be a list of tables, not {items!r}", key)
    return tuple(fill_plugin(LISTS[key], item, f"{key}[{i}]") for i, item in enumerate(items))


def _drawn(draws: Sequence[Draw], table: Table, seed: int, own: Mapping[str, object]) -> Table:
    """Check the values `Draw.ends` of each distribution, and return the values of the settings that
    are drawn for a seed, by setting.

    Args:
        draws: Settings and their distributions.
        table: The scenario's table.
        seed: The seed; `AS_WRITTEN` draws no settings.
        own: Components that are given as objects of Python, by table.

    Raises:
        WrongSetting: A setting is unknown, or one of the checked values has a wrong type or is out
            of range.
    """
    for draw in draws:
        at = f"vary.{draw.key}"
        section = section_of(draw.key)
        if section not in TABLES:
            raise WrongSetting(f"{at}: {unknown(section, KEYS)}", at)
        for end in draw.ends:
            try:
                _filled(section, with_settings(table, {draw.key: end}, at), own)
            except WrongSetting as error:
                raise WrongSetting(f"{at}: {error}", at) from error.__cause__
    return {} if seed == AS_WRITTEN else {draw.key: draw.value(seed) for draw in draws}
