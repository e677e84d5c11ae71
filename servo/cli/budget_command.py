"""The command `servobench budget`: what each imperfection of a scenario contributes to its error at
the end.
"""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from rich.console import Console

from servo.budget.parts import BudgetFile, Plan, measure
from servo.budget.sources import SOURCES, magnitudes_of
from servo.cli.idle_settings import idle_settings
from servo.cli.terminal import plain, print_table, waiting
from servo.cli.trial_command import trials, write
from servo.loop.episode import Episode
from servo.mistake import writing
from servo.output.formats import command_line
from servo.output.versions import versions
from servo.report.budget_section import picture, sentence, table
from servo.report.charts import saved
from servo.scenario.load import Scenario
from servo.study.execute import Workers
from servo.study.trials import study_of
from tracking.files import atomic

FIRST_SEED = 1
"""Seed 0 draws no settings."""


def run(
    scenario: str,
    changes: Sequence[str],
    magnitude: Sequence[str],
    seeds: int,
    workers: int,
    scheduler: str | None,
    out: Path | None,
    quiet: bool,
) -> None:
    """Run a scenario with each source of error alone and with all together; write table and plot.

    Args:
        scenario: A shipped scenario or a TOML file.
        changes: Changes of settings of all runs, such as "run.duration=5".
        magnitude: Magnitudes, such as "focal=0.5"; others are the scenario's or usual ones.
        seeds: Number of seeds of each combination: 1, 2, ...
        workers: Number of processes on this machine.
        scheduler: Address of a Dask scheduler to work on instead; None: this machine.
        out: The folder; None: runs/budget-SCENARIO.
        quiet: Whether to print mistakes only.

    Raises:
        Mistake: The scenario or an option is wrong, or every run fails.
        Refused: A file cannot be written, or the workers cannot work.
    """
    magnitudes = magnitudes_of(magnitude)
    again = command_line("budget", scenario, set=changes, magnitude=magnitude, seeds=seeds)
    base, described = study_of("budget", scenario, changes, again)
    plan = Plan.of(base, FIRST_SEED, magnitudes)
    console = Console(quiet=quiet)
    with waiting(console, "looking for the sources of error that the scenario can have"):
        reasons = {s.name: plan.reason(s, FIRST_SEED, _idle) for s in SOURCES}
        with Episode(plan.scenario, seen=False) as episode:
            focal = episode.world.camera.focal
    left_out = {name: reason for name, reason in reasons.items() if reason}
    plain(console, *(f"left out: {name}: {reason}" for name, reason in left_out.items()))
    folder = out or Path("runs") / f"budget-{plan.scenario.name}"
    total = (len(SOURCES) - len(left_out) + 2) * seeds
    pool = Workers(workers, scheduler)
    with trials(plan.base, described, folder, pool, console, total) as do:
        every = range(FIRST_SEED, FIRST_SEED + seeds)
        found = measure(plan, left_out, every, focal, do)
    made = {"command": again, "versions": versions(), "scenario": plan.scenario.name}
    result = BudgetFile(**made, **found)
    print_table(console, table(result))
    plain(console, sentence(result))
    drawn = picture(result)
    with writing(folder):
        save = partial(atomic.write, folder)
        files = [save(f"budget.{kind}", saved(drawn, kind)) for kind in ("png", "svg")]
    write(result, folder, console, files)


def _idle(scenario: Scenario) -> list[str]:
    """Return a sentence for each setting of a scenario that has no effect."""
    with Episode(scenario, seen=False) as episode:
        return idle_settings(episode)
