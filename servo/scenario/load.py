"""Scenarios from TOML files, as frozen values; each error names its place."""

import copy
import dataclasses
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from servo.loop.settings import RunConfig, Setup
from servo.mistake import Mistake, unknown
from servo.scenario import arguments, keywords, toml
from servo.scenario.calibration import calibrated
from servo.scenario.catalogue import LISTS, PLUGINS
from servo.scenario.draws import AS_WRITTEN, Draw, draws_of, flat
from servo.scenario.expected import SUCCESS_RATE, Expected, tracker_of
from servo.scenario.fill import WrongSetting, fill, fill_plugin
from servo.scenario.keywords import Change
from servo.scenario.named_files import read
from servo.scenario.tables import KEYS, SECTIONS, SETTABLE, TABLES, config_of, section_of
from servo.scenario.toml import Table, put, with_settings
from sim import kinds
from sim.installed import Trusted
from sim.timing import Rates

NO_PARTS: Mapping[str, Any] = {}
MOST_FRAMES = 360_000
"""An hour at 100 Hz: with 6 kB a frame, kept to the end, 2 GB."""


@dataclass(frozen=True, slots=True)
class Scenario(Setup):
    """A setup that was read from a file, and its bounds."""

    table: Table = field(repr=False)
    """The TOML table it was parsed from, overrides and the camera's calibration included."""
    expect: dict[str, float | str]
    """Bounds on measures by name, and `outcome`, that its tracker has to keep with this seed."""
    bounds: Expected
    """The bounds of all trackers."""
    drawn: Table = field(default_factory=dict)
    """The settings that were drawn for this seed, and their values."""
    success_rate: float | None = None
    """The share of drawn seeds that have to end as expected; None: each of them."""

    @property
    def unjudged(self) -> str:
        """Return a sentence if the bounds are made for another tracker; else an empty text."""
        return self.bounds.unjudged(kinds.kind_of(self.tracker)) if not self.expect else ""

    @property
    def rates_changed(self) -> dict[str, float]:
        """Return the rates [Hz] that differ from those asked for, by setting."""
        asked = self.world.physics_rate, self.world.drive_rate, self.camera.rate
        return Rates.of(*asked).changed(*asked)

    def settings(self) -> Table:
        """Return every value the run uses, the defaults included."""
        plain = {name: dataclasses.asdict(getattr(self, name)) for name in SECTIONS}
        chosen = {name: _described(getattr(self, name)) for name in PLUGINS}
        listed = {name: [_described(item) for item in getattr(self, name)] for name in LISTS}
        return plain | chosen | listed


def _described(config: Any) -> Table:
    """Return the kind of a `Config` and its settings."""
    value: Any = config
    settings = dataclasses.asdict(config) if dataclasses.is_dataclass(value) else vars(config)
    # The kind comes first, and is the part's own even if it has a field of this name.
    return {"kind": ""} | settings | {"kind": kinds.kind_of(config)}


def load(
    name: str | Path, overrides: Sequence[str] = (), seed: int | None = None, **settings: Any
) -> Scenario:
    """Return a scenario by its shipped name or by the path of a TOML file.

    >>> load("still", ["run.duration=2"], gain=1.5).frames
    60

    Args:
        name: Such as "reversal" or "mine/slow.toml".
        overrides: Such as "tracker.kind=frozen" (the command line's --set); the last one of a key
            holds.
        seed: Replaces run.seed.
        **settings: More changes: gain=1.5, tracker="kams", camera={"noise": 3.0}. Also parts of
            one's own, such as tracker=MyTracker: an instance of a `Config`, or a class of one; of a
            tracker also a class or an object that `tracking.wrap` takes. Overrides and other
            keywords reach the settings of such a part.

    Raises:
        Mistake: The user's mistake, in one sentence.
    """
    name = arguments.name(name, "scenario")
    own = keywords.own_parts(settings)
    changes = [
        Change(f"{key}.kind", Trusted(kinds.kind_of(config)), key) for key, config in own.items()
    ]
    changes += keywords.of_texts(overrides)
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


SAME_TIME = {"run.latency": "run.latency_ms", "run.latency_ms": "run.latency"}
"""Settings that take each other's place."""


def _changed(file: Table, changes: Sequence[Change]) -> Table:
    """Return a copy of a scenario's table with changes."""
    table = copy.deepcopy(file)
    for change in changes:
        if change.key in SAME_TIME:  # the file may have it in the other unit
            toml.drop(table, SAME_TIME[change.key])
    for change in changes:
        toml.check({change.key: change.value}, change.place)
        put(table, *change)
    return table


def _names_of_settings(table: Table, own: Mapping[str, Any]) -> list[str]:
    """Return the names of all settings of a scenario, such as "start.x".

    Args:
        table: The scenario's table, not checked yet: a table whose kind is wrong has no names.
        own: Parts that are given from Python, by table.
    """
    found = list[str]()
    for section in (*SECTIONS, *PLUGINS):
        given = table.get(section)
        kind = given.get("kind") if isinstance(given, dict) else None
        kind = kind if isinstance(kind, str) else None
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
    own: Mapping[str, Any] = NO_PARTS,
) -> Scenario:
    """Return the scenario of a TOML table.

    Args:
        table: With all changes.
        name: Of the scenario.
        place: Its file, for messages.
        written: The table as it stands in its file, whose tracker the bounds are made for.
        changes: The changes, in their order: messages name the one that set a wrong value.
        own: Parts that are given from Python, by table; it names their kinds.

    Raises:
        Mistake: The user's mistake, in one sentence.
    """
    toml.check(table, place)

    def where(*settings: str) -> str:
        return keywords.place_of(changes, place, *settings)

    for key in table:
        if key not in KEYS:
            raise Mistake(f"{where(key)}: {unknown(key, KEYS)}")
    if not isinstance(table.get("sweep", {}), dict):
        raise Mistake(f"{where('sweep')}: sweep should be a table, not {table['sweep']!r}")
    if "camera" in table:
        table = table | {"camera": calibrated(table["camera"], f"{where('camera')}: camera")}
    if written is not None:  # a change replaces a draw: a wrong one in the file would go unseen
        draws_of(written.get("vary", {}), f"{place}: vary")
    draws = draws_of(table.get("vary", {}), f"{where('vary')}: vary")
    fixed = {key: value for key, value in table.items() if key != "vary"}
    try:
        values = {key: _filled(key, fixed, own) for key in TABLES}
        drawn = _drawn(draws, fixed, values["run"].seed, own)
        if drawn:
            fixed = with_settings(fixed, drawn, place)
            changed = {section_of(key) for key in drawn}
            values |= {key: _filled(key, fixed, own) for key in changed}
        _check_latency(fixed.get("run", {}))
    except WrongSetting as error:
        # What a calibration gives is wrong where the calibration is named.
        named = ("camera.calibration",) if section_of(error.setting) == "camera" else ()
        sentence = f"{where(error.setting, *named)}: {error}"
        raise Mistake(sentence) from error.__cause__
    _check_drawn(table if written is None else written, where("expect"))
    bounds = Expected.read(table, table if written is None else written, where("expect"))
    _check_frames(values["run"], values["camera"].rate, where("run.duration", "camera.rate"))
    kind = tracker_of(table)
    if kind != bounds.own:
        made = {f"expect.{name}": bound for name, bound in bounds.made_for(kind).items()}
        table = with_settings(table | {"expect": {}}, made, place)
    expect = bounds.of(kind, drawn=bool(drawn))
    rate = expect.pop(SUCCESS_RATE, None)
    return Scenario(
        name=name,
        table=table,
        expect=expect,
        bounds=bounds,
        drawn=drawn,
        success_rate=rate,
        **values,
    )


def _check_drawn(file: Table, place: str) -> None:
    """Refuse bounds of drawn seeds in a file without draws.

    Raises:
        Mistake: The file has such bounds.
    """
    expect = file.get("expect", {})
    if isinstance(expect, dict) and expect.get("drawn") and not file.get("vary"):
        raise Mistake(f"{place}: expect.drawn is for seeds that draw, and there is no [vary]")


def _filled(key: str, table: Table, own: Mapping[str, Any]) -> Any:
    """Return the value of one of a scenario's tables.

    Raises:
        WrongSetting: Something in it is wrong.
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


def _drawn(draws: Sequence[Draw], table: Table, seed: int, own: Mapping[str, Any]) -> Table:
    """Return the settings that a seed draws; each end of a law must be valid.

    Raises:
        WrongSetting: A drawn setting is unknown, or an end of its law is out of range.
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


def _check_latency(run: Table) -> None:
    """Refuse a latency that is written in frames and in milliseconds."""
    if "latency" in run and run.get("latency_ms") is not None:
        sentence = "run: latency_ms takes the place of latency; leave latency out"
        raise WrongSetting(sentence, "run.latency")


def _check_frames(run: RunConfig, rate: float, place: str) -> None:
    """Refuse a run whose steps would not fit into memory, which are kept until its end.

    Raises:
        Mistake: It has too many frames at this rate [Hz].
    """
    frames = run.duration * rate
    if frames > MOST_FRAMES:
        raise Mistake(
            f"{place}: run.duration = {run.duration:g} s at camera.rate = {rate:g} Hz is "
            f"{frames:,.0f} frames; the limit is {MOST_FRAMES:,}"
        )
