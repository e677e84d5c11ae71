"""A public benchmark: frozen conditions, the worlds (random scenarios) drawn from them, and a hash
that tells versions apart.
"""

import copy
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib import resources
from typing import Any, Literal, cast

import numpy as np

from servo.bench.names import NAMES
from servo.mistake import Mistake, check_rules, unknown
from servo.scenario import toml
from servo.scenario.catalogue import sentence
from servo.scenario.draws import flat
from servo.scenario.load import Scenario, parse
from servo.scenario.toml import Table, put
from sim.types import Array
from tracking.files.json_text import as_json

FOLDER = "benchmarks"
HASH_DIGITS = 16
"""Hexadecimal digits of a benchmark's hash: 64 bits of a SHA-256 digest, so that no two versions
have the same ones."""
SEVERITY = "severity"
SEALED_FROM = 1 << 20
SEALED_SEEDS = 1 << 40
"""Sealed seeds lie above all others."""
QUICK = 2
"""Worlds of a condition in a quick run."""
FARTHEST = 2.0
"""The curve of the score goes to this distance from the goal [target sizes]."""
HELD_SIZE = 1.0
HELD_SHARE = 0.95
"""A robot holds its target if the error is at most one target size in at least this share of the
pictures."""
EQUAL_DEPTH = 0.2
EQUAL_DEG = 15.0
"""Errors of the depth, as abs(ln(Z/Z*)), and of the angle that count as one target size."""
ARRIVED_MM = 10.0
ARRIVED_DEG = 1.0
NEAR_MM = 100.0
NEAR_DEG = 10.0
"""Largest distance [mm] and angle [deg] from the goal of an arrival in the wider sense that is used
for learned servoing: a tenth of a path of one metre, and ten degrees."""
Settings = Table
WhatError = Literal["centre", "size", "all"]
OF_CONTESTANTS = {
    "tracker": ("tracker",),
    "law": ("features", "controller"),
    "pictures": ("features", "controller"),
}
"""Tables of a scenario that a contestant sets; the hash does not cover their defaults."""


@dataclass(frozen=True, slots=True)
class Condition:
    """A condition of a benchmark, such as "fast", from which worlds (random scenarios) are drawn:
    the settings, by dotted key, that all of them share, the ranges from which other settings are
    drawn uniformly, and factors, of which each world gets one level, with the settings
    `factors[factor][level]`. `size` is the key of the drawn setting that measures how large the
    task is, or "severity", and `severity` is the range of that number; None: there is none.
    """

    name: str
    settings: Settings
    ranges: dict[str, tuple[float, float]]
    """The two ends of each setting that is drawn uniformly."""
    factors: dict[str, dict[str, Settings]]
    """The settings of a level of a factor: `factors[factor][level]`."""
    size: str | None = None
    """The key in `ranges` whose value measures how large the task is, or "severity"."""
    severity: tuple[float, float] | None = None
    """Range of a severity that is drawn for each world: each drawn setting is moved to this share
    of its distance from its value in `settings`; None: all are as drawn."""


@dataclass(frozen=True, slots=True)
class World:
    """A world of a benchmark: one random scenario. It has the name of its condition and its number
    there, from 0, the seed of its run, its settings by dotted key, its level of each factor (such
    as the kind of ground), and a size of the task (nan: none).
    """

    condition: str
    number: int
    """Place in its condition, from 0."""
    seed: int
    settings: Settings
    """Settings by dotted key, which change the benchmark's scenario."""
    levels: dict[str, str]
    """Name of the world's level, by factor."""
    size: float = float("nan")
    """Size of the task: the value of the condition's setting `size`; nan without one."""

    @property
    def key(self) -> str:
        """Name of the world from its condition and number, such as "fast-03". It is unique within a
        set of worlds ("dev", "v1" or "sealed"); other sets have worlds with the same names.
        """
        return f"{self.condition}-{self.number:02}"


def condition_of(world: str) -> str:
    """Return the name of the condition of a world (random scenario), given the world's name: "fast"
    of "fast-03".
    """
    return world.rpartition("-")[0]


@dataclass(frozen=True, slots=True)
class Band:
    """A set of a benchmark's worlds (random scenarios) with seeds of its own: "dev" to tune on,
    "v1" to publish results on, or "sealed".

    Sealed seeds follow from the benchmark's hash, the contestant's digest and a public value of a
    later date, so that they are unknown while the contestant is written, and can be drawn again
    later.
    """

    name: Literal["dev", "v1", "sealed"] = "dev"
    value: str = ""
    """The public value from which sealed worlds are drawn; "" for public worlds."""
    digest: str = ""
    """The contestant's digest, from which sealed worlds are drawn too; not used for others."""


@dataclass(frozen=True, slots=True)
class Slow:
    """Additional runs of a benchmark, in which the tracker is slowed down: the condition in whose
    worlds (random scenarios) they are made, the setting that slows the tracker, and its values [ms
    for each picture]. The reference contestants "still" and "truth" have no such runs.
    """

    condition: str
    setting: str
    """The setting that slows a tracker."""
    values: tuple[float, ...]
    """Its values [ms a picture]."""


@dataclass(frozen=True)  # without slots, in which no digest could be kept
class Benchmark:
    """A version of a public benchmark of trackers or control laws: conditions, number of worlds
    (random scenarios) in each, seeds, kind of score, settings of the reference contestants, and the
    values, when it was frozen, of all settings but the contestants' own. It is read from the
    benchmark's TOML and JSON files.
    """

    name: str
    title: str
    contestant: Literal["tracker", "law", "pictures"]
    """What takes part: a tracker, a control law, or a law that compares the camera's picture with
    the one at the goal."""
    score: Literal["held", "arrives", "reaches"]
    error: WhatError
    """What the error in each picture covers: the target's centre, its size too, or all of it."""
    watched: int
    """Number of worlds of each condition in which the contestant, a tracker, also gets the pictures
    of a camera that another tracker, `perfect`, steers."""
    worlds: int
    """Number of worlds of each condition."""
    seeds: dict[str, int]
    """First seed of each public set of worlds, "dev" and "v1"."""
    null: Settings
    """Settings of the contestant that fixes 0 on the scale: its camera does not move."""
    perfect: Settings | None
    """Settings of the contestant that fixes 100; None: 100 is the full score in all worlds."""
    conditions: tuple[Condition, ...]
    scenario: Table
    slow: Slow | None
    home: dict[str, Settings]
    """Settings of the shipped control laws, by the contestant's name; empty for trackers."""
    files: tuple[str, ...]
    """Paths in `scenes` of the shipped models and pictures of the worlds, and of the TOML file of
    the benchmark that this one is like."""
    frozen: Settings
    """The value of each setting when the version was frozen, by dotted key; empty for a draft."""
    pinned: Settings
    """Constants of the score, by dotted key, if the hash does not cover them; else empty."""
    rendering: str
    """Digest of the first pictures of the published worlds ("v1"), as `Row.rendering`; "" for a
    draft or without pictures. Rows of other pictures stand in a table of their own."""
    text: str
    """Contents of the benchmark's TOML file."""

    @cached_property
    def hash(self) -> str:
        """First 16 hexadecimal digits of the SHA-256 digest of the benchmark's TOML file, the
        frozen settings, the models and pictures of its scenes, and the published worlds ("v1").
        """
        found = hashlib.sha256(self.text.encode())
        found.update(json.dumps(self.frozen, sort_keys=True).encode())
        for name in self.files:
            found.update((resources.files("scenes") / name).read_bytes())
        for world in self.every_world(Band("v1")):
            found.update(json.dumps([world.key, world.seed, world.settings]).encode())
        return found.hexdigest()[:HASH_DIGITS]

    def settings(self) -> Settings:
        """Return, by dotted key, the present values of all settings of the benchmark's scenario
        (before a condition changes them), defaults included, but for the tables that contestants
        set, and of the constants of the score; `check_frozen` compares them with the frozen ones.
        """
        found = parse(copy.deepcopy(self.scenario), self.name, self.name).settings()
        for part in OF_CONTESTANTS[self.contestant]:
            del found[part]
        return flat(as_json(found), self.name) | _constants(self.score)

    def resolved(self, contestant: Settings) -> Settings:
        """Return, by dotted key, every setting in the tables that contestants set, such as
        [tracker]: its value in `contestant`, or else that of the benchmark's scenario, or else its
        default.

        Args:
            contestant: Settings of the contestant, by dotted key.

        Raises:
            Mistake: A setting of the contestant is wrong.
        """
        world = self.every_world(Band(), 1)[0]
        found = self.scenario_of(world, contestant).settings()
        own = {part: found[part] for part in OF_CONTESTANTS[self.contestant]}
        return flat(as_json(own), self.name)

    def check_frozen(self) -> None:
        """Check that all settings and constants of the score still have the values with which the
        benchmark was frozen. Settings that were added later are not checked.

        Raises:
            Mistake: A value differs.
        """
        now = self.settings()
        check_rules(
            *(
                (
                    now.get(key) != value,
                    f"{self.name}: {key} is {now.get(key)!r} in this version, and was {value!r} "
                    "when the benchmark was frozen, so that new results could not be compared with "
                    "old ones: run it with an earlier version of servobench",
                )
                for key, value in (self.frozen | self.pinned).items()
            )
        )

    def every_world(self, band: Band, count: int | None = None) -> list[World]:
        """Return worlds (random scenarios) of all conditions, condition by condition.

        Args:
            band: The set of worlds, which decides the seeds.
            count: How many worlds of each condition to return, the first ones; None: all worlds of
                each condition.
        """
        return [w for c in self.conditions for w in self.worlds_of(c, band)[:count]]

    def worlds_of(self, condition: Condition, band: Band) -> list[World]:
        """Return all worlds (random scenarios) of a condition, in order of their number, with the
        seeds of a set of worlds (`band`).

        The draws are balanced: each n-th part of a range has the value of one of the n worlds, and
        the levels of a factor occur about equally often (McKay, Beckman and Conover, A comparison
        of three methods for selecting values of input variables, 1979: the Latin hypercube). With a
        severity, the values are then moved by it.
        """
        seeds = self._seeds(condition, band)
        count = len(seeds)
        rng = np.random.default_rng([seeds[0], *condition.name.encode()])
        columns = {key: _spread(rng, count) for key in condition.ranges}
        levels = {name: _spread(rng, count) for name in condition.factors}
        if condition.severity is not None:
            columns[SEVERITY] = _spread(rng, count)
        return [_world(condition, n, seed, columns, levels) for n, seed in enumerate(seeds)]

    def _seeds(self, condition: Condition, band: Band) -> list[int]:
        place = [c.name for c in self.conditions].index(condition.name) * self.worlds
        if band.name != "sealed":
            return [self.seeds[band.name] + place + n for n in range(self.worlds)]
        secret = "/".join((self.hash, band.digest, band.value, condition.name)).encode()
        digests = (hashlib.sha256(secret + b"/%d" % n).digest() for n in range(self.worlds))
        return [SEALED_FROM + int.from_bytes(d[:8], "big") % SEALED_SEEDS for d in digests]

    def table_of(self, world: World, contestant: Settings) -> Table:
        """Return the TOML table of the scenario of a world, with the settings of a contestant.

        Args:
            world: The world.
            contestant: Settings of the contestant by dotted key, which replace those of the world.
        """
        table = copy.deepcopy(self.scenario)
        for settings in (world.settings, contestant):
            for key in sorted(settings, key=lambda key: not key.endswith("kind")):
                put(table, key, copy.deepcopy(settings[key]), self.name)
        put(table, "run.seed", world.seed, self.name)
        return table

    def scenario_of(self, world: World, contestant: Settings) -> Scenario:
        """Return the checked scenario of a world, with the settings of a contestant.

        Args:
            world: The world.
            contestant: Settings of the contestant by dotted key, which replace those of the world.

        Raises:
            Mistake: A setting of the contestant is wrong.
        """
        return parse(self.table_of(world, contestant), world.key, self.name)


def load(name: str) -> Benchmark:
    """Return a public benchmark that is shipped with servobench by its name, such as "loop-v2".

    Raises:
        Mistake: There is no benchmark of this name.
    """
    if name not in NAMES:
        raise Mistake(unknown(name, NAMES, "benchmark"))
    folder = resources.files("scenes") / FOLDER
    frozen: dict[str, Any] = {"settings": {}, "rendering": ""}
    if (folder / f"{name}.json").is_file():
        frozen = json.loads((folder / f"{name}.json").read_text("utf-8"))
    return parsed(name, (folder / f"{name}.toml").read_text("utf-8"), **frozen)


def parsed(
    name: str, text: str, settings: Settings, rendering: str, measures: Settings | None = None
) -> Benchmark:
    """Return the benchmark that the text of a TOML file describes.

    Args:
        name: The benchmark's name.
        text: Contents of the TOML file. If it has the key `like`, the name of another benchmark, it
            consists of the settings that differ from that one's file.
        settings: Value of each setting when the benchmark was frozen, by dotted key; empty for a
            draft.
        rendering: Digest of the first pictures of all published runs ("v1"); "" for a draft, and
            for a benchmark whose runs render no pictures.
        measures: Constants of the score, for loop-v1 and servo-v1 only; all others have these
            constants in `settings`, so that the hash covers them.
    """
    # The file is ours, so its values have the types that a benchmark needs.
    table: dict[str, Any] = toml.decode(text, name)
    if (other := table.pop("like", None)) is not None:
        base = (resources.files("scenes") / FOLDER / f"{other}.toml").read_text("utf-8")
        table = toml.merged(toml.decode(base, other), table)
        table["files"].append(f"{FOLDER}/{other}.toml")  # so that the hash covers it
    common = flat(table["ranges"], name)
    conditions = [
        Condition(
            key,
            flat(given.get("set", {}), name),
            {
                key: (ends[0], ends[1])
                for key, ends in cast(
                    dict[str, list[float]], common | flat(given.get("ranges", {}), name)
                ).items()
                if ends  # [] takes a common range away
            },
            {
                factor: {level: flat(settings, name) for level, settings in levels.items()}
                for factor, levels in (table["factors"] | given.get("factors", {})).items()
            },
            given.get("size"),
            given.get("severity") and tuple(given["severity"]),
        )
        for key, given in table["conditions"].items()
    ]
    slow = table.get("slow")
    return Benchmark(
        name=name,
        title=sentence(text),
        contestant=table["contestant"],
        score=table["score"],
        error=table.get("error", "centre"),
        watched=table.get("watched", 0),
        worlds=table["worlds"],
        seeds=table["seeds"],
        null=table["null"],
        perfect=table.get("perfect"),
        conditions=tuple(conditions),
        scenario=table["scenario"],
        slow=slow and Slow(slow["condition"], slow["setting"], tuple(slow["values"])),
        home={name: flat(settings, name) for name, settings in table.get("home", {}).items()},
        files=tuple(table["files"]),
        frozen=settings,
        pinned=measures or {},
        rendering=rendering,
        text=text,
    )


def _constants(score: str) -> Settings:
    """Return the constants that a score ("held", "arrives" or "reaches") depends on, by a dotted
    key such as "score.held_share".
    """
    of_scores = {
        "held": {
            "farthest": FARTHEST,
            "held_size": HELD_SIZE,
            "held_share": HELD_SHARE,
            "equal_depth": EQUAL_DEPTH,
            "equal_deg": EQUAL_DEG,
        },
        "arrives": {
            "arrived_mm": ARRIVED_MM,
            "arrived_deg": ARRIVED_DEG,
            "near_mm": NEAR_MM,
            "near_deg": NEAR_DEG,
        },
    }
    of_scores["reaches"] = of_scores["arrives"]
    return {f"score.{name}": value for name, value in of_scores[score].items()}


def _spread(rng: np.random.Generator, count: int) -> Array:
    """Return numbers (count,) from 0 to 1 in random order, one in each of `count` equal parts of
    this range.
    """
    return (rng.permutation(count) + rng.uniform(size=count)) / count


def _world(
    condition: Condition,
    number: int,
    seed: int,
    columns: Mapping[str, Array],
    levels: Mapping[str, Array],
) -> World:
    """Return a world of a condition with the given number. `columns` and `levels` have balanced
    numbers (n,) from 0 to 1 for all n worlds, for each drawn setting and each factor.
    """
    severity = 1.0
    if condition.severity is not None:
        least, most = condition.severity
        severity = round(least + float(columns[SEVERITY][number]) * (most - least), 6)
    drawn: dict[str, float] = {}
    for key, (low, high) in condition.ranges.items():
        value = low + float(columns[key][number]) * (high - low)
        if condition.severity is not None:
            mild = float(str(condition.settings[key]))
            value = mild + severity * (value - mild)
        # A range of whole numbers is one of a number of things.
        whole = isinstance(low, int) and isinstance(high, int)
        drawn[key] = round(value) if whole else round(value, 6)
    chosen = {
        name: list(each)[int(levels[name][number] * len(each))]
        for name, each in condition.factors.items()
    }
    settings = condition.settings | drawn
    for name, level in chosen.items():
        settings |= condition.factors[name][level]
    sizes = drawn | {SEVERITY: severity}
    size = sizes.get(condition.size or "", float("nan"))
    return World(condition.name, number, seed, settings, chosen, size)
