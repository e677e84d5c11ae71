"""The command `servobench tune`: choose settings of a scenario for a measure under conditions, and
test them on fresh seeds.
"""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from servo.cli.terminal import complain, plain, print_table
from servo.cli.trial_command import trials, write
from servo.mistake import Mistake
from servo.output.formats import command_line
from servo.output.versions import versions
from servo.report.tune_section import fresh_table, sentence
from servo.report.words import shown
from servo.scenario.draws import Draw
from servo.study.execute import Workers
from servo.study.trials import study_of
from servo.tune import space
from servo.tune.aim import Aim, Values, values_of
from servo.tune.result import FIRST_SEED, FRESH, tuned
from servo.tune.search import Trial, check_budget, search


def run(
    scenario: str,
    changes: Sequence[str],
    settings: Sequence[str],
    minimise: str,
    keep: Sequence[str],
    budget: int,
    seeds: int,
    fresh: int,
    workers: int,
    scheduler: str | None,
    out: Path | None,
    quiet: bool,
) -> int:
    """Search settings, run them and the scenario as it is on fresh seeds, and write lines and page.

    Args:
        scenario: A shipped scenario or a TOML file.
        changes: Changes of settings of all runs, such as "run.duration=5".
        settings: The settings to search, such as "controller.gain=0.2:5:log"; none: the usual ones.
        minimise: The measure to minimise.
        keep: Conditions, such as "success_rate>=0.95".
        budget: Largest number of runs of the search.
        seeds: Number of seeds of a candidate that is not stopped.
        fresh: Number of fresh seeds.
        workers: Number of processes on this machine.
        scheduler: Address of a Dask scheduler to work on instead; None: this machine.
        out: The folder; None: runs/tune-SCENARIO.
        quiet: Whether to print mistakes only.

    Returns:
        The exit code: 1 if the best settings break a condition on fresh seeds, else 0.

    Raises:
        Mistake: An option is wrong, or no settings keep the conditions.
        Refused: A file cannot be written, or the workers cannot work.
    """
    aim = Aim.read(minimise, keep)
    check_budget(budget, seeds)
    again = command_line(
        "tune",
        scenario,
        set=changes,
        settings=settings,
        minimise=minimise,
        keep=keep,
        budget=budget,
        seeds=seeds,
        fresh=fresh,
    )
    base, described = study_of("tune", scenario, changes, again)
    as_it_is = base.parsed(FIRST_SEED, {})
    draws = space.asked(settings) or space.usual(as_it_is)
    space.check(draws, base, FIRST_SEED)
    own = as_it_is.settings()
    values = {draw.key: space.value_of(own, draw.key) for draw in draws}
    console = Console(quiet=quiet)
    plain(console, *(_searched(draw) for draw in draws))
    folder = out or Path("runs") / f"tune-{as_it_is.name}"
    pool = Workers(workers, scheduler)
    with trials(base, described, folder, pool, console, budget + 2 * fresh) as do:

        def perform(asked: Sequence[Trial]) -> list[Values]:
            return [values_of(record) for record in do(asked)]

        found = search(
            aim,
            draws,
            perform,
            range(FIRST_SEED, FIRST_SEED + seeds),
            budget,
            lambda proposed: space.of_kinds(proposed, own),
            [key for key, value in values.items() if type(value) is int],
        )
        is_feasible = aim.score(found.best.runs).violation == 0
        # Without a draw or noise all seeds are the same run.
        count = 0 if not is_feasible else fresh if len(found.seeds) == seeds else 1
        unseen = range(FRESH, FRESH + count)
        before, after = (
            perform([(chosen, seed) for seed in unseen]) for chosen in ({}, found.best.settings)
        )
    result = tuned(
        aim,
        draws,
        found,
        (unseen, before, after),
        scenario=as_it_is.name,
        own=values,
        command=again,
        versions=versions(),
    )
    if is_feasible:
        plain(console, sentence(result))
        print_table(console, fresh_table(result))
        plain(console, "\nThe lines for the scenario's file:\n", result.lines)
    write(result, folder, console)
    complain(*result.broken)
    if not is_feasible:
        raise Mistake(sentence(result))
    return 1 if result.broken else 0


def _searched(draw: Draw) -> str:
    """Return a line that says between which values a setting is searched."""
    numbers = list(map(shown, draw.numbers))
    if draw.law == "choice":
        return f"searching {draw.key}: {', '.join(numbers)}"
    return f"searching {draw.key}: {' to '.join(numbers)}" + ", log" * (draw.law == "log_uniform")
