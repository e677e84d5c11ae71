"""The command `servobench budget`: what each source of error that a scenario has or could have,
such as a wrong focal length, contributes to the error at the end of a run.
"""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from servo.budget.plan import Plan
from servo.budget.sources import SOURCES, magnitudes_of
from servo.cli.idle_settings import idle_settings
from servo.cli.terminal import plain, print_table, waiting
from servo.cli.trial_command import trials, write
from servo.loop.episode import Episode
from servo.output.formats import command_line
from servo.report.budget_section import picture, section, sentence, table
from servo.report.charts import saved
from servo.scenario.load import Scenario
from servo.study.execute import Workers
from servo.study.trials import trial_study
from tracking.files.json_text import json_text

FIRST_SEED = 1
"""The first seed of the runs: with seed 0 a scenario draws no settings."""


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
    """Run a scenario with each source of error (such as a wrong focal length) alone and with all
    together; print what each contributes to the error at the end, and write a page, a JSON file and
    a plot.

    Args:
        scenario: A shipped scenario or a TOML file.
        changes: Changes of settings of all runs, such as "run.duration=5".
        magnitude: Magnitudes of sources, such as "focal_length=0.5", in the unit that the table
            shows; for all other sources the scenario's own or the usual one is taken.
        seeds: Number of seeds of each combination: 1, 2, ...
        workers: Number of processes on this machine.
        scheduler: Address of a Dask scheduler to work on instead; None: this machine.
        out: The folder to write; None: runs/budget-SCENARIO.
        quiet: Whether to print mistakes only.

    Raises:
        Mistake: The scenario or an option is wrong, or all runs of a combination fail.
        Refused: A file cannot be written, or the workers cannot work.
    """
    stated = magnitudes_of(magnitude)
    again = command_line("budget", scenario, set=changes, magnitude=magnitude, seeds=seeds)
    base, described = trial_study("budget", scenario, changes, again)
    plan = Plan.of(base, range(FIRST_SEED, FIRST_SEED + seeds), stated)
    console = Console(quiet=quiet)
    with waiting(console, "looking for the sources of error that the scenario can have"):
        with Episode(plan.scenario, seen=False) as episode:
            focal = episode.world.camera.focal
        reasons = {source.name: plan.reason(source, _idle) for source in SOURCES}
    left_out = {name: reason for name, reason in reasons.items() if reason}
    plain(console, *(f"left out: {name}: {reason}" for name, reason in left_out.items()))
    sources = [source for source in SOURCES if source.name not in left_out]
    asked = plan.trials(sources)
    folder = out or Path("runs") / f"budget-{Path(scenario).stem}"
    pool = Workers(workers, scheduler)
    with trials(base, described, folder, pool, console, len(asked)) as do:
        parts = plan.parts(sources, do(asked), focal)
    print_table(console, table(parts))
    plain(console, sentence(parts))
    drawn = picture(parts)
    found = {"command": again, "parts": parts, "left_out": left_out}
    files: dict[str, bytes | str] = {"budget.json": json_text(found)}
    files |= {f"budget.{kind}": saved(drawn, kind) for kind in ("png", "svg")}
    write(folder, section(parts, left_out, described, folder), files, console)


def _idle(scenario: Scenario) -> list[str]:
    """Return a sentence for each setting of a scenario that has no effect."""
    with Episode(scenario, seen=False) as episode:
        return idle_settings(episode)
