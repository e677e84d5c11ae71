"""The command `servobench track`: run a tracker on pictures and write its track and report."""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from rich.console import Console

from servo.cli.guard import REFUSED, STOPPED, exit_code
from servo.cli.outputs import Outputs, announce, linger
from servo.cli.terminal import (
    COMPILING,
    WAITING,
    complain,
    escape,
    plain,
    print_table,
    progress_bar,
    waiting,
)
from servo.closing import closing
from servo.loop.part_failures import Part, PartFailed
from servo.mistake import Mistake, as_mistake
from servo.output.formats import command_line
from servo.output.run_folder import prepare, with_traceback
from servo.output.track_folder import TrackFolder, TrackReport
from servo.output.versions import versions
from servo.report.words import Table
from servo.scenario.fill import fill_plugin
from servo.scenario.toml import assignment, put
from sim.types import Array
from tracking.advice import advice
from tracking.evaluation.track import Shot, Track, follow
from tracking.evaluation.track_measures import MEASURES, Comparison, measure_all
from tracking.evaluation.warm_up import warm_up
from tracking.files.json_text import number
from tracking.sequences import truth as truths
from tracking.sequences.quadrilateral import placement
from tracking.sequences.sequence import check_truth, source_of, truth_beside
from tracking.sequences.sources import SECOND, End, Picture, Source
from tracking.sequences.stream import shown
from tracking.trackers import KINDS as TRACKERS
from tracking.types import Region, State, Status


@dataclass(frozen=True, slots=True)
class TrackRequest:
    """The options of `servobench track`."""

    source: str
    region: str | None
    topic: str | None
    select: bool
    tracker: str
    changes: Sequence[str]
    seed: int
    truth: Path | None
    truth_format: str
    out: Path | None
    outputs: Outputs
    rerun: bool
    rate: float
    frames: int | None
    quiet: bool

    @property
    def command(self) -> str:
        """The command line that repeats the track, without --out and other places to write to."""
        return command_line(
            "track",
            self.source,
            region=self.region,
            topic=self.topic,
            tracker=self.tracker,
            set=list(self.changes),
            seed=self.seed,
            truth=self.truth,
            truth_format=self.truth_format,
            rerun=self.rerun,
            rate=f"{self.rate:g}",
            frames=self.frames,
        )

    def name_with(self, kind: str) -> str:
        """Return the name of the folder to write: source, kind of tracker, seed."""
        source = Path(self.source.replace(":", "-")).stem.encode(errors="replace").decode()
        return f"{source}-{kind.replace(':', '-')}-{self.seed}"


def run(request: TrackRequest) -> int:
    """Track the target and write the files.

    Returns:
        The exit code: 1 if the stream broke off or a picture could not be read, that of a signal
        that stopped the command, else 0.

    Raises:
        Mistake: The source, its truth, the region or the tracker is wrong, or the folder cannot be
            used.
        Refused: The video or the recording could not be written completely.
    """
    settings, config = tracker_of(request.tracker, request.changes)
    request.outputs.check()
    console = Console(quiet=request.quiet)
    with as_mistake():
        source = source_of(request.source, request.rate, request.topic)
        request = replace(request, source=shown(request.source))
        truth = _truth(request, source)
        _warm_up(request, source, config, console)
        request, pictures = _selected(request, source)
        region, start = _placement(request, truth)
    if truth is not None and len(truth) == 1 and source.count != 1:
        complain(f"the truth has one line for {source.count} pictures: there are no measures")
        truth = None
    part = Part("tracker", config)
    tracker = part.guarded(part.build(np.random.default_rng(request.seed)))
    shots = _shots(itertools.islice(follow(tracker, pictures, region, start), request.frames))
    kind = settings["kind"]
    name = request.name_with(kind)
    viewer = request.outputs.viewer()  # before the first picture of a stream, which goes on
    first = _first(request, shots, name)
    folder = prepare(request.out, name)
    announce(viewer, console)
    # A live source does not wait: advice would take time and so cost pictures.
    if (
        first.picture.image is not None
        and source.count is not None
        and (line := advice(config, first.picture.image, region, start))
    ):
        plain(console, line)
    more = request.outputs.of_track(region, source, f"{kind} on {name}", viewer)
    try:
        files = TrackFolder(folder, region, recording=request.rerun, more=more)
        seen, code = _write(request, files, truth, itertools.chain([first], shots), source)
    except PartFailed as error:
        raise with_traceback(error, folder) from None
    comparison = (
        Comparison.of(Track.of(seen, region), truth) if truth is not None and seen else None
    )
    end = _with_reason(source.end, seen, files.seconds)
    report = _report(request, folder, settings, seen, comparison, end)
    print_track(console, f"{kind} on {name}", seen, comparison, end)
    for path in (*files.paths, report):
        plain(console, f"  {path}")
    if code == 0:
        linger(viewer, console)
    if files.refused is not None:
        raise files.refused
    is_lost = end is not None and end.lost
    return code or (REFUSED if is_lost or any(shot.blind for shot in seen) else 0)


def _warm_up(request: TrackRequest, source: Source, config: Any, console: Console) -> None:
    """Compile the tracker and the recording for a live source, by running them on noise.

    A live source does not wait: compiling after its first picture would lose a second of it.
    """
    if source.count is not None:
        return
    with waiting(console, WAITING):
        seen = warm_up(config)
        with TemporaryDirectory() as place:
            files = TrackFolder(Path(place), Region(1.0, 1.0), recording=request.rerun)
            for shot in seen:
                files.add(shot, None)
            files.close()


def _shots(shots: Iterator[Shot]) -> Iterator[Shot]:
    """Yield the tracked pictures; raise a ValueError of source or tracker as a Mistake."""
    with as_mistake():
        yield from shots


def _first(request: TrackRequest, shots: Iterator[Shot], name: str) -> Shot:
    """Return the first tracked picture.

    Raises:
        Mistake: The tracker failed, or there is no picture.
    """
    try:
        return next(shots)
    except PartFailed as error:
        raise with_traceback(error, prepare(request.out, name)) from None
    except StopIteration:
        raise Mistake(f"{request.source}: this source has no pictures") from None


def tracker_of(kind: str, changes: Sequence[str]) -> tuple[dict[str, Any], Any]:
    """Return the settings of a tracker as a TOML table, and its `Config`.

    Args:
        kind: The tracker, such as "kams" or "kams:paper".
        changes: Changes of settings, such as "tracker.particles=80".

    Raises:
        Mistake: There is no such kind or setting.
    """
    table: dict[str, Any] = {"tracker": TRACKERS.named(kind)}
    for item in changes:
        put(table, *assignment(item), f"--set {item}")
        if len(table) > 1:
            raise Mistake(f"--set {item}: here only tracker.KEY=VALUE can be set")
    return table["tracker"], fill_plugin(TRACKERS, table["tracker"], "tracker")


def _selected(request: TrackRequest, source: Source) -> tuple[TrackRequest, Iterator[Picture]]:
    """Return the request with the region that the user draws for --select, and all pictures."""
    pictures = iter(source)
    if not request.select:
        return request, pictures
    from servo.cli import region_page  # jinja2 takes a while to import

    text, pictures = region_page.select(request.source, pictures, request.region)
    return replace(request, region=text), pictures


def _truth(request: TrackRequest, source: Source) -> Array | None:
    """Return the true corners (n, 4, 2) [px] in the file that the request names or that stands
    beside its source; None without such a file.

    Raises:
        Mistake: The source has no end, or the truth does not fit it.
    """
    form = truths.Format.named(request.truth_format)
    path = request.truth or truth_beside(request.source)
    if path is None:
        return None
    if source.count is None:
        raise Mistake(
            f"{path}: the pictures of {request.source} cannot be counted, so a truth cannot belong "
            "to them: leave out --truth"
        )
    truth = truths.read(path, form, source.count)
    check_truth(truth, source, str(path), form, start_is_enough=True)
    if truths.has_masks(path):
        complain(f"{path}: its masks are replaced by the boxes around them")
    return truth


def _placement(request: TrackRequest, truth: Array | None) -> tuple[Region, State]:
    """Return the target's region and its state in the first picture.

    Raises:
        Mistake: Neither the request nor the truth gives them.
    """
    if request.region is not None:
        return region_of(request.region)
    if truth is None:
        raise Mistake(
            f"{request.source}: there is no truth file beside this source; give "
            "--region X,Y,W,H[,DEG]"
        )
    if not np.isfinite(truth[0]).all():
        raise Mistake("the target is not in the first picture of the truth; give --region")
    return placement(truth[0])


def region_of(text: str) -> tuple[Region, State]:
    """Return a target's region and state in the first picture from a text "X,Y,W,H[,DEG]": top left
    corner [px], size [px], rotation about the centre [deg].

    >>> region_of("40,30,30,20")[1]
    State(x=55.0, y=40.0, theta=0.0, scale=1.0)

    Raises:
        Mistake: The text has another form.
    """
    try:
        x, y, w, h, *turn = (float(part) for part in text.split(","))
        degrees = turn[0] if len(turn) == 1 else 0.0
        if len(turn) > 1 or not np.isfinite([x, y, w, h, degrees]).all():
            raise ValueError(text)
    except ValueError:
        raise Mistake(f"--region {text}: this should be X,Y,W,H or X,Y,W,H,DEG in px") from None
    return Region(w, h), State(x + w / 2, y + h / 2, float(np.radians(degrees)))


def _write(
    request: TrackRequest,
    files: TrackFolder,
    truth: Array | None,
    shots: Iterator[Shot],
    source: Source,
) -> tuple[list[Shot], int]:
    """Write all tracked pictures; return them without their images, and the exit code."""
    seen: list[Shot] = []
    count = min(filter(None, (source.count, request.frames)), default=None)
    code = 0
    with closing(files.close):
        try:
            with progress_bar(Console(quiet=request.quiet)) as bar:
                task = bar.add_task(escape(request.tracker), total=count, note=COMPILING)
                for shot in shots:
                    true = None if truth is None or shot.index >= len(truth) else truth[shot.index]
                    seen.append(shot.without_picture())  # first: a signal may come in between
                    files.add(shot, true)
                    bar.update(task, advance=1, note=shot.estimate.status.name)
        except KeyboardInterrupt as cause:
            plain(Console(stderr=True), STOPPED)
            code = exit_code(cause)
    return seen[: files.count], code


def _with_reason(end: End | None, seen: list[Shot], writing: float) -> End | None:
    """Return the end of a source; if it dropped pictures, with the times that a picture took.

    Args:
        end: How the source ended; None for a usual end.
        seen: All tracked pictures.
        writing: Time that writing and showing them took [s].
    """
    if end is None or not end.dropped:
        return end
    tracking = sum(shot.seconds for shot in seen)
    took = [1e3 * seconds / max(len(seen), 1) for seconds in (tracking, writing)]
    sentence = (
        f"{end.sentence}; a picture took {took[0]:.0f} ms for tracking and {took[1]:.0f} ms for "
        "writing and showing"
    )
    return replace(end, sentence=sentence)


def _report(
    request: TrackRequest,
    folder: Path,
    settings: dict[str, Any],
    seen: list[Shot],
    comparison: Comparison | None,
    end: End | None,
) -> Path:
    """Write the report of a track into its folder; return the file."""
    measures = {} if comparison is None else measure_all(comparison)
    came = next((shot.picture.came for shot in seen), None)
    return TrackReport(
        command=request.command,
        versions=versions(),
        source=request.source,
        tracker=settings,
        seed=request.seed,
        frames=len(seen),
        undecodable=[shot.picture.name for shot in seen if shot.blind],
        lost=_count(seen, Status.LOST),
        unsure=_count(seen, Status.UNSURE),
        measures={name: number(value) for name, value in measures.items()},
        units={m.name: m.unit for m in MEASURES},
        end="" if end is None else end.sentence,
        start=next((s.picture.stamp / SECOND for s in seen if s.picture.stamp is not None), None),
        began="" if came is None else came.isoformat(timespec="milliseconds"),
        dropped=0 if end is None else end.dropped,
        damaged=0 if end is None else end.damaged,
        notes=_notes(seen),
    ).write(folder)


def _notes(seen: list[Shot]) -> list[str]:
    """Return the notes of the source about its pictures, each once."""
    return list(dict.fromkeys(note for shot in seen for note in shot.picture.notes))


def _count(seen: list[Shot], status: Status) -> int:
    return sum(shot.estimate.status is status for shot in seen)


def print_track(
    console: Console, what: str, seen: list[Shot], comparison: Comparison | None, end: End | None
) -> None:
    """Print how many frames were tracked, the measures if there is a truth, and warnings.

    Args:
        console: The output of the command.
        what: Title, such as "kams on car".
        seen: All tracked pictures.
        comparison: The track beside its truth, if there is one.
        end: How the source ended; None for a usual end.
    """
    counts = ", ".join(f"{_count(seen, s)} {s.name}" for s in (Status.UNSURE, Status.LOST))
    console.print(f"[bold]{escape(what)}[/]: {len(seen)} frames, {counts}")
    if comparison is not None:
        _print_measures(console, comparison)
    _print_oddities(seen, end)


def _print_measures(console: Console, comparison: Comparison) -> None:
    rows = [
        [m.name, f"{value:.3g} {m.unit}".rstrip(), m.better.value, m.meaning]
        for m in MEASURES
        if np.isfinite(value := m.of(comparison))
    ]
    print_table(console, Table(("measure", "value", "better", "meaning"), rows, (0, 2, 3)))


def _print_oddities(seen: list[Shot], end: End | None) -> None:
    """Print warnings about pictures that cannot be read or change size, and a stream's end."""
    blind = [shot.picture for shot in seen if shot.blind]
    sizes = [shot for shot in seen if shot.size is not None]
    change = next((b for a, b in itertools.pairwise(sizes) if a.size != b.size), None)
    if change is not None and change.size is not None:
        width, height = change.size
        complain(
            f"the pictures change their size at {change.picture.name} to {width} x {height} px; "
            "the target is searched for at the same pixels"
        )
    if blind:
        complain(
            f"{len(blind)} of {len(seen)} pictures cannot be read, the first is "
            f"{blind[0].name} ({blind[0].reason}); their rows have the status LOST"
        )
    for note in _notes(seen):
        complain(note)
    if end is not None:
        complain(end.sentence)
