"""The command `servobench compare`: a study of some variants, with its page, table and figures."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from servo.bench.contestant import named_part, settings_of
from servo.cli import report_command
from servo.cli.sweep_command import measures_of, run_study
from servo.cli.terminal import plain
from servo.mistake import Mistake
from servo.output.formats import command_line
from servo.scenario.toml import assignment
from servo.study.execute import Workers
from servo.study.parse import parsed
from servo.study.plan import Study
from sim.camera import gl

AXIS = "variant"
AS_IT_IS = "as it is"
"""Variant without any change, beside which a single one is shown."""
MEASURED = "run.tracker_ms=measured"
NEXT = re.compile(r",(?=[\w.\"]+=)")
"""The commas between settings; those inside of a list stay."""


@dataclass(frozen=True, slots=True)
class CompareRequest:
    """The options of the command line."""

    scenarios: Sequence[str]
    tracker: Sequence[str]
    controller: Sequence[str]
    estimator: Sequence[str]
    set_of: Sequence[str]
    measured: bool
    changes: Sequence[str]
    seeds: int
    workers: int
    scheduler: str | None
    out: Path | None
    measures: str | None
    dry_run: bool
    quiet: bool

    @property
    def command(self) -> str:
        """The command line, without --out and --workers."""
        return command_line(
            "compare",
            *self.scenarios,
            tracker=self.tracker,
            controller=self.controller,
            estimator=self.estimator,
            set_of=self.set_of,
            measured=self.measured,
            set=self.changes,
            seeds=self.seeds,
        )


def run(request: CompareRequest) -> int:
    """Do the missing runs and write page, table and figures; the exit code is that of a study.

    Raises:
        Mistake: A variant or a scenario is wrong, or the folder cannot be used.
        Refused: A file cannot be written, or the workers cannot work.
    """
    console = Console(quiet=request.quiet)
    folder = request.out or Path("runs") / "compare"
    study = study_of(request, folder.name)
    measures = None if request.measures is None else measures_of(request.measures)
    if request.scheduler is None:
        gl.is_there()
    workers = Workers(request.workers, request.scheduler)
    dry = request.dry_run
    code = run_study(
        study,
        request.command,
        workers,
        folder,
        console,
        dry_run=dry,
        measures=measures,
        has_page=True,
    )
    if not dry:
        files = report_command.Printed(folder / "tables.tex", "pdf", request.measures)
        for path in report_command.write([folder], None, files):
            plain(console, f"  {path}")
    return code


def study_of(request: CompareRequest, name: str) -> Study:
    """Return the study of a comparison: one axis of variants, over scenarios and seeds.

    Raises:
        Mistake: There is no variant, two have one name, or one is wrong.
    """
    table: dict[str, object] = {
        "scenario": list(request.scenarios),
        "seeds": request.seeds,
        "named": {AXIS: _variants(request)},
        "compare": AXIS,
    }
    changes = [*request.changes, *([MEASURED] if request.measured else [])]
    title = f"Variants compared in {', '.join(request.scenarios)}."
    return parsed(table, changes, Path(f"{name}.toml"), "compare", title)


def _variants(request: CompareRequest) -> dict[str, dict[str, Any]]:
    """Return the settings of each variant by its name."""
    parts = {
        "tracker": request.tracker,
        "controller": request.controller,
        "estimator": request.estimator,
    }
    named = [(section, *named_part(text)) for section, texts in parts.items() for text in texts]
    found = [(name, settings_of(section, what)) for section, name, what in named]
    found += map(_settings, request.set_of)
    names = [name for name, _ in found]
    for name in names:
        if names.count(name) > 1:
            raise Mistake(f"two variants are called '{name}': write another name before the =")
    if not found:
        raise Mistake("nothing to compare: give --tracker, --controller, --estimator or --set-of")
    return dict([(AS_IT_IS, {}), *found] if len(found) == 1 else found)


def _settings(text: str) -> tuple[str, dict[str, Any]]:
    name, _, settings = text.partition("=")
    if not name.strip() or "=" not in settings:
        raise Mistake(
            f"--set-of {text}: write NAME=KEY=VALUE,..., such as slow=controller.gain=0.5"
        )
    return name.strip(), dict(map(assignment, NEXT.split(settings)))
