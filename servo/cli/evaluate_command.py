"""The command `servobench evaluate`: compare trackers on sequences or in the closed loop."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from rich.console import Console

from servo.cli.jobs import complete_jobs, go_on, print_estimate
from servo.cli.sweep_command import run_study
from servo.cli.terminal import complain, print_paths, print_table
from servo.output.formats import command_line
from servo.output.versions import versions
from servo.report import bench_section
from servo.study import ranking, suites
from servo.study.execute import Workers, check_number
from servo.study.parse import load
from servo.study.ranking import Rank
from servo.study.run import Job, Record
from servo.study.sequence_run import (
    PRECISION_CURVE,
    REMARKS,
    SUCCESS_CURVE,
    TRACKER,
    TrackedSequence,
)
from servo.study.store import Store, StudyFile, opened
from sim.camera import gl
from tracking.drawing import curves
from tracking.drawing.contact_sheet import sheet
from tracking.drawing.picture_bytes import encoded
from tracking.evaluation.track_file import read as read_track
from tracking.files import atomic
from tracking.files.csv_text import csv_text

COLUMNS = (TRACKER, "sequence", "family", "seed", "drawn", "frames")
"""Columns of runs.csv before those of the measures."""
WIDE = 7
"""Most columns of numbers of a printed table."""


def run(
    suite: str,
    trackers: str | None,
    seeds: int,
    workers: int,
    out: Path | None,
    quiet: bool,
    dry_run: bool = False,
) -> int:
    """Compare trackers on the sequences of a suite, or for the suite "closed_loop" in the simulated
    loop, and write and print tables; for sequences write curves and contact sheets, too.

    Args:
        suite: A shipped suite, a folder of sequences, or a TOML file.
        trackers: The trackers, with commas between them; None: those that the file lists, or else
            all that follow any target by pictures and the camera's motion alone, and need no
            program or model file of the user.
        seeds: Number of seeds: 0, 1, 2, ...
        workers: Number of processes.
        out: The folder to write; None: runs/evaluate-SUITE.
        quiet: Whether to print on stderr only: mistakes, failed runs and missed bounds.
        dry_run: Whether to print only how many runs there are and how long they will take, after up
            to five runs on trial, whose results are not kept.

    Returns:
        The exit code: 1 if a run failed (or a bound of "closed_loop" was missed), else 0.

    Raises:
        Mistake: The suite or a tracker is wrong, or the folder cannot be used.
        Refused: A file cannot be written, or the workers cannot work.
    """
    console = Console(quiet=quiet)
    title = Path(suite).stem
    folder = out or Path("runs") / f"evaluate-{title}"
    command = command_line("evaluate", suite, trackers=trackers, seeds=seeds)
    if suite == suites.CLOSED_LOOP:
        chosen = None if trackers is None else suites.tracker_tables(trackers)
        study = load(suite, seeds=seeds, trackers=chosen)
        gl.is_there()
        return run_study(study, command, Workers(workers), folder, console, dry_run=dry_run)
    subjects = subjects_of(suite, trackers)
    check_number(len(subjects) * seeds)
    jobs = [
        Job(i * seeds + seed, subject, seed, {TRACKER: subject.contender.label})
        for i, subject in enumerate(subjects)
        for seed in range(seeds)
    ]
    if dry_run:
        return print_estimate(jobs, workers, console, Store(folder))
    described = StudyFile(
        command=command,
        versions=versions(),
        holds="evaluate",
        name=title,
        title="Trackers against each other on sequences with a truth.",
        axes={
            TRACKER: list(dict.fromkeys(s.contender.label for s in subjects)),
            "sequence": list(dict.fromkeys(s.name for s in subjects)),
        },
        draws={},
        seeds=list(range(seeds)),
        compare=TRACKER,
        expect={},
        runs=len(jobs),
        table={"runs": [subject.describe() for subject in subjects]},
        scenarios={},
    )
    with Workers(workers) as pool, opened(folder, described) as store:
        store.find(jobs)
        _forget_lost_tracks(jobs, store)
        again = go_on(command, out)
        failed = complete_jobs(jobs, store, pool, console, f"evaluate {title}", again)
        records = store.records(jobs)
        if records:
            ranks = ranking.ranked(records)
            paths = _write(store, records, ranks, title)
            paths.append(_sheets(subjects, ranks[0].tracker, store.folder))
            print_ranks(console, ranks)
            print_paths(console, paths)
            # Each tracker has read the same pictures: one line for a sequence, not one for each.
            said = {r.subject: r.settings[REMARKS] for r in records if r.settings.get(REMARKS)}
            complain(*(f"{sequence}: {sentences}" for sequence, sentences in said.items()))
    return 1 if failed else 0


def _forget_lost_tracks(jobs: Sequence[Job], store: Store) -> None:
    """Remove jobs whose track files are missing or damaged from `store.done`, so that these jobs
    are run again, and print a warning for each on stderr.
    """
    done = [job for job in jobs if job.key in store.done]
    for job, record in zip(done, store.records(done), strict=True):
        if not isinstance(job.subject, TrackedSequence):
            continue
        path = job.subject.track_path(store.folder, job.seed)
        rows = 0
        with suppress(ValueError):  # the file cannot be read
            rows = len(read_track(path).states)
        if rows != record.settings["frames"]:
            complain(f"{path}: this track is missing or damaged and is computed again")
            store.forget(job)


def subjects_of(suite: str, trackers: str | None) -> list[TrackedSequence]:
    """Return all pairs of a tracker and a sequence of a suite, ready to be run: all sequences of
    the first tracker, then those of the next.

    Args:
        suite: A shipped suite (but "closed_loop"), a folder of sequences, or a TOML file.
        trackers: The trackers, with commas between them; None: those that the file lists, or else
            all that follow any target by pictures and the camera's motion alone, and need no
            program or model file of the user.

    Raises:
        Mistake: The suite or a tracker is wrong.
    """
    entries, listed = suites.suite(suite)
    chosen = listed if listed and trackers is None else suites.contenders(trackers)
    return [TrackedSequence(c, e) for c in chosen for e in entries]


def _write(
    store: Store, records: Sequence[Record], ranks: Sequence[Rank], title: str
) -> list[Path]:
    names = list(records[0].measures)
    lines = [
        [
            record.settings[TRACKER],
            record.subject,
            record.settings["family"],
            record.seed,
            record.settings["drawn"],
            record.settings["frames"],
            *(record.row[name] for name in names),
        ]
        for record in records
    ]
    results = [
        {
            TRACKER: record.settings[TRACKER],
            "success": record.series[SUCCESS_CURVE],
            "precision": record.series[PRECISION_CURVE],
        }
        for record in records
    ]
    return [
        *store.export(store.table()),
        store.write("runs.csv", csv_text([*COLUMNS, *names], lines)),
        store.write("table.csv", ranking.table_csv(ranks)),
        *curves.draw(results, [rank.tracker for rank in ranks], title, store.folder),
    ]


def print_ranks(console: Console, ranks: Sequence[Rank]) -> None:
    """Print the ranking of trackers, and below it a table of each tracker's mean area under the
    success curve (AUC) on each sequence. The table of areas is left out for a single sequence, and
    if it would have more than eight columns.
    """
    print_table(console, bench_section.trackers_table(ranks))
    families = bench_section.families_table(ranks)
    if families is not None and len(families.head) <= WIDE + 1:
        console.print()
        print_table(console, families)


def _sheets(subjects: Sequence[TrackedSequence], best: str, folder: Path) -> Path:
    """Write a contact sheet (PNG) of each sequence, with the truth and the best tracker's estimates
    of seed 0 (the truth alone, if that run failed); return the sheets' folder.
    """
    place = atomic.folder(folder, bench_section.SHEETS)
    for subject in subjects:
        if subject.contender.label == best:
            sequence = subject.entry.build(0)
            found = None  # where the run of this seed has failed
            with suppress(ValueError):
                found = read_track(subject.track_path(folder, 0)).corners
            picture = sheet(sequence.source, sequence.truth, found)
            atomic.write(place, f"{sequence.name}.png", encoded(picture))
    return place
