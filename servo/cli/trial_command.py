"""What `servobench tune` and `servobench budget` share: runs whose settings the command chooses
while it works, a folder with which a stopped command can be continued, and a page about the result.
"""

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console

from servo.cli.guard import stop
from servo.cli.jobs import go_on, progress
from servo.cli.terminal import plain, print_paths
from servo.mistake import Mistake, Refused
from servo.report.page import Section, render
from servo.study.execute import Workers
from servo.study.run import ClusterLost
from servo.study.scenario_run import StudiedScenario
from servo.study.store import Store, StudyFile, opened
from servo.study.trials import Trials
from sim.camera import gl


@contextmanager
def trials(
    base: StudiedScenario,
    described: StudyFile,
    folder: Path,
    workers: Workers,
    console: Console,
    total: int,
) -> Generator[Trials]:
    """Context manager that opens the folder of a command, yields the function that does its runs,
    and shows progress meanwhile.

    Args:
        base: The scenario.
        described: The description of the folder, for its study.json.
        folder: The folder to write; runs that it already has are not repeated.
        workers: The processes that do the runs.
        console: The output of the command.
        total: Largest number of runs.

    Raises:
        Mistake: The folder or the scheduler cannot be used.
        Refused: A file cannot be written, or the workers cannot work.
        SystemExit: Ctrl-C or another signal stopped the command.
    """
    if workers.scheduler is None:
        gl.is_there()
    again = go_on(described.command, folder)
    with opened(folder, described) as store, workers:
        store.find()
        finished = len(store.done)
        plain(console, f"{described.holds}: {total:,} runs at most, {finished:,} of them finished")
        try:
            with progress(console, described.holds, total, finished) as ended:
                yield Trials(base, store, workers, ended)
        except KeyboardInterrupt as cause:
            store.find()  # the signal may have come just after a run was stored
            stop(cause, f"{len(store.done)} runs are finished; {again}")
        except ClusterLost as lost:
            sentence = f"{lost}; {len(store.done)} runs are finished; {again}"
            raise (Refused if workers.scheduler is None else Mistake)(sentence) from None


def write(folder: Path, section: Section, files: dict[str, bytes | str], console: Console) -> None:
    """Write the page (report.html) and other files of a command into its folder, and print their
    paths.

    Args:
        folder: The folder.
        section: The only section of the page.
        files: Contents of the other files by name; the page is added to it.
        console: The output of the command.
    """
    store = Store(folder)
    files["report.html"] = render([section])
    print_paths(console, [store.write(name, content) for name, content in files.items()])
