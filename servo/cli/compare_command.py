"""The command `servobench compare`: run scenarios with other trackers, laws, estimators or
settings, and compare them on a page, in a LaTeX table and in figures.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from rich.console import Console

from servo.bench.benchmark import Settings
from servo.cli import report_command
from servo.cli.sweep_command import measures_of, run_study
from servo.cli.terminal import print_paths
from servo.mistake import Mistake
from servo.output.formats import command_line
from servo.scenario.part_names import named_part, settings_of
from servo.scenario.toml import assignment
from servo.study.execute import Workers
from servo.study.parse import parsed
from servo.study.plan import Study
from sim.camera import gl

AXIS = "variant"

MEASURED = "run.tracker_ms=measured"
NEXT = re.compile(r",(?=[\w.\"]+=)")
"""Matches a comma between two settings, but none inside a list of values."""


def run(
    scenarios: Sequence[str],
    tracker: Sequence[str],
    controller: Sequence[str],
    estimator: Sequence[str],
    set_of: Sequence[str],
    measured: bool,
    changes: Sequence[str],
    seeds: int,
    workers: int,
    scheduler: str | None,
    out: Path | None,
    measures: str | None,
    dry_run: bool,
    quiet: bool,
) -> int:
    """Do the missing runs of a comparison of variants (changed trackers, laws, estimators or
    settings) in scenarios, and write its page, LaTeX table and PDF figures.

    Args:
        scenarios: Shipped scenarios or TOML files.
        tracker: Variants with another tracker, as NAME=TRACKER.
        controller: Variants with another control law, as NAME=CONTROLLER.
        estimator: Variants with another estimator, as NAME=ESTIMATOR.
        set_of: Variants with other settings, as NAME=KEY=VALUE,...
        measured: Whether the tracker's time on this machine delays the loop.
        changes: Changes of settings of all variants, such as "run.duration=5".
        seeds: Number of seeds: 0, 1, 2, ...
        workers: Number of processes on this machine.
        scheduler: Address of a Dask scheduler to work on instead; None: this machine.
        out: The folder to write; None: runs/compare.
        measures: Names of the measures in the tables, with commas between them; None: a few.
        dry_run: Whether to print only how many runs there are and how long they take.
        quiet: Whether to print on stderr only: mistakes and failed runs.

    Returns:
        The exit code: 1 if a run failed, else 0.

    Raises:
        Mistake: A variant or a scenario is wrong, or the folder cannot be used.
        Refused: A file cannot be written, or the workers cannot work.
    """
    parts = {"tracker": tracker, "controller": controller, "estimator": estimator}
    folder = out or Path("runs") / "compare"
    every = [*changes, *[MEASURED] * measured]
    study = study_of(scenarios, variants_of(parts, set_of), every, seeds, folder.name)
    columns = None if measures is None else measures_of(measures)
    if scheduler is None:
        gl.is_there()
    console = Console(quiet=quiet)
    code = run_study(
        study,
        command_line(
            "compare",
            *scenarios,
            **parts,
            set_of=set_of,
            measured=measured,
            set=changes,
            seeds=seeds,
        ),
        Workers(workers, scheduler),
        folder,
        console,
        dry_run=dry_run,
        measures=columns,
        has_page=True,
    )
    if not dry_run:
        files = report_command.Printed(folder / "tables.tex", "pdf", measures)
        print_paths(console, report_command.write([folder], None, files))
    return code


def study_of(
    scenarios: Sequence[str],
    variants: Mapping[str, Settings],
    changes: Sequence[str],
    seeds: int,
    name: str,
) -> Study:
    """Return the study that compares variants: a run of each variant in each scenario with each
    seed.

    Args:
        scenarios: Shipped scenarios or TOML files.
        variants: Changed settings, by dotted key, of each variant by its name.
        changes: Changes of settings of all variants, such as "run.duration=5".
        seeds: Number of seeds: 0, 1, 2, ...
        name: Name of the study.

    Raises:
        Mistake: A scenario, a variant or a change is wrong.
    """
    table: dict[str, object] = {
        "scenario": list(scenarios),
        "seeds": seeds,
        "named": {AXIS: dict(variants)},
        "compare": AXIS,
    }
    title = f"Variants compared in {', '.join(scenarios)}."
    return parsed(table, changes, Path(f"{name}.toml"), "compare", title)


def variants_of(parts: Mapping[str, Sequence[str]], set_of: Sequence[str]) -> dict[str, Settings]:
    """Return the changed settings, by dotted key, of each variant by its name. If there is a single
    variant, one without changes, "as it is", comes first.

    Args:
        parts: Texts such as "mine=kams" (NAME=KIND), by the section of a scenario ("tracker").
        set_of: Texts such as "slow=controller.gain=0.5" (NAME=KEY=VALUE,...).

    Raises:
        Mistake: There is no variant, two have one name, or a text has another form.
    """
    named = [
        (section, *named_part(section, text)) for section, texts in parts.items() for text in texts
    ]
    found = [(name, settings_of(section, what)) for section, name, what in named]
    found += map(_settings, set_of)
    if not found:
        raise Mistake(
            "there is nothing to compare: give --tracker, --controller, --estimator or --set-of"
        )
    if len(found) == 1:
        found.insert(0, ("as it is", {}))
    names = [name for name, _ in found]
    for name in names:
        if names.count(name) > 1:
            raise Mistake(
                f"two variants are called '{name}': give one another name, as in NAME=kams"
            )
    return dict(found)


def _settings(text: str) -> tuple[str, Settings]:
    """Return the name and the settings, by dotted key, of a variant that is given as
    NAME=KEY=VALUE,...

    Raises:
        Mistake: The text has another form.
    """
    name, _, settings = text.partition("=")
    if not name.strip() or "=" not in settings:
        raise Mistake(
            f"--set-of {text}: there is no name or no setting: write NAME=KEY=VALUE,..., such as "
            "slow=controller.gain=0.5"
        )
    return name.strip(), dict(map(assignment, NEXT.split(settings)))
