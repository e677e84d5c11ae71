"""Writer of the folder of a run: run.rrd (Rerun recording), steps.parquet (a row for each step),
report.json and two plots.
"""

import traceback
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

import pyarrow.parquet as pq

from servo.closing import closing
from servo.loop.episode import Episode
from servo.loop.part_failures import PartFailed
from servo.loop.step import Step
from servo.mistake import FULL, Mistake, Refused, refusal, writing
from servo.output import plots
from servo.output.formats import Document
from servo.output.run_curves import RunCurves
from servo.output.sinks import Sink, Sinks
from servo.output.steps_table import STREAM, TABLE, StepsTable
from tracking.files import atomic

RECORDING = "run.rrd"


def prepare(asked: Path | None, name: str) -> Path:
    """Make a folder for a run and return it.

    Args:
        asked: The folder that the user wants, which may exist if it is empty; None: runs/NAME, or
            the next free one of runs/NAME-2, runs/NAME-3, ...
        name: NAME of the folder.

    Raises:
        Mistake: The folder is not empty, cannot be written, or has a name that is not UTF-8.
        Refused: The disk is full, or fails.
    """
    _check_name(asked or Path(name))
    with writing(asked or Path("runs") / name):
        if asked is None:
            return _next_free(Path("runs"), name)
        if asked.is_dir() and any(asked.iterdir()):
            raise Mistake(f"{asked}: this folder is not empty; choose another with --out")
        asked.mkdir(parents=True, exist_ok=True)
        atomic.write(asked, RECORDING, b"").unlink()  # a test
    return asked


def with_traceback(error: PartFailed, folder: Path) -> Mistake:
    """Write the traceback of an exception in a component, such as a user's tracker, to
    traceback.txt in a folder, if the disk has room.

    Args:
        error: The error of the component, with the exception as its cause.
        folder: An existing folder.

    Returns:
        The error to raise: a new one, whose sentence names the file of the traceback, or `error`
        itself if no file was written.
    """
    if error.__cause__ is None:
        return error
    text = "".join(traceback.format_exception(error.__cause__))
    try:
        path = atomic.write(folder, "traceback.txt", text.encode(errors="replace"))
    except OSError:
        return error
    return Mistake(f"{error}; its traceback is in {path}")


def discard(folder: Path, others: Iterable[Path]) -> None:
    """Delete the files of a run that ended before its first step: the stream of its steps, its
    table and its recording in `folder`, and the files `others`. Missing files are ignored.
    """
    for path in (*(folder / name for name in (STREAM, TABLE, RECORDING)), *others):
        path.unlink(missing_ok=True)


def _check_name(folder: Path) -> None:
    try:
        str(folder).encode()
    except UnicodeEncodeError:
        raise Mistake(
            f"{folder}: the name of this folder is not UTF-8; choose another with --out"
        ) from None


def _next_free(runs: Path, name: str) -> Path:
    """Make runs/NAME, or else runs/NAME-2, runs/NAME-3, ..., and return it; other runs may do the
    same at the same time.
    """
    runs.mkdir(parents=True, exist_ok=True)
    number = 1
    while True:
        folder = runs / (name if number == 1 else f"{name}-{number}")
        number += 1
        with suppress(FileExistsError):
            folder.mkdir()
            return folder


class RunFolder:
    """Writer of the files of a run: a row of the table (steps.parquet) for each step as it comes,
    and report and plots at the end; also a Rerun recording (if `rerun`), and other outputs (`more`,
    by path of the file or name).

    Rows have priority: their space on the disk is reserved, and they are written even if the
    recording no longer can be.
    """

    def __init__(
        self,
        folder: Path,
        episode: Episode,
        *,
        rerun: bool,
        more: Mapping[Path | str, Sink] | None = None,
    ) -> None:
        """Open the table of steps and the recording.

        Args:
            folder: An empty folder.
            episode: The run whose steps will be added.
            rerun: Whether to write a recording.
            more: Other sinks of the steps, by path of their file or by name.

        Raises:
            Mistake: Another run is writing into this folder.
            Refused: The table cannot be opened: usually the disk has no space for the rows.
        """
        self.folder = folder
        self._scenario = episode.scenario
        self._features = episode.loop.features
        try:
            self._table = StepsTable(folder, episode)
        except FileExistsError:
            raise Mistake(
                f"{folder}: another run is writing into this folder; choose another with --out"
            ) from None
        except OSError as error:
            (folder / STREAM).unlink(missing_ok=True)
            full = "the disk has no room for the table: " if error.errno in FULL else ""
            remedy = "make room, or choose another folder" if full else "choose another folder"
            raise Refused(f"{folder / STREAM}: {full}{error.strerror}: {remedy}") from None
        self._sinks = Sinks(more or {})
        if rerun:
            # rerun takes half a second to import
            from servo.output.recording.destination import RecordingFile
            from servo.output.recording.log import RerunLog

            path = folder / RECORDING
            self._sinks.begin(path, lambda: RerunLog(RecordingFile(path), episode))

    @property
    def refused(self) -> Refused | None:
        """Error of the first output that failed besides the table, such as the recording; None if
        none has.
        """
        return self._sinks.refused

    def add(self, step: Step) -> None:
        """Write a step as a row of the table, and give it to the recording and the other outputs.
        An OSError or `Refused` of one of these outputs is not raised: `refused` keeps the first.

        Raises:
            OSError: The row cannot be written.
        """
        self._table.add(step)
        self._sinks.add(step)

    def close(self) -> None:
        """Finish steps.parquet, the recording and the other outputs.

        Raises:
            Refused: The table cannot be written; its rows are in steps.arrows.
        """
        with closing(self._sinks.close):
            try:
                self._table.close()
            except OSError as error:
                kept = f"all rows are in {self.folder / STREAM}: make room, and run again"
                raise Refused(f"{self.folder / TABLE}: {error.strerror}; {kept}") from None

    def finish(self, report: Document) -> list[Path]:
        """Write report.json, target_motion.png and errors.png; call it after `close`.

        Args:
            report: Contents of report.json.

        Returns:
            The paths of all files of the run, without outputs that failed.

        Raises:
            Refused: A file cannot be written; steps.parquet is complete.
        """
        title = f"{self._scenario.name}, seed {self._scenario.run.seed}"
        try:
            written = report.write(self.folder)
            curves = RunCurves.of(pq.read_table(self.folder / TABLE), self._features)
            drawn = plots.draw(curves, title, self.folder)
        except OSError as error:
            kept = f"all rows are in {self.folder / TABLE}: make room, and run again for the rest"
            raise Refused(f"{refusal(error)}; {kept}") from None
        return [*self._sinks.paths, self.folder / TABLE, written, *drawn]
