"""A scenario is a TOML file: parsed once, strictly, into frozen values; every mistake is named with
its place.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from servo.mistake import Mistake, unknown
from servo.scenario import given, keywords, toml
from servo.scenario.calibration import calibrated
from servo.scenario.catalogue import LISTS, PLUGINS
from servo.scenario.draws import AS_WRITTEN, draws_of
from servo.scenario.expected import Expected, tracker_of
from servo.scenario.fill import fill, fill_plugin, fill_plugins
from servo.scenario.keywords import Change
from servo.scenario.sections import (
    GoalConfig,
    MeasureConfig,
    RegionConfig,
    RunConfig,
    StartConfig,
    check_frames,
)
from servo.scenario.source import read
from servo.scenario.toml import put, with_settings
from servo.sight.estimate_to_sight import SightConfig
from sim import kinds
from sim.believed import BelievedConfig
from sim.camera.camera import CameraConfig
from sim.timing import Rates
from sim.world import WorldConfig

Table = dict[str, Any]
SECTIONS: dict[str, type[Any]] = {
    "run": RunConfig,
    "world": WorldConfig,
    "camera": CameraConfig,
    "goal": GoalConfig,
    "start": StartConfig,
    "region": RegionConfig,
    "sight": SightConfig,
    "believed": BelievedConfig,
    "measure": MeasureConfig,
}
MOVED = {("sight", "depth_factor"): "believed.depth_factor"}
"""Keys of earlier files, and where they are now."""
KEYS = (*SECTIONS, *PLUGINS, *LISTS, "vary", "expect", "sweep")


@dataclass(frozen=True, slots=True)
class Scenario:
    """Everything a run depends on."""

    name: str
    table: Table = field(repr=False)
    """The TOML table it was parsed from, overrides and the camera's calibration included."""
    run: RunConfig
    world: WorldConfig
    camera: CameraConfig
    goal: GoalConfig
    start: StartConfig
    region: RegionConfig
    sight: SightConfig
    believed: BelievedConfig
    measure: MeasureConfig
    robot: Any
    target: Any
    motion: Any
    tracker: Any
    features: Any
    estimator: Any
    controller: Any
    disturbances: tuple[Any, ...]
    expect: dict[str, float | str]
    """Bounds on measures by name, and `outcome`, that its tracker has to keep."""
    bounds: Expected
    """The bounds of all trackers."""
    drawn: Table = field(default_factory=dict)
    """The settings that were drawn for this seed, and their values."""

    @property
    def frames(self) -> int:
        """Number of frames of a run."""
        return max(1, round(self.run.duration * self.camera.rate))

    @property
    def unjudged(self) -> str:
        """A sentence where the bounds are made for another tracker; else nothing."""
        return self.bounds.unjudged(kinds.kind_of(self.tracker)) if not self.expect else ""

    @property
    def rates_changed(self) -> dict[str, float]:
        """Rates [Hz] of which the run uses others than those asked for, by setting."""
        asked = self.world.physics_rate, self.world.drive_rate, self.camera.rate
        return Rates.of(*asked).changed(*asked)

    def settings(self) -> Table:
        """Every value the run uses, the defaults included."""
        plain = {name: dataclasses.asdict(getattr(self, name)) for name in SECTIONS}
        chosen = {name: _described(getattr(self, name)) for name in PLUGINS}
        listed = {name: [_described(item) for item in getattr(self, name)] for name in LISTS}
        return plain | chosen | listed


def _described(config: Any) -> Table:
    """The kind of a `Config` and its settings."""
    value: Any = config
    settings = dataclasses.asdict(config) if dataclasses.is_dataclass(value) else vars(config)
    return {"kind": kinds.kind_of(config)} | settings


def load(
    name: str | Path, overrides: Sequence[str] = (), seed: int | None = None, **settings: Any
) -> Scenario:
    """A scenario by its shipped name or by the path of a TOML file.

    Args:
        name: Such as "reversal" or "mine/slow.toml".
        overrides: Such as "tracker.kind=frozen" (the command line's --set); the last one of a key
            holds.
        seed: Replaces run.seed.
        **settings: More changes: gain=1.5, tracker="kams", camera={"noise": 3.0}. Also parts of
            one's own, such as tracker=MyTracker: an instance of a `Config`, or a class of one; of a
            tracker also a class or an object that `tracking.wrap` takes.

    Raises:
        Mistake: The user's mistake, in one sentence.
    """
    name = given.name(name, "scenario")
    all_changes = keywords.of_texts(overrides)
    if seed is not None:
        all_changes.append(Change("run.seed", keywords.plain(seed), f"--seed {seed}"))
    plain = {k: v for k, v in settings.items() if k not in PLUGINS or isinstance(v, str | dict)}
    own = {k: keywords.own_part(k, v) for k, v in settings.items() if k not in plain}
    kind = {k: v for k, v in plain.items() if k in PLUGINS}
    scenario = _loaded(name, all_changes)
    for some in (kind, {k: v for k, v in plain.items() if k not in kind}):
        if some:
            all_changes += keywords.of_keywords(some, scenario.settings())
            scenario = _loaded(name, all_changes)
    if "tracker" in own:
        own["expect"] = scenario.bounds.of(kinds.kind_of(own["tracker"]))
    return dataclasses.replace(scenario, **own) if own else scenario


def _loaded(name: str, changes: Sequence[Change]) -> Scenario:
    table, place = read(name)
    written = copy.deepcopy(table)
    for change in changes:
        put(table, *change)
    try:
        return parse(table, Path(name).stem, place, written)
    except Mistake:
        culprit = _culprit(name, changes)
        if culprit is None:
            raise
        place = culprit
    return parse(table, Path(name).stem, place, written)


def _culprit(name: str, changes: Sequence[Change]) -> str | None:
    """The place of the change from which on a scenario is wrong; None where its file is."""
    table, place = read(name)
    culprit = None
    right = _is_right(table, place)
    for change in changes:
        put(table, *change)
        before = right
        right = _is_right(table, place)
        if before and not right:
            culprit = change.place
    return None if right else culprit


def _is_right(table: Table, place: str) -> bool:
    try:
        parse(table, place, place)
    except Mistake:
        return False
    return True


def parse(table: Table, name: str, place: str, written: Table | None = None) -> Scenario:
    """The scenario of a TOML table; place names it in messages.

    Args:
        table: With all changes.
        name: Of the scenario.
        place: Its file.
        written: The table as it stands in its file, whose tracker the bounds are made for.

    Raises:
        Mistake: The user's mistake, in one sentence.
    """
    toml.check(table, place)
    for key in table:
        if key not in KEYS:
            raise Mistake(f"{place}: {unknown(key, KEYS)}")
    for (section, key), now in MOVED.items():
        if isinstance(table.get(section), dict) and key in table[section]:
            raise Mistake(f"{place}: {section}.{key} is {now} now")
    if "camera" in table:
        table = table | {"camera": calibrated(table["camera"], f"{place}: camera")}
    base = table
    table, drawn = _drawn(table, name, place)
    values: Table = {key: _filled(key, table, place) for key in (*SECTIONS, *PLUGINS, *LISTS)}
    bounds = Expected.read(table, table if written is None else written, place)
    if not isinstance(table.get("sweep", {}), dict):
        raise Mistake(f"{place}: sweep should be a table, not {table['sweep']!r}")
    check_frames(values["run"], values["camera"].rate, place)
    expect = bounds.of(tracker_of(table))
    if tracker_of(table) != bounds.own:
        base = base | {"expect": expect}
    found = {"expect": expect, "bounds": bounds, "drawn": drawn}
    return Scenario(name=name, table=base, **found, **values)


def _filled(key: str, table: Table, place: str) -> Any:
    """The value of one of a scenario's tables."""
    at = f"{place}: {key}"
    if key in SECTIONS:
        return fill(SECTIONS[key], table.get(key, {}), at)
    if key in LISTS:
        return fill_plugins(LISTS[key], table.get(key, []), at)
    return fill_plugin(PLUGINS[key][0], table.get(key, {}), at, PLUGINS[key][1])


def _drawn(table: Table, name: str, place: str) -> tuple[Table, Table]:
    """A table with what its seed draws, and the draws alone; each end of a law must be valid."""
    if "vary" not in table:
        return table, {}
    draws = draws_of(table["vary"], f"{place}: vary")
    fixed = {**table}
    del fixed["vary"]
    parse(fixed, name, place)  # what is wrong without any draw is not the draws' mistake
    for draw in draws:
        at = f"{place}: vary.{draw.key}"
        key = draw.key.partition(".")[0]
        if key not in (*SECTIONS, *PLUGINS, *LISTS):
            raise Mistake(f"{at}: {unknown(key, KEYS)}")
        for end in draw.ends:
            _filled(key, with_settings(fixed, {draw.key: end}, place), at)
    seed = _filled("run", fixed, place).seed
    drawn = {} if seed == AS_WRITTEN else {d.key: d.value(seed) for d in draws}
    return with_settings(fixed, drawn, place), drawn
