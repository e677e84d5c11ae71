"""The command `servobench twin`: compare a robot's log with the film of its camera, estimate how
the robot follows its commands, and write the scenario that simulates both.
"""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path

import numpy as np
import pyarrow as pa
import tomli_w
from rich.console import Console
from scipy.spatial.transform import Rotation

from servo.cli.identify_command import estimated
from servo.cli.jobs import progress
from servo.cli.preflight_command import (
    PAGE,
    Given,
    after,
    comparison,
    made,
    show,
    stated_mount,
)
from servo.cli.terminal import complain, plain, print_table, waiting
from servo.cli.track_command import built, region_of, tracker_of
from servo.identify.lines import UNTRUSTED
from servo.loop.episode import Episode
from servo.mistake import Mistake, as_mistake, writing
from servo.output.run_folder import prepare
from servo.report.page import Block, PageImage, render
from servo.scenario.load import load, parse
from servo.scenario.part_names import named_part
from servo.scenario.toml import copied, drop, with_settings
from servo.twin import section as sections
from servo.twin.compare import Comparison
from servo.twin.other_trackers import CENTRE, Answers, Tracked, recorded
from servo.twin.readings import command_log, film
from servo.twin.replay import FILM, RECORDING, room_in, turned_by, write_replay
from servo.twin.verdict import MM, angles_text, ms_text, place_text
from sim.channels import Channel, needs_of
from sim.kinds import PartConfig
from sim.types import Camera, Image
from tracking.drawing.picture_bytes import encoded
from tracking.evaluation.track import Shot, follow
from tracking.files import atomic
from tracking.types import Tracker

SCENARIO = "twin.toml"
DEFAULT = "line"
DROPPED = ("vary", "expect", "sweep")
"""Tables that draw settings of the scenario to begin with, or judge it."""
STILLS = 3
TURNED = (
    "The film's plane is not level, or not at height 0 in the frame of the log's poses (a log of "
    "joints has those of the scenario's room): the simulated scene is placed by it, may be turned "
    "about the vertical, and then differs everywhere."
)
PLACED = (
    "The film's plane is level and at height 0 in the frame of the log's poses (a log of joints "
    "has those of the scenario's room), as the simulated table's top."
)


def run(
    log: Path,
    video: str | None,
    base: str | None,
    tracker: Sequence[str],
    region: str | None,
    no_replay: bool,
    out: Path | None,
    **options: object,
) -> int:
    """Compare a robot's log with the film of its camera (or a bag that holds both, if `video` is
    None), and write the scenario that simulates the robot, a film and a Rerun recording of the
    recording beside its simulation, and a page. Film and recording are left out if the pose of the
    camera in the hand is too uncertain, or if the camera stands still.

    Args:
        log: The robot's log.
        video: The film of its camera; None: it is in the log, which is a bag.
        base: The scenario to begin with; None: that of the log's joints, or "line".
        tracker: Trackers to run on the recorded pictures, as NAME or NAME=WHAT.
        region: The target in the film's first picture, for them: "X,Y,W,H[,DEG]" [px, deg].
        no_replay: True to leave out the film and the Rerun recording.
        out: The folder to write; None: the next free runs/twin-LOG.
        **options: The other fields of `Given`, by name.

    Returns:
        The exit code: 1 if something is wrong or refused (too uncertain to be stated), else 0.

    Raises:
        Mistake: The log, the film or the scenario cannot be used.
    """
    given = Given.of(log, video, **options)
    console = Console()
    scenario = base or given.scenario or DEFAULT
    begun_with = load(scenario)
    stands = begun_with.camera.mounted == "world"
    if stands != given.eye_to_hand:
        raise Mistake(
            f'{scenario}: --eye-to-hand and --on a scenario with camera.mounted = "world" belong '
            "together: give both or neither"
        )
    table = given.table()
    _check_trackers(table, base, tracker, region)
    compared, camera, begins = comparison(given, table)
    show(compared)
    changes, notes = _changes(given, table, compared, camera, scenario)
    omitted = left_out(begun_with.table, scenario)
    if omitted:
        notes = {"0": omitted} | notes
    folder = prepare(out, f"twin-{log.stem}")
    text = toml(scenario, changes, notes)
    with writing(folder):
        written = atomic.write(folder, SCENARIO, text)
    plain(console, f"{written}: servobench run {written}")
    if omitted:
        plain(console, omitted)
    plain(console, *(note for note in notes.values() if note.startswith(UNTRUSTED)))
    blocks = [Block("The scenario", code=[text])]
    if region is not None:
        blocks.append(_others(given, table, compared, begins, base, tracker, region, console))
    if no_replay:
        plain(console, "no replay: --no-replay")
    elif stands:
        plain(console, "no replay: the film does not show where the target is in the hand")
    elif compared.verdict.mount is not None:
        plain(
            console,
            f"{SCENARIO} is complete; the rest is the film of the replay, which Ctrl-C ends early",
        )
        blocks += _replay(given, compared, camera, begins, written, folder, console)
    else:
        plain(console, "no replay: the mount is refused")
    again = made(given, "twin", on=base, tracker=tracker, region=region, no_replay=no_replay)
    with writing(folder):
        section = sections.section(compared, folder, again, blocks, kind="twin")
        page = atomic.write(folder, PAGE, render([section]))
    plain(console, str(page), after(compared, f"servobench tune {written}"))
    return 0 if compared.verdict.is_good else 1


def _changes(
    given: Given, table: pa.Table, compared: Comparison, camera: Camera, scenario: str
) -> tuple[dict[str, object], dict[str, str]]:
    """Return the settings that a recording shows, by dotted key, and comments by the key of their
    setting. Comments with a key without a dot, such as "1", are about what is not known, and about
    mistakes in the recording.
    """
    verdict, mount = compared.verdict, compared.fits.mount
    changes: dict[str, object] = {}
    notes: dict[str, str] = {}
    try:
        with waiting(Console(stderr=True), "estimating delay, lag, play and noise"):
            hand = compared.motion.inverse if given.eye_to_hand else compared.motion
            _, text = estimated(command_log(table, given.log, hand), scenario)
    except Mistake as error:
        complain(f"delay, lag and play are not known: {error}")
        notes["1"] = f"delay, lag and play are not known: {error}"
    else:
        for part, keys in tomllib.loads(text).items():
            changes |= {f"{part}.{key}": value for key, value in keys.items()}
        notes |= _comments(text)
    for key, (value, note) in _of_camera(given, compared, camera).items():
        changes[f"camera.{key}"] = value
        notes[f"camera.{key}"] = note
    if verdict.offset is not None:
        offset, half = mount.offset, mount.halves[0]
        if verdict.mount is None:
            offset, half = verdict.offset.value, verdict.offset.half
        changes["believed.clock_offset_ms"] = round(-MM * offset, 2) + 0.0
        notes["believed.clock_offset_ms"] = (
            f"stamp of a picture minus its true time, so the offset of the pre-flight with the "
            f"other sign, +- {MM * half:.2f} ms: 0 as soon as your driver adds {ms_text(offset)} "
            "ms to each stamp"
        )
    else:
        notes["4"] = "clock_offset_ms: not known; the row 'clock offset' of the table says why"
    stated = stated_mount(given, table)
    if verdict.mount is not None and stated is not None:
        vector, place = turned_by(stated, mount)
        half = np.degrees(mount.halves[1:4].max())
        changes["believed.hand_eye_rotation_deg"] = np.degrees(vector).round(3).tolist()
        notes["believed.hand_eye_rotation_deg"] = (
            "the stated camera as the found one sees it (x right, y down, z forward), a rotation "
            f"vector, +- {half:.2f} deg: not a difference of roll, pitch and yaw; 0 as soon as "
            f"your program has {angles_text(mount)} deg"
        )
        if verdict.has_lever and abs(place).max() < 1:
            changes["believed.hand_eye_mm"] = (MM * place).round(2).tolist()
            notes["believed.hand_eye_mm"] = (
                f"stated minus found position, along the found camera's axes, +- "
                f"{MM * mount.halves[4:7].max():.1f} mm: 0 as soon as your program has "
                f"{place_text(mount)} mm in the {'base' if given.eye_to_hand else 'hand'}"
            )
    else:
        notes["2"] = "hand_eye: not known; it needs a mount that is not refused, and --mount"
    notes["3"] = "mistakes in the recording: " + ("; ".join(verdict.mistakes) or "none found")
    return changes, notes


def _of_camera(given: Given, compared: Comparison, camera: Camera) -> dict[str, tuple[object, str]]:
    """Return the settings of the camera that a recording shows, by their names in the table
    [camera], each with a comment or "".
    """
    verdict, mount = compared.verdict, compared.fits.mount
    rate = _rate(compared)
    found: dict[str, tuple[object, str]] = {
        "width": (camera.width, ""),
        "height": (camera.height, ""),
        "rate": (rate, ""),
    }
    if given.late:
        found["exposure"] = (given.exposure_ms or 0.0) / 1e3 * rate, ""
        found["readout_ms"] = given.readout_ms or 0.0, ""
    if given.calibration is not None:
        found["calibration"] = str(given.calibration.resolve()), ""
    elif given.fov is not None or verdict.mount is not None:
        source = "found" if mount.focal != 1 else "given" if given.fov else "assumed"
        found["fx"] = round(camera.fx * mount.focal, 2), source
    if given.eye_to_hand and verdict.has_lever:
        angles = Rotation.from_matrix(mount.rotation).as_euler("xyz", degrees=True)
        place = [*mount.lever.round(4).tolist(), *angles.round(2).tolist()]
        found["pose"] = place, "in the base's frame: that of the room, if the base is at its origin"
    return found


def _rate(compared: Comparison) -> float:
    """Return the film's rate [Hz], from the median interval of its pictures: a whole number if that
    is within 2 %, else with two decimals.
    """
    rate = 1 / float(np.median(np.diff(compared.fits.tracks.times)))
    return round(rate) if abs(rate - round(rate)) < 0.02 * rate else round(rate, 2)


def _comments(text: str) -> dict[str, str]:
    """Return the comments in a text of TOML: those behind a setting by its dotted key ("" without a
    comment), those on lines of their own by "line N", with N counted from 0.
    """
    notes: dict[str, str] = {}
    part = ""
    for number, line in enumerate(text.splitlines()):
        if line.startswith("["):
            part = line.strip("[]")
        elif line.startswith("#"):
            notes[f"line {number}"] = line.removeprefix("# ")
        elif " = " in line:
            notes[f"{part}.{line.partition(' = ')[0]}"] = line.partition("#")[2].strip()
    return notes


GIVES_LENS = ("camera.fx", "camera.calibration")
"""Settings of a recording's lens, which replaces that of the scenario."""
LENS = (
    *GIVES_LENS,
    "camera.fovy_deg",
    "camera.fy",
    "camera.cx",
    "camera.cy",
    "camera.distortion",
    "camera.coefficients",
)
"""All settings of a lens."""


def toml(scenario: str, changes: dict[str, object], notes: dict[str, str]) -> str:
    """Return the TOML of a scenario with changed settings, and with comments. The tables `vary`,
    `expect` and `sweep` are left out.

    Args:
        scenario: A shipped scenario or a TOML file.
        changes: Values by dotted key.
        notes: Comments, by the dotted key of the setting above which they stand, or by a key
            without a dot for those at the head.

    Raises:
        Mistake: A setting is not possible.
    """
    own = copied(load(scenario).table)
    if not changes.keys().isdisjoint(GIVES_LENS):
        for key in LENS:  # a scenario's lens is for pictures of its own size
            drop(own, key)
    whole = with_settings(own, changes, scenario)
    parse(copied(whole), Path(scenario).stem, scenario)
    table = {key: value for key, value in whole.items() if key not in DROPPED}
    part = ""
    lines = [f"# the robot of a recording, on the scenario {scenario}"]
    lines += [f"# {note}" for key, note in notes.items() if "." not in key]
    for line in tomli_w.dumps(table).splitlines():
        part = line.strip("[]") if line.startswith("[") else part
        note = notes.get(f"{part}.{line.partition(' = ')[0]}", "")
        lines += [f"# {note}"] if note else []
        lines.append(line)
    return "\n".join(lines) + "\n"


def left_out(table: Mapping[str, object], scenario: str) -> str:
    """Return a sentence that names the tables of a scenario that the twin's scenario leaves out; ""
    if it leaves out none.

    Args:
        table: The whole table of the scenario.
        scenario: Its name, for the sentence.
    """
    dropped = ", ".join(f"[{key}]" for key in DROPPED if key in table)
    if not dropped:
        return ""
    alike = ": without [vary] all seeds start alike" * ("vary" in table)
    return f"left out: {dropped} of {scenario}, which were for its own robot; add your own{alike}"


def _replay(
    given: Given,
    compared: Comparison,
    camera: Camera,
    begins: float,
    scenario: Path,
    folder: Path,
    console: Console,
) -> list[Block]:
    """Write a film (MP4) and a Rerun recording of the recorded pictures beside their simulation,
    and return the page's block about them.
    """
    source, pictures = film(given.video, given.rate, given.topic, given.stamps)
    path = folder / FILM
    count = source.count or len(compared.fits.tracks.times)
    room = room_in(compared)
    placed = PLACED if room is None else TURNED
    with (
        Episode(load(scenario), seen=False) as episode,
        writing(folder),
        progress(console, "drawing again", count) as tick,
    ):
        found = write_replay(pictures, begins, compared, camera, room, episode, folder, tick)
    text = f"median difference {np.median(found):.1f} of 255 grey levels"
    plain(console, f"{path}: film and simulation; {text}", placed)
    plain(console, f"servobench view {folder / RECORDING}")
    stills = [
        PageImage.of("", encoded(each), FILM, sheet=True)
        for each in islice(_stills(path, len(found)), STILLS)
    ]
    return [
        Block(
            "Film, simulation at the recorded posture, difference",
            [
                f"The whole film is {FILM}, and {RECORDING} for `servobench view`; {text}: half of "
                "the pixels of half of the pictures differ by less. The scene is that of "
                f"{scenario.name}: only things that it has can agree. {placed}"
            ],
            pictures=stills,
        )
    ]


def _check_trackers(
    table: pa.Table, base: str | None, tracker: Sequence[str], region: str | None
) -> None:
    """Check that what is needed to judge other trackers is given.

    Raises:
        Mistake: Something is missing or wrong.
    """
    if not tracker and region is None:
        return
    if not tracker or region is None:
        raise Mistake(
            "--tracker and --region X,Y,W,H[,DEG], the target in the film's first picture, belong "
            "together: give both or neither"
        )
    region_of(region)
    for text in tracker:
        tracker_of(named_part("tracker", text)[1], ())
    if _own_tracker(base) is None and not set(CENTRE) <= set(table.column_names):
        raise Mistake(
            "--tracker needs what the recorded run estimated: the log's columns "
            f"{' and '.join(CENTRE)}, or --on with the scenario whose tracker it had (not truth)"
        )


def _own_tracker(base: str | None) -> PartConfig[Tracker] | None:
    """Return the settings of a scenario's tracker; None if there is no scenario, or if its tracker
    needs the truth, which a recording does not have.
    """
    config = None if base is None else load(base).tracker
    return None if config is None or Channel.TRUTH in needs_of(config) else config


def _others(
    given: Given,
    table: pa.Table,
    compared: Comparison,
    begins: float,
    base: str | None,
    tracker: Sequence[str],
    region: str,
    console: Console,
) -> Block:
    """Run trackers on the pictures of a recording, print whether each would have held, and return
    the page's block about them.

    Raises:
        Mistake: A tracker refuses the region, or fails; or neither the log nor the tracker of the
            scenario `base` gives the recorded run's estimates.
    """
    target, start = region_of(region)

    def tracked(name: str, config: PartConfig[Tracker]) -> Tracked:
        source, pictures = film(given.video, given.rate, given.topic, given.stamps)
        count = source.count or len(compared.fits.tracks.times)
        shots: list[Shot] = []
        with progress(console, name, count) as tick, as_mistake():
            for shot in follow(built(config, 0), pictures, target, start):
                shots.append(shot.without_picture())
                tick(f"{name} {shot.estimate.status.name}")
        return Tracked.of(name, shots, target)

    configs = [named_part("tracker", text) for text in tracker]
    found = [tracked(name, tracker_of(what, ())[1]) for name, what in configs]
    config = _own_tracker(base)
    own = None if config is None else tracked(f"that of {base}", config)
    # A log has the stamps of the pictures, and `begins` the time at which the first was exposed.
    states = recorded(table, given.log, begins + given.late + found[0].times)
    if states is None and own is not None:
        states = own.states
    if states is None:
        raise Mistake(f"{given.log}: {' and '.join(CENTRE)} have no numbers in the film's time")
    answers = Answers(target, states, own, found)
    print_table(console, answers.table)
    plain(console, answers.sentence)
    drawing = PageImage.of("", answers.drawing().png(), "trackers", sheet=False)
    title = "Would another tracker have held?"
    return Block(title, [answers.sentence], tables=[answers.table], pictures=[drawing])


def _stills(path: Path, count: int) -> Iterator[Image]:
    """Yield about three pictures, evenly spaced, of a film with `count` pictures."""
    _, pictures = film(str(path), 30.0, None, None)
    for number, picture in enumerate(pictures):
        if picture.image is not None and number % max(1, count // STILLS) == count // (2 * STILLS):
            yield picture.image
