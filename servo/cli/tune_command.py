"""The command `servobench tune`: choose settings of a scenario for a measure under conditions, and
test them on fresh seeds.
"""

from collections.abc import Sequence
from pathlib import Path

import tomli_w
from rich.console import Console

from servo.cli.terminal import complain, plain, print_table
from servo.cli.trial_command import trials, write
from servo.mistake import Mistake
from servo.output.formats import command_line
from servo.report.tune_section import Tuned, section
from servo.report.words import shown
from servo.scenario.draws import flat
from servo.scenario.load import load
from servo.scenario.toml import with_settings
from servo.study.execute import Workers
from servo.study.trials import Trial, trial_study
from servo.tune import space
from servo.tune.search import Aim, Values, check_budget, search, values_of
from tracking.files.json_text import json_text

FIRST_SEED = 1
"""The first seed of a search: seed 0 draws no settings."""
FRESH = 1001
"""The first fresh seed."""
WHOLE = "scenario.toml"
"""The file with the whole tuned scenario."""


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
    """Search the best settings of a scenario, run them and the scenario as it is on fresh seeds,
    and write the settings as TOML lines, the scenario with them, and a page.

    Args:
        scenario: A shipped scenario or a TOML file.
        changes: Changes of settings of all runs, such as "run.duration=5".
        settings: The settings to search, such as "controller.gain=0.2:5:log"; none: the usual ones.
        minimise: The measure to minimise.
        keep: Conditions, such as "success_rate>=0.95".
        budget: Largest number of runs of the search.
        seeds: Number of seeds (1, 2, ...) of a candidate that is not stopped early.
        fresh: Number of fresh seeds (1001, 1002, ...), which the search has not used.
        workers: Number of processes on this machine.
        scheduler: Address of a Dask scheduler to work on instead; None: this machine.
        out: The folder to write; None: runs/tune-SCENARIO.
        quiet: Whether to print on stderr only: mistakes and conditions that are broken on fresh
            seeds.

    Returns:
        The exit code: 1 if the best settings break a condition on fresh seeds, else 0.

    Raises:
        Mistake: An option is wrong, or no settings keep the conditions in the search; in the latter
            case nothing is run on fresh seeds, and the files are written before.
        Refused: A file cannot be written, or the workers cannot work.
    """
    aim = Aim.read(minimise, keep)
    check_budget(budget, seeds)
    chosen = {"set": changes, "settings": settings, "minimise": minimise, "keep": keep}
    again = command_line("tune", scenario, **chosen, budget=budget, seeds=seeds, fresh=fresh)
    base, described = trial_study("tune", scenario, changes, again)
    as_it_is = base.parsed(FIRST_SEED, {})
    own = flat(as_it_is.settings(), as_it_is.name)
    draws = space.asked(settings) or space.usual(as_it_is, own)
    space.check(draws, base, FIRST_SEED, own)
    console = Console(quiet=quiet)
    ranges = {d.key: f"{d.law} of {', '.join(map(shown, d.numbers))}" for d in draws}
    plain(console, *(f"searched: {key}, {numbers}" for key, numbers in ranges.items()))
    folder = out or Path("runs") / f"tune-{Path(scenario).stem}"
    pool = Workers(workers, scheduler)
    with trials(base, described, folder, pool, console, budget + 2 * fresh) as do:

        def perform(asked: Sequence[Trial]) -> list[Values]:
            return list(map(values_of, do(asked)))

        of_search = range(FIRST_SEED, FIRST_SEED + seeds)
        tried, best = search(
            aim, draws, perform, of_search, budget, lambda each: space.finished(each, own)
        )
        # Where all seeds are the same run, a fresh one is enough.
        count = fresh if len(tried[0].runs) == seeds else 1
        unseen = range(FRESH, FRESH + count * (aim.score(best.runs)[0] == 0))
        pairs = [perform([(s, seed) for seed in unseen]) for s in ({}, best.settings)]
    searched = {key: own.get(key) for key in ranges}
    result = Tuned(aim, searched, tried, best, *pairs)
    if unseen:
        plain(console, result.sentence)
        print_table(console, result.table())
        plain(console, "The lines for the scenario's file:", result.lines)
    found = {"command": again, "searched": ranges, "best": best.settings}
    runs = [{"settings": one.settings, "runs": one.runs} for one in tried]
    found |= {"tried": runs, "fresh_before": pairs[0], "fresh_after": pairs[1]}
    files: dict[str, bytes | str] = {"tune.json": json_text(found), "tuned.toml": result.lines}
    table = load(scenario, changes).table
    whole = tomli_w.dumps(with_settings(table, best.settings, scenario))
    files[WHOLE] = f"# {scenario} with the settings that this command found: {again}\n\n{whole}"
    write(folder, section(result, described, folder), files, console)
    if not unseen:
        raise Mistake(result.sentence)
    plain(console, f"the scenario with these settings: servobench run {folder / WHOLE}")
    complain(*result.broken)
    return 1 if result.broken else 0
