"""The command `servobench track`: run a tracker on pictures and write its track and report."""

import itertools
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
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
    print_paths,
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
from servo.report import words
from servo.scenario.fill import fill_plugin
from servo.scenario.part_names import settings_of
from servo.scenario.toml import Table, assignment, is_table, put
from sim.kinds import PartConfig
from sim.types import Array
from tracking.advice import advice
from tracking.evaluation.track import Shot, Track, follow, notes, remarks
from tracking.evaluation.track_measures import MEASURES, Comparison, measure_all
from tracking.evaluation.warm_up import warm_up
from tracking.files.json_text import number
from tracking.sequences import truth as truths
from tracking.sequences.quadrilateral import placement
from tracking.sequences.sequence import check_truth, source_of, truth_of
from tracking.sequences.sources import SECOND, End, Source
from tracking.sequences.stream import shown
from tracking.trackers import KINDS as TRACKERS
from tracking.types import Region, State, Status, Tracker


def run(
    source: str,
    region: str | None,
    topic: str | None,
    select: bool,
    tracker: str,
    changes: Sequence[str],
    seed: int,
    truth: Path | None,
    truth_format: str,
    out: Path | None,
    rerun: bool,
    rate: float,
    frames: int | None,
    quiet: bool,
    **shown_in: Any,
) -> int:
    """Track the target in the pictures of a source, and write the track and its report.

    Args:
        source: A folder of pictures, a video, a bag, a camera or an address.
        region: The target in the first picture, "X,Y,W,H[,DEG]": top left corner and size [px]
            before a clockwise rotation about its centre [deg]; None: that of the truth, or the one
            that the user draws.
        topic: The image topic of a bag; None: the only one.
        select: Whether the user draws the region.
        tracker: The tracker, such as "kams" or "kams:paper".
        changes: Changes of its settings, such as "tracker.particles=80".
        seed: Seed of the tracker's random numbers.
        truth: A file of the truth; None: that in the folder of the pictures, if there is one.
        truth_format: "otb", "vot", "tld", "csv" or "auto".
        out: The folder to write; None: the next free runs/SOURCE-TRACKER-SEED.
        rerun: Whether to write a Rerun recording.
        rate: Frame rate of a folder of pictures [Hz].
        frames: Largest number of pictures to track; None: all.
        quiet: Whether to print on stderr only: mistakes and warnings.
        **shown_in: Options for films, logs and viewers: the fields of `Outputs`, by name.

    Returns:
        The exit code: 1 if the stream broke off or a picture could not be read, that of a signal
        that stopped the command, else 0.

    Raises:
        Mistake: The source, its truth, the region or the tracker is wrong, the tracker fails, an
            option does not fit, or the folder cannot be used.
        Refused: The video or the recording could not be written completely.
    """
    settings, config = tracker_of(tracker, changes)
    kind = str(settings["kind"])
    outputs = Outputs(**shown_in)
    outputs.check()
    console = Console(quiet=quiet)
    with as_mistake():
        stream = source_of(source, rate, topic)
        source = shown(source)
        true = _truth(truth, truths.Format.named(truth_format), source, stream)
        if stream.count is None:
            _warm_up(config, console, rerun=rerun)
        pictures = iter(stream)
        if select:
            from servo.cli import region_page  # jinja2 takes a while to import

            region, pictures = region_page.select(source, pictures, region)
        target, start = _placement(region, source, true)
    if true is not None and len(true) == 1 and stream.count != 1:
        complain(
            f"the truth has only one line for {stream.count} pictures, so no measures are computed"
        )
        true = None
    shots = itertools.islice(follow(built(config, seed), pictures, target, start), frames)
    stem = Path(source.replace(":", "-")).stem.encode(errors="replace").decode()
    name = f"{stem}-{kind.replace(':', '-')}-{seed}"
    viewer = outputs.viewer()  # before the first picture of a stream, which goes on
    first = _first(shots, source, out, name)
    folder = prepare(out, name)
    announce(viewer, console)
    # A live source does not wait: advice would take time and so cost pictures.
    if stream.count is not None and first.picture.image is not None:
        plain(console, advice(config, first.picture.image, target, start))
    title = f"{kind} on {name}"
    more = outputs.of_track(target, stream, title, viewer)
    total = min(filter(None, (stream.count, frames)), default=None)
    try:
        files = TrackFolder(folder, target, recording=rerun, more=more)
        every = itertools.chain([first], shots)
        seen, code = _write(files, true, every, total, console)
    except PartFailed as error:
        raise with_traceback(error, folder) from None
    comparison = Comparison.of(Track.of(seen, target), true) if true is not None and seen else None
    end = _with_reason(stream.end, seen, files.seconds)
    again = command_line(
        "track",
        source,
        region=region,
        topic=topic,
        tracker=tracker,
        set=list(changes),
        seed=seed,
        truth=truth,
        truth_format=truth_format,
        rerun=rerun,
        rate=f"{rate:g}",
        frames=frames,
    )
    report = _report(again, source, settings, seed, seen, comparison, end).write(folder)
    print_track(console, title, seen, comparison, end)
    print_paths(console, [*files.paths, report])
    if code == 0:
        linger(viewer, console)
    if files.refused is not None:
        raise files.refused
    is_whole = not any(shot.blind for shot in seen) and (end is None or not end.lost)
    return code or (0 if is_whole else REFUSED)


def built(config: PartConfig[Tracker], seed: int) -> Tracker:
    """Build a tracker from its settings, and return it in a wrapper: an exception or an invalid
    result of one of the tracker's methods then raises a `PartFailed` that names the tracker. A
    `Mistake`, a KeyboardInterrupt, a MemoryError and a ValueError of `start` pass unchanged.

    Raises:
        PartFailed: The tracker's code raised an exception while it was built, or the tracker breaks
            its contract.
        Mistake: Its settings are refused.
    """
    part = Part("tracker", config)
    return part.guarded(part.build(np.random.default_rng(seed)))


def _first(shots: Iterator[Shot], source: str, out: Path | None, name: str) -> Shot:
    """Return the first tracked picture with its estimate.

    Args:
        shots: The tracked pictures.
        source: The source, for messages.
        out: The folder for the traceback of a tracker that fails; None: the next free runs/`name`.
        name: Name of that folder.

    Raises:
        Mistake: The tracker failed or refuses the region, there is no picture, or the first one
            cannot be read.
    """
    try:
        with as_mistake():
            return next(shots)
    except PartFailed as error:
        raise with_traceback(error, prepare(out, name)) from None
    except StopIteration:
        raise Mistake(f"{source}: this source has no pictures: give another one") from None


def _warm_up(config: PartConfig[Tracker], console: Console, *, rerun: bool) -> None:
    """Run the tracker and the writer of the recording on noise, so that both are compiled before a
    live source begins.

    A live source does not wait: compiling after its first picture would lose a second of it.
    """
    with waiting(console, WAITING):
        seen = warm_up(config)
        with TemporaryDirectory() as place:
            files = TrackFolder(Path(place), Region(1.0, 1.0), recording=rerun)
            for shot in seen:
                files.add(shot, None)
            files.close()


def tracker_of(kind: str, changes: Sequence[str]) -> tuple[Table, PartConfig[Tracker]]:
    """Return a tracker's settings in two forms: a TOML table with its `kind` and the settings that
    the command line changes, and the complete `Config`, with the defaults of all others.

    Args:
        kind: The tracker as on the command line, such as "kams" or "kams:paper".
        changes: Changes of settings, such as "tracker.particles=80".

    Raises:
        Mistake: There is no such kind or setting, or a change is not of the tracker.
    """
    table: Table = {}
    for key, value in settings_of("tracker", kind).items():
        put(table, key, value, f"--tracker {kind}")
    for item in changes:
        put(table, *assignment(item), f"--set {item}")
        if len(table) > 1:
            raise Mistake(
                f"--set {item}: track sets only settings of the tracker: write tracker.KEY=VALUE"
            )
    settings = table["tracker"]
    config = fill_plugin(TRACKERS, settings, "tracker")  # refuses what is no table
    assert is_table(settings)
    return settings, config


def _truth(truth: Path | None, form: truths.Format, source: str, stream: Source) -> Array | None:
    """Return the target's true corners (n, 4, 2) [px], nan in pictures without the target, from the
    given file or from that in a folder of pictures; None without such a file. n is the number of
    pictures, or 1 for a truth of the first picture alone.

    Raises:
        Mistake: The number of pictures is not known.
        ValueError: The truth cannot be read or does not fit the pictures.
    """
    path = truth or truth_of(source)
    if path is None:
        return None
    if stream.count is None:
        raise Mistake(
            f"{path}: the pictures of {source} cannot be counted, so a truth cannot belong to "
            "them: leave out --truth"
        )
    found = truths.read(path, form, stream.count)
    check_truth(found, stream, str(path), form, start_is_enough=True)
    if truths.has_masks(path):
        complain(f"{path}: the masks of this truth are replaced by the boxes around them")
    return found


def _placement(region: str | None, source: str, truth: Array | None) -> tuple[Region, State]:
    """Return the target's region (width, height [px]) and its state in the first picture (centre
    [px], angle [rad], scale 1), from --region, or else from the upright box around the true corners
    there.

    Raises:
        Mistake: --region has another form; or there is neither --region nor a truth, or the truth
            has no target in the first picture.
    """
    if region is not None:
        return region_of(region)
    if truth is None:
        raise Mistake(
            f"{source}: the region of the target is missing; give --region X,Y,W,H[,DEG], or a "
            "folder with a truth file"
        )
    if not np.isfinite(truth[0]).all():
        raise Mistake("the truth has no target in the first picture; give --region X,Y,W,H[,DEG]")
    return placement(truth[0])


def region_of(text: str) -> tuple[Region, State]:
    """Return a target's region (width and height [px]) and its state in the first picture (centre
    [px], theta [rad], scale 1).

    >>> region_of("40,30,30,20")[1]
    State(x=55.0, y=40.0, theta=0.0, scale=1.0)

    Args:
        text: "X,Y,W,H[,DEG]": top left corner and size [px] before a clockwise rotation about the
            centre [deg].

    Raises:
        Mistake: The text has another form.
    """
    try:
        numbers = [float(part) for part in text.split(",")]
        x, y, w, h, degrees = numbers if len(numbers) == 5 else [*numbers, 0.0]
        if not np.isfinite(numbers).all():
            raise ValueError(text)
    except ValueError:
        raise Mistake(
            f"--region {text}: this is no region: write X,Y,W,H or X,Y,W,H,DEG [px, deg]"
        ) from None
    return Region(w, h), State(x + w / 2, y + h / 2, float(np.radians(degrees)))


def _write(
    files: TrackFolder,
    truth: Array | None,
    shots: Iterable[Shot],
    total: int | None,
    console: Console,
) -> tuple[list[Shot], int]:
    """Write each tracked picture to the track's files as it comes, and show a progress bar; a
    signal ends the tracking.

    Args:
        files: The files of the track.
        truth: True corners (n, 4, 2) [px], if they are known.
        shots: The tracked pictures.
        total: Number of pictures, if it is known.
        console: The output of the command.

    Returns:
        The tracked pictures without their images, and the exit code: 0, or that of the signal.
    """
    seen: list[Shot] = []
    code = 0
    with closing(files.close), as_mistake():
        try:
            with progress_bar(console) as bar:
                task = bar.add_task("track", total=total, note=COMPILING)
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
    """Return the end of a source; if the source dropped pictures, its sentence gets the mean times
    for tracking and writing a picture.

    Args:
        end: How the source ended; None for a usual end.
        seen: All tracked pictures.
        writing: Time that writing and showing them took [s].
    """
    if end is None or not end.dropped:
        return end
    tracking = sum(shot.seconds for shot in seen)
    each = 1e3 / max(len(seen), 1)
    return replace(
        end,
        sentence=(
            f"{end.sentence}; a picture took {each * tracking:.0f} ms for tracking and "
            f"{each * writing:.0f} ms for writing and showing"
        ),
    )


def _report(
    command: str,
    source: str,
    tracker: Table,
    seed: int,
    seen: list[Shot],
    comparison: Comparison | None,
    end: End | None,
) -> TrackReport:
    """Return the report of a track; `tracker` has the tracker's settings."""
    measures = {} if comparison is None else measure_all(comparison)
    count = Counter(shot.estimate.status for shot in seen)
    came = next((shot.picture.came for shot in seen), None)
    return TrackReport(
        command=command,
        versions=versions(),
        source=source,
        tracker=tracker,
        seed=seed,
        frames=len(seen),
        undecodable=[shot.picture.name for shot in seen if shot.blind],
        lost=count[Status.LOST],
        unsure=count[Status.UNSURE],
        measures={name: number(value) for name, value in measures.items()},
        units={m.name: m.unit for m in MEASURES},
        end="" if end is None else end.sentence,
        start=next((s.picture.stamp / SECOND for s in seen if s.picture.stamp is not None), None),
        began="" if came is None else came.isoformat(timespec="milliseconds"),
        dropped=0 if end is None else end.dropped,
        damaged=0 if end is None else end.damaged,
        notes=notes(seen),
    )


def print_track(
    console: Console, what: str, seen: list[Shot], comparison: Comparison | None, end: End | None
) -> None:
    """Print how many frames were tracked, the measures of the track if there is a truth, and on
    stderr warnings about pictures.

    Args:
        console: The output of the command.
        what: Title, such as "kams on car".
        seen: All tracked pictures with their estimates.
        comparison: The track beside its truth, if there is one.
        end: How the source ended; None for a usual end.
    """
    count = Counter(shot.estimate.status.name for shot in seen)
    sums = f"{len(seen)} frames, {count['UNSURE']} UNSURE, {count['LOST']} LOST"
    console.print(f"[bold]{escape(what)}[/]: {sums}")
    if comparison is not None:
        rows = [
            [m.name, f"{value:.3g} {m.unit}".rstrip(), m.better.value, m.meaning]
            for m in MEASURES
            if np.isfinite(value := m.of(comparison))
        ]
        print_table(
            console, words.Table(("measure", "value", "better", "meaning"), rows, (0, 2, 3))
        )
    complain(*remarks(seen), *([] if end is None else [end.sentence]))
