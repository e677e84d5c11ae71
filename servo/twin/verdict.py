"""What a pre-flight (a comparison of a robot's log with the film of its camera) finds, and what it
refuses to say because it is too uncertain.
"""

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
from servo.twin.still_tag import TagFit
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
"""Least rate about the second axis of turning for a lever, root mean square [rad/s]."""
SLIDES = 0.005
"""The same of sliding, for a mount without turns [m/s]."""
SCATTERED = 3.0
"""Largest scatter of the scene's planes."""
MANY_STRAY = 0.1
"""Share of points off the fit above which a part of the scene itself seems to move: 0.08 at most in
simulated recordings with a small car that moves, 0.13 in a real one with a hand in view."""
DARK = 0.3
"""Share of dark pictures above which a film is too dark."""
LATE = 5e-3
"""Least offset of the clocks for which the row about it says what to change [s]."""
DRIFTS = 2e-4
"""Least drift of the clocks that is reported [s/s]."""
FOCAL_OFF = 0.05
"""Least error of the focal length that is reported."""
TURNED = np.radians(8.0)
"""Largest distance of a mount from a turn by right angles that is named as such, or from the stated
one by which equal explanations are told apart [rad]."""
FAR = np.radians(30.0)
"""The latter, if no explanation is within the former [rad]."""
APART = np.radians(2.0)
"""Least turn between the linear and the angular part of a log that is reported [rad]."""
MIXED = (
    "log v and w in the hand's frame, or position and orientation in the base's; check the zeros "
    "of the joints"
)
ALIKE = np.radians(1.0)
CLOSE = 0.01
"""Added to the intervals within which a stated mount counts as right [rad, m]."""
AGAINST = "mount: against --mount"
STEP = 0.05
"""Time over which a rate is taken, so that noise is small [s]."""
PARTS = np.s_[:3], np.s_[3:]
MM = 1e3


class State(Enum):
    """What a row of the table of a pre-flight says of a part of the robot, with its sentence."""

    OK = "as stated"
    ADJUST = "the robot can follow, but pairs pictures with wrong postures until it is changed"
    WRONG = "it may drive off"
    REFUSED = "the recording does not show it"
    UNKNOWN = "not looked at, as something was not given"


@dataclass(frozen=True, slots=True)
class Finding:
    """A row of the table of a pre-flight (a comparison of a robot's log with the film of its
    camera): what was looked at, what was found, and what to change.
    """

    what: str
    found: str
    change: str = ""
    """What to change; empty: nothing."""
    state: State = State.OK

    @property
    def is_good(self) -> bool:
        """False if the robot must not move by its camera before the change."""
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
        return all(each.is_good or each.change in ENOUGH for each in self.findings)

    @property
    def unknown(self) -> list[str]:
        """What was not looked at, as something was not given."""
        return [each.what for each in self.findings if each.state is State.UNKNOWN]


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


def judge(
    offset: Offset,
    diagnosis: Diagnosis,
    mount: Mount,
    turned: Mount,
    tracks: Tracks,
    axes: tuple[float, float],
    believed: Mount | None,
    *,
    trusts_focal: bool,
    trusts_along: bool,
    late: float = 0.0,
    tag: TagFit | None = None,
    stamped: bool = True,
) -> Verdict:
    """Return the verdict of a pre-flight: what is right, wrong, or too uncertain to be stated.

    Args:
        offset: Offset of the film's clock.
        diagnosis: The corrections that explain the recording.
        mount: The mount of the camera, fitted with these corrections.
        turned: The same fit with a turn between the linear and the angular part of the twists.
        tracks: Points that were followed through the film.
        axes: The hand's sliding [m/s] and turning [rad/s] along its second axis, from
            `second_axes`.
        believed: The mount that the user states, if any.
        trusts_focal: Whether the focal length is calibrated.
        trusts_along: Whether the distance from the hand's origin to the camera along the optical
            axis is known.
        late: How long before its stamp the middle of a picture was exposed [s]; 0: unknown.
        tag: What a tag in the film shows, if there is one: the mount is then of it.
        stamped: Whether the film's times are stamps, as the robot's program uses them.
    """
    findings: list[Finding] = []
    doubts = list(_of_film(tracks))
    why_no_offset = _no_offset(offset)
    if why_no_offset:
        findings.append(Finding("clock offset", why_no_offset, RECORD, State.REFUSED))
    mistakes = [each.mistake for each in diagnosis.best.corrections]
    tied = bool(diagnosis.others)
    if not why_no_offset and max(axes[0] / SLIDES, axes[1] / TURNS) >= 1:
        findings += _of_diagnosis(diagnosis)
    no_offset = "the clock offset is not known" if why_no_offset else ""
    is_turned = any(each.turn is not None for each in diagnosis.best.corrections)
    mixed = "" if is_turned or why_no_offset else _mixed(turned)
    if mixed:
        mistakes.append(mixed)
        findings.append(Finding("mistake", mixed, MIXED, State.WRONG))
    why = no_offset or mixed or _no_mount(diagnosis, mount, axes, tied)
    why_no_lever = (
        "its rotation is not known" if why else _no_lever(mount, axes, trusts_focal or trusts_along)
    )
    if not why_no_offset:
        fit = None if why else mount
        findings += _of_clocks(offset, fit, float(tracks.times[0]), late, stamped=stamped)
    if why:
        change = TIED_CHANGE if why == TIED and believed is None else RECORD
        findings.append(Finding("mount: rotation", why, change, State.REFUSED))
    else:
        findings.append(_rotation(mount, believed))
        if believed is not None:
            findings += _against_believed(mount, believed, mistakes, has_lever=not why_no_lever)
    if why_no_lever:
        change = LOOKS_ALIKE_CHANGE if why_no_lever == LOOKS_ALIKE else RECORD
        change = "" if why else change  # the row above has it
        findings.append(Finding("mount: lever", why_no_lever, change, State.REFUSED))
    else:
        findings.append(_lever(mount, believed))
    if not why:
        known = trusts_focal or trusts_along
        findings += _of_scale(mount, tag, trusts_along=trusts_along, known=known)
        if mount.stray > MANY_STRAY:
            doubts.append(
                f"{100 * mount.stray:.0f} % of the points do not move with the scene: a part of it "
                "moves by itself, or is very near; the mount may be off by more than its interval"
            )
    return Verdict(
        findings,
        doubts,
        offset if stamped and not why_no_offset else None,
        None if why else mount,
        not why,
        not why_no_lever,
        mistakes,
    )


RECORD = "record 30 s of the motion that `servobench preflight --wiggle FILE` writes"
TIED = "it differs between the mistakes that explain the recording"
TIED_CHANGE = "give --mount from your drawing, which tells them apart: this recording is enough"
LOOKS_ALIKE = "a lever along the optical axis looks as a wrong focal length does"
LOOKS_ALIKE_CHANGE = "give --calibration, --fov, --along or --tag-mm: this recording is enough"
ENOUGH = TIED_CHANGE, LOOKS_ALIKE_CHANGE, ""
"""What to change where nothing has to be recorded again; empty: as the row above says."""


def _no_offset(offset: Offset) -> str:
    """Return why an offset is refused, or an empty text."""
    cases = (
        (
            offset.depth < SHALLOW,
            f"the motion in the film does not show it (depth of the curve {offset.depth:.2f}, at "
            f"least {SHALLOW:g} is needed)",
        ),
        (
            offset.at_end,
            "the best one is at the end of the search of 1 s: give the film's begin with --begins",
        ),
        (
            offset.half > VAGUE_OFFSET,
            f"it is uncertain by {MM * offset.half:.0f} ms (at most {MM * VAGUE_OFFSET:.0f})",
        ),
    )
    return next((sentence for applies, sentence in cases if applies), "")


def _no_mount(diagnosis: Diagnosis, mount: Mount, axes: tuple[float, float], tied: bool) -> str:
    """Return why a mount is refused, or an empty text."""
    apart = [
        angle_of(diagnosis.best.mount.rotation.T @ other.mount.rotation)
        for other in diagnosis.others
    ]
    cases = (
        (
            axes[1] < TURNS and axes[0] < SLIDES,
            "the hand moves along or about one axis only",
        ),
        (
            tied and max(apart, default=0.0) > VAGUE_TURN,
            TIED,
        ),
        (
            any(
                each.frames is not None or each.turn is not None
                for each in diagnosis.best.corrections
            ),
            "motion in another frame does not show how the hand is turned in it",
        ),
        (
            not diagnosis.is_good,
            "neither the log as it is nor any mistake of the list explains the film",
        ),
        (
            mount.scatter > SCATTERED or mount.plane[2] <= 0,
            f"no plane fits the scene (scatter {mount.scatter:.1f}, at most {SCATTERED:g})",
        ),
        (
            bool(mount.halves[1:4].max() > VAGUE_TURN),
            f"it is uncertain by {np.degrees(mount.halves[1:4].max()):.1f} deg (at most "
            f"{np.degrees(VAGUE_TURN):g})",
        ),
    )
    return next((sentence for applies, sentence in cases if applies), "")


def _mixed(turned: Mount) -> str:
    """Return that the linear and the angular part of a log are in two frames, or an empty text if
    the turn between them is not clear.
    """
    angle = angle_of(turned.turn)
    half = float(turned.halves[list(mounts.TURN)].max())
    if angle < max(APART, 2 * half):
        return ""
    return (
        f"the hand's slides are turned against its turns by {np.degrees(angle):.1f} deg, "
        f"+- {np.degrees(half):.1f}"
    )


def _no_lever(mount: Mount, axes: tuple[float, float], known: bool) -> str:
    """Return why a lever is refused, or an empty text."""
    cases = (
        (
            axes[1] < TURNS,
            f"the hand turns at {axes[1]:.3f} rad/s about its second axis (at least {TURNS:g})",
        ),
        (
            bool(mount.halves[4:7].max() > VAGUE_LEVER),
            f"it is uncertain by {MM * mount.halves[4:7].max():.0f} mm (at most "
            f"{MM * VAGUE_LEVER:.0f})",
        ),
        (
            not known,
            LOOKS_ALIKE,
        ),
    )
    return next((sentence for applies, sentence in cases if applies), "")


def angles_text(mount: Mount) -> str:
    """Return the rotation of a mount as a text, such as "roll 5.00, pitch -10.00, yaw 20.00"
    [deg].
    """
    angles = Rotation.from_matrix(mount.rotation).as_euler("xyz", degrees=True)
    return "roll {:.2f}, pitch {:.2f}, yaw {:.2f}".format(*np.round(angles, 2) + 0.0)


def place_text(mount: Mount) -> str:
    """Return the lever of a mount as a text, such as "x 0.0, y 40.0, z 0.0" [mm]."""
    return "x {:.1f}, y {:.1f}, z {:.1f}".format(*np.round(MM * mount.lever, 1) + 0.0)


def _rotation(mount: Mount, believed: Mount | None) -> Finding:
    """Return the row about the rotation of a mount, with the one that the user states."""
    half = float(np.degrees(mount.halves[1:4].max()))
    text = f"{angles_text(mount)} deg, +- {half:.2f}"
    if believed is not None:
        text += f"; stated {angles_text(believed)}, ok up to a turn of "
        text += f"{half + np.degrees(ALIKE):.1f} deg"
    return Finding("mount: rotation", text)


def _lever(mount: Mount, believed: Mount | None) -> Finding:
    """Return the row about the lever of a mount, with the one that the user states."""
    half = MM * float(mount.halves[4:7].max())
    text = f"{place_text(mount)} mm, +- {half:.1f}"
    if believed is not None:
        text += f"; stated {place_text(believed)}, ok up to {half + MM * CLOSE:.0f} mm along each "
        text += "axis"
    return Finding("mount: lever", text)


def _of_film(tracks: Tracks) -> list[str]:
    """Return doubts about a film."""
    sentences: list[str] = []
    if tracks.dark > DARK:
        sentences.append(f"{100 * tracks.dark:.0f} % of the pictures are dark: expose longer")
    if tracks.cuts:
        first = ", ".join(f"{time:.2f}" for time in tracks.cuts[:4])
        sentences.append(
            f"the film is cut, or jumps, {len(tracks.cuts)} times (at {first} s on the log's clock)"
        )
    return sentences


def _of_diagnosis(diagnosis: Diagnosis) -> list[Finding]:
    """Return the rows about mistakes."""
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


def _of_clocks(
    offset: Offset, mount: Mount | None, first: float, late: float, *, stamped: bool
) -> list[Finding]:
    """Return the rows about the clocks of log and film.

    Args:
        offset: Offset of the film's clock, from its optical flow.
        mount: Fit of mount and clocks, which is more exact; None: it is not to be trusted.
        first: Time of the film's first picture on the log's clock, without the offset [s].
        late: How long before its stamp the middle of a picture was exposed [s]; 0: unknown.
        stamped: Whether the film's times are stamps on the log's clock.
    """
    value, half = (offset.value, offset.half) if mount is None else (mount.offset, mount.halves[0])
    if not stamped:
        text = (
            "the film has no stamps on the log's clock; its first picture fits best at "
            f"{first + value:.3f} s of the log"
        )
        change = "give the stamps with which the robot's program pairs the pictures: --stamps"
        return [Finding("clock offset", text, change, State.UNKNOWN)]
    when = "end of its exposure, last row" if late else "middle of its exposure, middle row"
    text = (
        f"{MM * value:.2f} ms, +- {MM * half:.2f}: a picture with the stamp t was taken at "
        f"t + offset on the log's clock ({when})"
    )
    rows = [Finding("clock offset", text)]
    if abs(value) > LATE:
        change = f"add {MM * value:.2f} ms to the stamp of each picture"
        rows = [Finding("clock offset", text, change, State.ADJUST)]
    if mount is None or abs(mount.drift) <= max(DRIFTS, mount.halves[mounts.DRIFT]):
        return rows
    text = f"{MM * mount.drift:.2f} ms each second, +- {MM * mount.halves[mounts.DRIFT]:.2f}"
    change = "stamp both by one clock, or synchronise them (chrony, PTP)"
    return [*rows, Finding("clock drift", text, change, State.WRONG)]


def _of_scale(
    mount: Mount, tag: TagFit | None, *, trusts_along: bool, known: bool
) -> list[Finding]:
    """Return the rows about a tag, the focal length and the distance of the scene."""
    rows = [] if tag is None else [_of_tag(tag)]
    if trusts_along:
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
    mount: Mount, believed: Mount, mistakes: list[str], *, has_lever: bool
) -> list[Finding]:
    """Return the rows about a mount that differs from the one that the user states."""
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
        change = "correct --mount (or the camera's driver) by this turn"
        return [Finding(AGAINST, found, change, State.WRONG)]
    if angle_of(turn) > half + ALIKE:
        found = f"the rotation differs by {np.degrees(angle_of(turn)):.1f} deg"
        change = "set the rotation that is found here, or calibrate the mount"
        return [Finding(AGAINST, found, change, State.WRONG)]
    off = mount.arm - mount.rotation.T @ believed.lever
    if not has_lever or np.all(abs(off) < mount.halves[4:7] + CLOSE):
        return []
    found = f"the lever differs by {MM * np.linalg.norm(off):.0f} mm"
    change = "set the lever that is found here, or calibrate the mount"
    if abs(off[2]) > np.linalg.norm(off[:2]):
        found += (
            f", most along the optical axis: so would a focal length that is wrong by "
            f"{100 * off[2] / mount.depth:.0f} %"
        )
        change += "; or calibrate the camera"
    return [Finding(AGAINST, found, change, State.WRONG)]


def cubes() -> list[Array]:
    """Return the 24 rotation matrices (3, 3) that turn by multiples of 90 deg about the axes."""
    found: list[Array] = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        matrix = np.diag(signs)[:, list(order)]
        if np.linalg.det(matrix) > 0:
            found.append(matrix)
    return found


def _named(rotation: Array) -> tuple[float, str]:
    """Return the angle [deg] and the axis, such as "z" or "x + y", of a turn by right angles."""
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
    """Return a diagnosis without those equally good explanations whose mount is turned from the
    stated one by at least 30 deg more than that of the nearest explanation, or by 8 deg more if the
    nearest is within 8 deg. It is unchanged if no mount is stated, or if there is one explanation
    only.

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
