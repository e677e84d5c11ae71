"""Finds each tracker's best settings on a grid, on painted (synthetic) sequences with seeds below
1000.

All grids have equal size. `servobench papers tuning-clutter`, `tuning-similarity` and
`tuning-texture` run them; tuning.json has their results.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, partial
from importlib import resources
from typing import ClassVar

from servo.output.formats import Document
from servo.papers.claim import Claim, Effort, Evidence, Rule, Verdict
from servo.papers.experiments import contender, generated, sequence_jobs
from servo.papers.summaries import column, group
from servo.study.run import Job
from servo.study.sequence_run import Contender, Generated
from tracking.statistics.comparisons import Interval
from tracking.statistics.verdicts import Finding
from tracking.trackers import KINDS as TRACKERS

Settings = dict[str, float | str]
NOISES = (0.3, 0.5, 0.8, 1.0, 1.2, 1.5)
"""Grid of the position noise [px], around the published value."""
FACTORS = (0.5, 0.7, 1.0, 1.4, 2.0, 2.8)
"""Grid of factors on all noises of a filter."""
RANDOM_WALK = {"velocity_memory": 1.0}
CONSTANT_VELOCITY = {"velocity_memory": 0.5}


@dataclass(frozen=True, slots=True)
class Family:
    """Painted (synthetic) sequences on which trackers are tuned: their kinds, the number of seeds
    of each kind, and the measure that is optimised (`sign` 1: maximised, -1: minimised).
    """

    entries: tuple[Generated, ...]
    """Kinds of the sequences."""
    seeds: int
    """Number of sequences of each kind."""
    measure: str
    """Name of the measure."""
    sign: int
    """1 if larger values are better, else -1."""


@dataclass(frozen=True, slots=True)
class Tuned:
    """A tracker that is tuned: the name of the sequences on which it is tuned (`family`), its kind,
    the settings that all tries share (`fixed`), and the settings of each try (`grid`).
    """

    family: str
    """Name of the sequences in `FAMILIES`."""
    kind: str
    """Kind of the tracker."""
    fixed: Settings
    """Settings of all tries, beside those of the paper's preset."""
    grid: tuple[Settings, ...]
    """Settings of each try."""

    def contender(self, name: str, settings: Settings, ending: str) -> Contender:
        """Return this tracker with the preset of its paper, changed by its fixed settings and then
        by `settings`; its label in tables is NAME-ENDING.
        """
        return contender(self.kind, "paper", f"{name}-{ending}", **self.fixed | settings)


def _scaled(kind: str) -> tuple[Settings, ...]:
    """Return a grid in which all noises of a kind's defaults are multiplied by each factor."""
    own = TRACKERS.config(kind)
    return tuple(
        {n: round(k * getattr(own, n), 4) for n in ("noise", "turn_noise", "scale_noise")}
        for k in FACTORS
    )


def _over(name: str, values: Sequence[float | str], **others: float | str) -> tuple[Settings, ...]:
    """Return a grid with an entry for each value of the setting `name`, all with the same other
    settings.
    """
    return tuple({name: value, **others} for value in values)


LEVELS = "efgh"
FAMILIES = {
    "clutter": Family(
        tuple(generated("clutter", level=level) for level in LEVELS), 6, "frames_until_loss", 1
    ),
    "similarity": Family((generated("similarity"),), 3, "auc_turned", 1),
    "texture": Family((generated("texture"),), 6, "rmse_px", -1),
}
RESTS = ("discard", "bin")
STILL_OR_MOVING = (RANDOM_WALK, CONSTANT_VELOCITY)
TUNED = {
    "kams": Tuned("clutter", "kams", {"particles": 50}, _over("noise", NOISES)),
    "condensation": Tuned(
        "clutter", "condensation", {"particles": 1200, **RANDOM_WALK}, _over("noise", NOISES)
    ),
    "annealed": Tuned("clutter", "annealed", {"particles": 240}, _over("noise", NOISES)),
    "hybrid": Tuned(
        "clutter", "hybrid", {"particles": 220, **CONSTANT_VELOCITY}, _over("noise", NOISES)
    ),
    "mean_shift": Tuned("clutter", "mean_shift", {}, tuple(
        s for v in STILL_OR_MOVING for s in _over("levels", (4, 8, 16), **v))),
    "sok": Tuned("clutter", "sok", {}, tuple(
        s for v in STILL_OR_MOVING for s in _over("confidence", (0.7, 0.8, 0.9), **v))),
    "pf_ssd": Tuned("similarity", "pf_ssd", {}, _scaled("pf_ssd")),
    "mk_pf": Tuned("similarity", "mk_pf", {}, _scaled("mk_pf")),
    "mk_pf-75": Tuned("similarity", "mk_pf", {"particles": 75}, _scaled("mk_pf")),
    "mk_ssd": Tuned("similarity", "mk_ssd", {}, _over("span", (0.75, 1.0, 1.25, 1.5, 2.0, 2.5))),
    "texture_pf": Tuned("texture", "texture_pf", {}, tuple(
        s for rest in RESTS for s in _over("noise", (0.1, 0.15, 0.25), rest=rest))),
    "texture_ms": Tuned("texture", "texture_ms", {"scale": True}, tuple(
        s for rest in RESTS for s in _over("density", (16, 24, 32), rest=rest))),
}  # fmt: skip
"""The tuned trackers by name. In clutter each filter has as many particles as need about 1200
histograms a frame, as KAMS needs with 50. Mean shift and the octal kernel (sok) have no noise, so
other settings of theirs are tried."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TuningFile(Document):
    """The contents of the file tuning.json: for each tuned tracker, pairs of settings that were
    tried and their score, which is the mean of a measure over the runs.
    """

    FILE: ClassVar[str] = "tuning.json"
    KIND: ClassVar[str] = "tuning"

    scores: dict[str, list[tuple[dict[str, float | str], float]]]
    """Settings with the mean of the family's measure, by tracker."""

    def best(self, name: str) -> Settings:
        """Return the tried settings of a tracker, such as "kams", that have the best score; of
        equal ones the first.
        """
        sign = FAMILIES[TUNED[name].family].sign
        settings = max(self.scores[name], key=lambda one: sign * one[1])[0]
        return {k: type(TUNED[name].grid[0][k])(v) for k, v in settings.items()}


@cache
def stored() -> TuningFile:
    """Return the contents of servobench's own file tuning.json: the scores of all settings that
    were tried for each tuned tracker.
    """
    with resources.as_file(resources.files("servo.papers") / TuningFile.FILE) as path:
        return TuningFile.read(path)


def published(name: str) -> Contender:
    """Return the tracker that is tuned under a name, such as "kams", with the settings of its
    paper; its label is NAME-published.
    """
    return contender(TUNED[name].kind, "paper", f"{name}-published", **AS_PUBLISHED.get(name, {}))


AS_PUBLISHED: dict[str, Settings] = {
    "kams": {"particles": 50},
    "condensation": {"particles": 200, **RANDOM_WALK},
    "annealed": {"particles": 200},
    "hybrid": {"particles": 200, **CONSTANT_VELOCITY},
    "mk_pf-75": {"particles": 75},
    "texture_ms": {"scale": True},
}
"""Settings that `published` adds to the presets of the papers, such as the KAMS paper's numbers of
particles, by name of the tracker."""


def tuned(name: str) -> Contender:
    """Return the tracker that is tuned under a name, such as "kams", with its best settings in
    tuning.json; its label is NAME-tuned.
    """
    return TUNED[name].contender(name, stored().best(name), "tuned")


def _tried(name: str) -> list[Contender]:
    """Return a tracker with each setting of its grid, labelled NAME-try0 and so on."""
    one = TUNED[name]
    return [one.contender(name, s, f"try{i}") for i, s in enumerate(one.grid)]


def _members(family: str) -> list[str]:
    """Return the names of the trackers that are tuned on a family of sequences."""
    return [name for name, one in TUNED.items() if one.family == family]


def _jobs(family: str, effort: Effort) -> Sequence[Job]:
    """Return the runs of the grids of all trackers that are tuned on a family of sequences."""
    tried = [c for name in _members(family) for c in _tried(name)]
    of = FAMILIES[family]
    return sequence_jobs(tried, of.entries, effort.seeds(of.seeds, 0))


def _judge(family: str, evidence: Evidence) -> Verdict:
    """Write tuning.json with the scores of a family's grids into the study's folder, and return a
    verdict with their table.
    """
    measure = FAMILIES[family].measure
    scores: dict[str, list[tuple[Settings, float]]] = {}
    rows = [["tracker", "settings", measure, ""]]
    for name in _members(family):
        runs = [group(evidence.records, tracker=c.label) for c in _tried(name)]
        found = [round(float(column(r, measure).mean()), 4) for r in runs]
        scores[name] = list(zip(TUNED[name].grid, found, strict=True))
        best = TuningFile(scores=scores).best(name)
        for settings, score in scores[name]:
            listed = ", ".join(f"{k} {v}" for k, v in settings.items())
            rows.append([name, listed, f"{score:.4g}", "best" if settings == best else ""])
    whole = TuningFile(scores=stored().scores | scores).write(evidence.folder)
    nothing = Interval(0.0, 0.0, 0.0)
    return Verdict(Finding.UNDECIDED, nothing, "", 0, f"written to {whole.name}", rows)


TUNING = tuple(
    Claim(
        f"tuning-{name}",
        "no claim: the grid of each tracker",
        Rule(
            f"mean {family.measure}",
            "papers' presets, with six settings in turn",
            f"{family.seeds} painted sequences a level, seeds below 1000",
            "none",
            "none",
            "never",
        ),
        partial(_judge, name),
        partial(_jobs, name),
    )
    for name, family in FAMILIES.items()
)
"""The runs of the grids, as claims without a verdict that are run only if they are named. Each
writes a tuning.json, which then replaces the one in this folder."""
