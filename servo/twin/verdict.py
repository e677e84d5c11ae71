"""What a pre-flight (a comparison of a robot's log with the film of its camera) finds, and what it
refuses to say because it is too uncertain.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import Enum
from itertools import permutations, product

import numpy as np
from scipy.spatial.transform import Rotation

from servo.twin import mount as mounts
from servo.twin.diagnosis import Diagnosis
from servo.twin.mount import Mount
from servo.twin.offset import Offset
from servo.twin.robot_motion import RobotMotion
from servo.twin.still_tag import StillTag, TagFit
from servo.twin.tracks import Tracks
from sim.geometry import angle_of
from sim.types import Array

SHALLOW = 3.0
"""Least depth of the offset's curve."""
VAGUE_OFFSET = 20e-3
"""Largest half interval of an offset [s]."""
VAGUE_TURN = np.radians(2.0)
"""Largest half interval of the mount's rotation [rad]."""
VAGUE_LEVER = 0.03
"""Largest half interval of the lever [m]."""
TURNS = 0.02
"""Least rate of turning about the second axis with which a lever is stated, root mean square
[rad/s]."""
SLIDES = 0.005
"""Least velocity of sliding along the second axis with which the rotation of a mount is stated if
the hand turns less than `TURNS`, root mean square [m/s]."""
SCATTERED = 3.0
"""Largest scatter of the scene's planes."""
MANY_STRAY = 0.1
"""Share of points off the fit above which a part of the scene itself seems to move: 0.08 at most in
simulated recordings with a small car that moves, 0.13 in a real one with a hand in view."""
STRAY_BESIDE = 0.3
"""The same for a camera that stands, before which points beside what is carried, and at its edges,
are off the fit, too: 0.1 where nothing else moves."""
DARK = 0.3
"""Share of dark pictures above which a film is too dark."""
LATE = 5e-3
"""Least offset of the clocks for which the row about it says what to change [s]."""
DRIFTS = 2e-4
"""Least drift of the clocks that is reported [s/s]."""
FOCAL_OFF = 0.05
"""Least relative error of the focal length that is reported."""
TURNED = np.radians(8.0)
"""Largest angle between a mount and a turn by right angles that is named as such; also the angle by
which `preferred` tells explanations apart if one of them is as near to the stated mount [rad]."""
FAR = np.radians(30.0)
"""Angle by which `preferred` tells explanations apart if none is so near [rad]."""
APART = np.radians(2.0)
"""Least turn between the linear and the angular part of a log that is reported [rad]."""
MIXED = (
    "log v and w in the hand's frame, or position and orientation in the base's; check the zeros "
    "of the joints"
)
ALIKE = np.radians(1.0)
CLOSE = 0.01
"""Added to the intervals within which a stated mount counts as right [rad, m]."""
MOUNT_OPTION = "--mount"
"""The option by which a user states the mount."""
STEP = 0.05
"""Time over which a rate is taken, so that noise is small [s]."""
PARTS = np.s_[:3], np.s_[3:]
MM = 1e3


@dataclass(frozen=True, slots=True)
class Trust:
    """What is known of the camera before a comparison of a robot's log with its film."""

    focal: bool = False
    """Whether the focal length is calibrated."""
    along: float | None = None
    """Distance from the hand's origin to the camera along the optical axis [m]; None: unknown."""
    believed: Mount | None = None
    """The mount (pose of the camera in the hand) that the user states; None: none."""
    late: float = 0.0
    """Time from the middle of a picture's exposure to its stamp [s], which is already subtracted
    from the film's times; 0: unknown."""
    tag: StillTag | None = None
    """A tag that, as the user says, stands still in the film; None: there is none."""
    stamped: bool = True
    """Whether the film's times are stamps, as the robot's program uses them; False: the film was
    placed where it fits the log, or where the user says."""
    stated_by: str = MOUNT_OPTION
    """What states the mount, in the words of the verdict's rows."""
    is_relative: bool = False
    """Whether the poses of the log have a mount already, to which the found one is relative."""


@dataclass(frozen=True, slots=True)
class Fits:
    """What was fitted to a robot's log and the film of its camera, before it is judged."""

    offset: Offset
    """Offset of the film's clock."""
    diagnosis: Diagnosis
    """The corrections that explain the recording."""
    mount: Mount
    """The mount of the camera, with these corrections."""
    turned: Mount
    """The same with a turn between the linear and the angular part of the twists."""
    tracks: Tracks
    """Points that were followed through the film."""
    axes: tuple[float, float]
    """The hand's sliding [m/s] and turning [rad/s] along its second axis, from `second_axes`."""
    stands: bool = False
    """Whether the camera stands in the room, and sees the hand (eye-to-hand)."""
    tag: TagFit | None = None
    """What a tag in the film shows; if the tag stands still, `mount` comes from it. None: no tag
    was fitted."""

    @property
    def most_stray(self) -> float:
        """Largest share, from 0 to 1, of the points followed in the film that may be off the fit;
        above it no mount of the camera is stated.
        """
        return STRAY_BESIDE if self.stands else MANY_STRAY


class State(Enum):
    """Result of one row of a pre-flight's table; the value is its sentence in the legend."""

    OK = "as stated"
    ADJUST = "the robot can follow, but pairs pictures with wrong postures until it is changed"
    WRONG = "it may drive off"
    REFUSED = "too uncertain to be stated"
    UNKNOWN = "not looked at, as something was not given"


@dataclass(frozen=True, slots=True)
class Finding:
    """A row of the table of a pre-flight (a comparison of a robot's log with the film of its
    camera): what was looked at, what was found, what to change, whether the robot may move as it
    is, and whether the change needs a new recording.
    """

    what: str
    found: str
    change: str = ""
    """What to change; empty: nothing."""
    state: State = State.OK
    needs_recording: bool = True
    """Whether the change, if there is one, needs a new recording; False: this one is enough."""

    @property
    def is_good(self) -> bool:
        """False if the robot must not move by its camera before the change; a row that is only to
        be adjusted is good.
        """
        return self.state not in (State.WRONG, State.REFUSED)


@dataclass(frozen=True, slots=True)
class Verdict:
    """What a pre-flight (a comparison of a robot's log with the film of its camera) found, as rows
    of a table and numbers. An offset or mount that is refused as too uncertain, or not known, is
    None, and a row says why.
    """

    findings: list[Finding]
    doubts: list[str]
    offset: Offset | None
    mount: Mount | None
    """Fit of mount and offset; None if no part of it is to be trusted."""
    has_rotation: bool
    has_lever: bool
    mistakes: list[str]

    @property
    def is_good(self) -> bool:
        """True if no row says that something is wrong or refused."""
        return all(each.is_good for each in self.findings)

    @property
    def is_enough(self) -> bool:
        """True if this recording answers all, once what a row asks for is given."""
        return all(each.is_good or not each.needs_recording for each in self.findings)

    @property
    def limits(self) -> list[str]:
        """Limits of a good verdict, up to three phrases: "adjust: " and "unknown: " with the names
        of these rows, and "in doubt" if there are doubts.
        """
        found: list[str] = []
        for word, state in (("adjust", State.ADJUST), ("unknown", State.UNKNOWN)):
            names = ", ".join(each.what for each in self.findings if each.state is state)
            found += [f"{word}: {names}"] * bool(names)
        return found + ["in doubt"] * bool(self.doubts)

    @property
    def summary(self) -> str:
        """Whether the robot may move by its camera, in a few words: "ready", with what limits it,
        or "not ready".
        """
        if not self.is_good:
            return "not ready"
        return f"ready, but {'; '.join(self.limits)}" if self.limits else "ready"


def second_axes(moved: RobotMotion, tracks: Tracks) -> tuple[float, float]:
    """Return how fast the hand slides [m/s] and turns [rad/s] along the second strongest axis of
    each motion, root mean square, while the film runs. Both are small for a motion along or about
    one axis only, which does not show the camera's mount.

    Args:
        moved: Motion of the robot's hand.
        tracks: Points that were followed, with the times of the film.
    """
    times = np.arange(tracks.times[0], tracks.times[-1], STEP)
    twists = moved.twists(times, times + STEP)
    slides, turns = (np.linalg.svd(twists[:, part], compute_uv=False)[1] for part in PARTS)
    return float(slides / np.sqrt(len(times))), float(turns / np.sqrt(len(times)))


def judge(fits: Fits, trust: Trust) -> Verdict:
    """Return the verdict of a pre-flight: what is right, wrong, or too uncertain to be stated.

    Args:
        fits: What was fitted to log and film.
        trust: What is known of the camera.
    """
    mount = fits.mount
    believed = trust.believed
    findings: list[Finding] = []
    no_offset = _no_offset(fits.offset)
    if no_offset:
        findings.append(no_offset)
    mistakes = [each.mistake for each in fits.diagnosis.best.corrections]
    if not no_offset and max(fits.axes[0] / SLIDES, fits.axes[1] / TURNS) >= 1:
        findings += _of_diagnosis(fits.diagnosis)
    is_turned = any(each.turn is not None for each in fits.diagnosis.best.corrections)
    # What moves by itself in the scene looks like such a turn.
    is_shown = not is_turned and not no_offset and fits.turned.stray <= fits.most_stray
    mixed = _mixed(fits.turned) if is_shown else ""
    if mixed:
        mistakes.append(mixed)
        findings.append(Finding("mistake", mixed, MIXED, State.WRONG))
    why = "the clock offset is not known" if no_offset else mixed
    no_mount = _no_mount(why, fits, stated=believed is not None)
    shows_tag = fits.tag is not None and fits.tag.is_still
    shows_focal = shows_tag or (trust.along is not None and not trust.focal)
    known = trust.focal or shows_focal
    no_lever = _no_lever(no_mount, fits, known=known)
    if not no_offset:
        fit = None if no_mount else mount
        findings += _of_clocks(fits.offset, fit, float(fits.tracks.times[0]), trust)
    if no_mount:
        findings.append(no_mount)
    else:
        findings.append(_rotation(mount, believed))
        if believed is not None:
            findings += _against_believed(mount, believed, trust, mistakes, has_lever=not no_lever)
    findings.append(no_lever or _lever(mount, believed))
    if not no_mount:
        findings += _of_scale(mount, fits.tag, shows_focal=shows_focal, known=known)
    return Verdict(
        findings,
        _of_film(fits.tracks),
        fits.offset if trust.stamped and not no_offset else None,
        None if no_mount else mount,
        not no_mount,
        not no_lever,
        mistakes,
    )


RECORD = "record 30 s of the motion that `servobench preflight --wiggle FILE` writes"
STILL_SCENE = f"{RECORD}, before a scene in which nothing moves"
FOCAL = "give --calibration, --fov, --along or --tag-mm: this recording is enough"
DRAWING = "give --mount from your drawing, which tells them apart: this recording is enough"


def _refusal(what: str, cases: Iterable[tuple[bool, str, str, bool]]) -> Finding | None:
    """Return the row about a value that is too uncertain to be stated; None if it can be stated.

    Args:
        what: The value.
        cases: Whether each possible reason applies, its sentence, what to change, and whether that
            needs a new recording. The first reason that applies is given.
    """
    for applies, why, change, needs in cases:
        if applies:
            return Finding(what, why, change, State.REFUSED, needs)
    return None


def _no_offset(offset: Offset) -> Finding | None:
    """Return the row about an offset that is refused; None if it is not."""
    cases = (
        (
            offset.depth < SHALLOW,
            f"the motion in the film does not show it (depth of the curve {offset.depth:.2f}, at "
            f"least {SHALLOW:g} is needed)",
            RECORD,
            True,
        ),
        (
            offset.at_end,
            "the best one is at the end of the search of 1 s",
            "give the film's begin with --begins: this recording is enough",
            False,
        ),
        (
            offset.half > VAGUE_OFFSET,
            f"it is uncertain by {MM * offset.half:.0f} ms (at most {MM * VAGUE_OFFSET:.0f})",
            RECORD,
            True,
        ),
    )
    return _refusal("clock offset", cases)


def _no_mount(why: str, fits: Fits, *, stated: bool) -> Finding | None:
    """Return the row about a mount whose rotation is refused; None if it is not.

    Args:
        why: Why it is refused whatever the fit is; empty: it is not.
        fits: What was fitted to log and film.
        stated: Whether the user states a mount.
    """
    diagnosis = fits.diagnosis
    mount = fits.mount
    apart = [
        angle_of(diagnosis.best.mount.rotation.T @ other.mount.rotation)
        for other in diagnosis.others
    ]
    vague = float(mount.halves[1:4].max())
    cases = (
        (bool(why), why, RECORD, True),
        (
            fits.axes[1] < TURNS and fits.axes[0] < SLIDES,
            "the hand moves along or about one axis only",
            RECORD,
            True,
        ),
        (
            max(apart, default=0.0) > VAGUE_TURN,
            "it differs between the mistakes that explain the recording",
            RECORD if stated else DRAWING,
            stated,
        ),
        (
            any(
                each.frames is not None or each.turn is not None
                for each in diagnosis.best.corrections
            ),
            "motion in another frame does not show how the hand is turned in it",
            RECORD,
            True,
        ),
        (
            not diagnosis.is_good,
            "neither the log as it is nor any mistake of the list explains the film",
            RECORD,
            True,
        ),
        (
            mount.scatter > SCATTERED or mount.plane[2] <= 0,
            f"no plane fits the scene (scatter {mount.scatter:.1f}, at most {SCATTERED:g})",
            RECORD,
            True,
        ),
        (
            vague > VAGUE_TURN,
            f"it is uncertain by {np.degrees(vague):.1f} deg (at most {np.degrees(VAGUE_TURN):g})",
            RECORD,
            True,
        ),
        (
            mount.stray > fits.most_stray,
            f"{100 * mount.stray:.3g} % of the points (at most {100 * fits.most_stray:g}) do not "
            "move with the scene: a part of it moves by itself, or is very near",
            STILL_SCENE,
            True,
        ),
    )
    return _refusal("mount: rotation", cases)


def _mixed(turned: Mount) -> str:
    """Return a sentence that the linear and the angular part of a log are in two frames; an empty
    text if the turn between them is not clear.
    """
    angle = angle_of(turned.turn)
    half = float(turned.halves[list(mounts.TURN)].max())
    if angle < max(APART, 2 * half):
        return ""
    return (
        f"the hand's slides are turned against its turns by {np.degrees(angle):.1f} deg, "
        f"+- {np.degrees(half):.1f}"
    )


def _no_lever(no_mount: Finding | None, fits: Fits, *, known: bool) -> Finding | None:
    """Return the row about a lever that is refused; None if it is not.

    Args:
        no_mount: The row about a rotation that is refused, which says what to change for both.
        fits: What was fitted to log and film.
        known: Whether the focal length or the lever's part along the optical axis is known.
    """
    vague = float(fits.mount.halves[4:7].max())
    cases = (
        (
            no_mount is not None,
            "its rotation is not known",
            "",
            no_mount is not None and no_mount.needs_recording,
        ),
        (
            fits.axes[1] < TURNS,
            f"the hand turns at {fits.axes[1]:.3f} rad/s about its second axis (at least "
            f"{TURNS:g})",
            RECORD,
            True,
        ),
        (
            vague > VAGUE_LEVER,
            f"it is uncertain by {MM * vague:.0f} mm (at most {MM * VAGUE_LEVER:.0f})",
            RECORD,
            True,
        ),
        (
            not known,
            "a lever along the optical axis looks as a wrong focal length does",
            FOCAL,
            False,
        ),
    )
    return _refusal("mount: lever", cases)


def angles_text(mount: Mount) -> str:
    """Return the rotation of a mount, as angles about the fixed axes x, y, z of the hand [deg], in
    a text such as "roll 5.00, pitch -10.00, yaw 20.00".
    """
    angles = Rotation.from_matrix(mount.rotation).as_euler("xyz", degrees=True)
    return "roll {:.2f}, pitch {:.2f}, yaw {:.2f}".format(*np.round(angles, 2) + 0.0)


def place_text(mount: Mount) -> str:
    """Return the position of the camera in the hand's frame [mm] as a text, such as "x 0.0, y 40.0,
    z 0.0".
    """
    return "x {:.1f}, y {:.1f}, z {:.1f}".format(*np.round(MM * mount.lever, 1) + 0.0)


def ms_text(seconds: float) -> str:
    """Return a time [s] as a text in ms, such as "79.61", without a zero that has a sign."""
    return f"{round(MM * seconds, 2) + 0.0:.2f}"


def _rotation(mount: Mount, believed: Mount | None) -> Finding:
    """Return the row about the rotation of a mount, with the one that the user states."""
    half = float(np.degrees(mount.halves[1:4].max()))
    text = f"{angles_text(mount)} deg, +- {half:.2f}"
    if believed is None:
        return Finding("mount: rotation", text)
    away = float(np.degrees(angle_of(believed.rotation.T @ mount.rotation)))
    most = half + float(np.degrees(ALIKE))
    text += f"; stated {angles_text(believed)}, "
    if away > most:
        return Finding("mount: rotation", f"{text}{away:.1f} deg away", "", State.WRONG)
    return Finding("mount: rotation", f"{text}ok up to a turn of {most:.1f} deg")


def _lever(mount: Mount, believed: Mount | None) -> Finding:
    """Return the row about the lever of a mount, with the one that the user states."""
    half = MM * float(mount.halves[4:7].max())
    text = f"{place_text(mount)} mm, +- {half:.1f}"
    if believed is None:
        return Finding("mount: lever", text)
    text += f"; stated {place_text(believed)}, "
    off = _off(mount, believed)
    if not _is_near(off, mount):
        away = MM * np.linalg.norm(off)
        return Finding("mount: lever", f"{text}{away:.0f} mm away", "", State.WRONG)
    return Finding("mount: lever", f"{text}ok up to {half + MM * CLOSE:.0f} mm along each axis")


def _off(mount: Mount, believed: Mount) -> Array:
    """Return the position of the found camera less that of the stated one (3,) [m], along the found
    one's axes.
    """
    return mount.arm - mount.rotation.T @ believed.lever


def _is_near(off: Array, mount: Mount) -> bool:
    """Return True if a stated camera at a distance `off` (3,) [m] from the found one may be the
    same: each component is below the half interval plus 1 cm.
    """
    return bool(np.all(abs(off) < mount.halves[4:7] + CLOSE))


def _of_film(tracks: Tracks) -> list[str]:
    """Return doubts about a film."""
    sentences: list[str] = []
    if tracks.dark > DARK:
        sentences.append(f"{100 * tracks.dark:.0f} % of the pictures are dark: expose longer")
    if tracks.cuts:
        first = ", ".join(f"{time:.2f}" for time in tracks.cuts[:4])
        sentences.append(
            f"the film is cut, or jumps, {len(tracks.cuts)} times (at {first} s on the log's "
            "clock): record one without cuts"
        )
    return sentences


def _of_diagnosis(diagnosis: Diagnosis) -> list[Finding]:
    """Return the rows about mistakes in log and film or, if none is found, a row on whether the two
    fit each other.
    """
    if diagnosis.is_clean:
        if diagnosis.is_good:
            return [Finding("log and film", "fit each other as they are")]
        return [
            Finding(
                "log and film",
                "do not fit each other, and no mistake of the list explains it",
                "compare frames and units with the manual; look for a scene that moves or is far "
                "from flat",
                State.WRONG,
            )
        ]
    best = diagnosis.best
    if diagnosis.others:
        trials = [best, *diagnosis.others]
        names = [" and ".join(each.mistake for each in trial.corrections) for trial in trials]
        remedies = ["; ".join(each.remedy for each in trial.corrections) for trial in trials]
        return [
            Finding(
                "mistake",
                f"cannot tell {' from '.join(f'({name})' for name in names[:4])}"
                + f" and {len(names) - 4} more" * (len(names) > 4),
                "one of: " + " | ".join(remedies[:4]),
                State.WRONG,
            )
        ]
    return [Finding("mistake", each.mistake, each.remedy, State.WRONG) for each in best.corrections]


def _of_clocks(offset: Offset, mount: Mount | None, first: float, trust: Trust) -> list[Finding]:
    """Return the rows about the clocks of log and film.

    Args:
        offset: Offset of the film's clock, from its optical flow.
        mount: Fit of mount and clocks, which is more exact; None: it is not to be trusted.
        first: Time of the film's first picture on the log's clock, without the offset [s].
        trust: What is known of the camera.
    """
    value, half = (offset.value, offset.half) if mount is None else (mount.offset, mount.halves[0])
    if not trust.stamped:
        text = (
            "the film has no stamps on the log's clock; its first picture fits best at "
            f"{first + value:.3f} s of the log"
        )
        change = "give the stamps with which the robot's program pairs the pictures: --stamps"
        return [Finding("clock offset", text, change, State.UNKNOWN)]
    when = "end of its exposure, last row" if trust.late else "middle of its exposure, middle row"
    text = (
        f"{ms_text(value)} ms, +- {MM * half:.2f}: a picture with the stamp t was taken at "
        f"t + offset on the log's clock ({when})"
    )
    rows = [Finding("clock offset", text)]
    if abs(value) > LATE:
        change = f"add {ms_text(value)} ms to the stamp of each picture"
        rows = [Finding("clock offset", text, change, State.ADJUST)]
    if mount is None or abs(mount.drift) <= max(DRIFTS, mount.halves[mounts.DRIFT]):
        return rows
    text = f"{MM * mount.drift:.2f} ms each second, +- {MM * mount.halves[mounts.DRIFT]:.2f}"
    change = "stamp both by one clock, or synchronise them (chrony, PTP)"
    return [*rows, Finding("clock drift", text, change, State.WRONG)]


def _of_scale(mount: Mount, tag: TagFit | None, *, shows_focal: bool, known: bool) -> list[Finding]:
    """Return the rows about a tag, the focal length and the distance of the scene."""
    rows = [] if tag is None else [_of_tag(tag)]
    if shows_focal:
        half = mount.halves[mounts.FOCAL]
        off = abs(mount.focal - 1) > max(FOCAL_OFF, float(half))
        rows.append(
            Finding(
                "focal length",
                f"{mount.focal:.3f} times the given one, +- {half:.3f}",
                "calibrate the camera, or correct the field of view" * off,
                State.WRONG if off else State.OK,
            )
        )
    if known:
        rows.append(Finding("distance of the scene", f"{mount.depth:.3f} m"))
    return rows


def _of_tag(tag: TagFit) -> Finding:
    """Return the row about a tag."""
    if not tag.is_still:
        return Finding(
            "tag",
            f"it does not stand still: its corners are {tag.off:.1f} px off the fit",
            "fix the tag, or leave out --tag-mm",
            State.WRONG,
        )
    found = f"{MM * tag.side:.1f} mm, +- {MM * tag.half:.1f}; stated {MM * tag.stated:.1f}"
    if tag.has_size:
        return Finding("tag: side", found)
    change = "measure its black square, or correct the unit of the log's lengths"
    return Finding("tag: side", found, change, State.WRONG)


def _against_believed(
    mount: Mount, believed: Mount, trust: Trust, mistakes: list[str], *, has_lever: bool
) -> list[Finding]:
    """Return a list with a row about a mount that differs from the one that is stated; it is empty
    if the two agree. The names of a turn by right angles are added to `mistakes`, in place.
    """
    against = f"mount: against {trust.stated_by}"
    found_here = "found here" + f" relative to {trust.stated_by}" * trust.is_relative
    turn = believed.rotation.T @ mount.rotation
    half = float(mount.halves[1:4].max())
    near = min(cubes(), key=lambda cube: angle_of(cube.T @ turn))
    angle, axis = _named(near)
    if angle and angle_of(near.T @ turn) < TURNED:
        names = [f"the camera is mounted turned by {angle:.0f} deg about its {axis}"]
        if angle == 180 and axis.strip("-") == "z":
            names.append("the film is upside down")
        mistakes += names
        text = f"cannot tell {' from '.join(f'({name})' for name in names)}"
        found = text if len(names) > 1 else names[0]
        change = f"correct {trust.stated_by} (or the camera's driver) by this turn"
        return [Finding(against, found, change, State.WRONG)]
    if angle_of(turn) > half + ALIKE:
        found = f"the rotation differs by {np.degrees(angle_of(turn)):.1f} deg"
        change = f"set the rotation that is {found_here}, or calibrate the mount"
        return [Finding(against, found, change, State.WRONG)]
    off = _off(mount, believed)
    if not has_lever or _is_near(off, mount):
        return []
    found = f"the lever differs by {MM * np.linalg.norm(off):.0f} mm"
    change = f"set the lever that is {found_here}, or calibrate the mount"
    if abs(off[2]) > np.linalg.norm(off[:2]):
        found += (
            f", most of it along the optical axis, as it would with a focal length that is wrong "
            f"by {100 * off[2] / mount.depth:.0f} %"
        )
        change += "; or calibrate the camera"
    return [Finding(against, found, change, State.WRONG)]


def cubes() -> list[Array]:
    """Return the 24 rotation matrices (3, 3) that turn by multiples of 90 deg about the axes."""
    found: list[Array] = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        matrix = np.diag(signs)[:, list(order)]
        if np.linalg.det(matrix) > 0:
            found.append(matrix)
    return found


def _named(rotation: Array) -> tuple[float, str]:
    """Return the angle [deg] and the axis of a turn by right angles, such as "z" or "x-y" (halfway
    between x and -y); the axis is empty for no turn.
    """
    vector = Rotation.from_matrix(rotation).as_rotvec(degrees=True)
    angle = float(np.linalg.norm(vector))
    parts = [
        f"{'-' if part < 0 else '+'}{name}"
        for part, name in zip(vector, "xyz", strict=True)
        if abs(part) > 1
    ]
    return round(angle), "".join(parts).removeprefix("+")


def believed_mount(numbers: tuple[float, ...]) -> Mount:
    """Return the mount that a user states, without intervals.

    Args:
        numbers: Pose of the camera in the hand: x, y, z [m], then roll, pitch, yaw [deg] about the
            fixed axes x, y, z.
    """
    rotation = Rotation.from_euler("xyz", numbers[3:], degrees=True).as_matrix()
    nothing = np.zeros(mounts.COUNT)
    plane = np.array([0.0, 0.0, 1.0])
    arm = rotation.T @ np.array(numbers[:3])
    return Mount(0.0, rotation, arm, 1.0, 0.0, plane, nothing, 0.0, 0.0, 0.0, 0.0)


def preferred(diagnosis: Diagnosis, believed: Mount | None) -> Diagnosis:
    """Return a diagnosis without the equally good explanations that are far from the stated mount.
    An explanation is left out if the angle between its mount and the stated one exceeds the
    smallest such angle by at least 30 deg, or by at least 8 deg if the smallest is below 8 deg. The
    diagnosis is unchanged if no mount is stated, or if there is one explanation only.

    Args:
        diagnosis: The explanations of a recording, each with its mount.
        believed: The mount that the user states; None: none.
    """
    if believed is None or not diagnosis.others:
        return diagnosis
    trials = [diagnosis.best, *diagnosis.others]
    near = [angle_of(believed.rotation.T @ trial.mount.rotation) for trial in trials]
    # A stated mount that is far from all of them may itself be the mistake.
    slack = TURNED if min(near) < TURNED else FAR
    kept = [trial for trial, angle in zip(trials, near, strict=True) if angle < min(near) + slack]
    return replace(diagnosis, best=kept[0], others=kept[1:])
