"""A robot's log and the film of its camera, read for a comparison: the hand's motion on an even
grid of times, the film's pictures, and the time on the log's clock at which the film begins, if it
is known.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv

from servo.identify.log import Log, listed, log_of, numbers_in, table_in
from servo.loop.episode import Episode
from servo.mistake import Mistake, as_mistake, check_rules
from servo.output.steps_table import TABLE
from servo.scenario.load import load
from servo.twin.bag_log import bag_table, is_bag_log
from servo.twin.corrections import Kind, Smooth
from servo.twin.robot_motion import RobotMotion, continuous, smoothed
from sim.kinematics.robot import Robot
from sim.models.quaternion import quaternion_of
from sim.types import Array
from tracking.sequences.bag_file import is_bag
from tracking.sequences.sequence import source_of
from tracking.sequences.sources import NANO, Picture, Source

POSE = ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")
HANDS = ("hand", "camera")
"""Beginnings of the names of a pose's columns."""
TWIST = ("vx_m_s", "vy_m_s", "vz_m_s", "wx_rad_s", "wy_rad_s", "wz_rad_s")
SHORTEST = 4.0
"""Shortest log or film [s]."""
LONGEST = 600.0
"""Longest log [s]."""
FEWEST = 40
"""Least number of rows with a motion."""
SPARSEST = 0.1
"""Largest median interval of the rows [s]."""
APART = 1.0
"""A film whose first stamp precedes the log by more has another clock [s]."""
COLUMNS = (
    "hand_x_m, hand_y_m, hand_z_m, hand_qw, hand_qx, hand_qy, hand_qz (or camera_...), or "
    "joint_NAME_m and joint_NAME_rad with --scenario, or measured_vx_m_s ... measured_wz_rad_s"
)


@dataclass(frozen=True, slots=True)
class HandLog:
    """The motion of a robot's hand that was read from a log, smoothed, and the median interval of
    the log's rows [s].
    """

    smooth: Smooth
    """Smoothed values on an even grid."""
    interval: float
    """Median interval of the rows [s]."""


def log_table(
    path: Path, scenario: str | None, motion: str | None, commands: str | None
) -> pa.Table:
    """Return the rows of a robot's log.

    Args:
        path: A file .csv, .parquet or .mcap, a folder of `servobench run`, or a bag.
        scenario: The scenario whose robot has the joints of a bag; None: the robot is not known.
        motion: Topic of a bag with the hand's motion; None: as for `bag_table`.
        commands: Topic of a bag with the commanded twists; None: as for `bag_table`.

    Raises:
        Mistake: The log or the scenario cannot be read, or a topic is given for another file than a
            bag with messages of ROS.
    """
    if is_bag(path) and is_bag_log(path):
        units: dict[str, str] = {}
        if scenario is not None:
            with Episode(load(scenario), seen=False) as episode:
                robot = episode.world.robot
                units = dict(zip(robot.names, robot.units, strict=True))
        return bag_table(path, units, motion, commands)
    if motion or commands:
        raise Mistake(
            f"{path}: --motion and --commands are topics of a bag of ROS, and this log is none: "
            "leave them out"
        )
    return table_in(path / TABLE if path.is_dir() else path)


def hand_log(table: pa.Table, path: Path, scenario: str | None) -> HandLog:
    """Return the motion of a robot's hand by the rows of a log.

    Args:
        table: The rows.
        path: The log, for messages.
        scenario: The scenario whose robot has the log's joints; None: the log has poses or twists.

    Raises:
        Mistake: The log has no column time_s or no motion of the hand, is not 4 to 600 s long, has
            too few rows, or rows that are too far apart or not in order of time; a used column has
            texts or numbers above 10^6; a quaternion is not of length 1; the hand does not move; or
            the scenario cannot be used or has joints that the log lacks.
    """
    names = table.column_names
    if "time_s" not in names:
        raise Mistake(
            f"{path}: this log has no column time_s; it needs time_s and {COLUMNS}; this one has "
            f"{listed(names, 12) or 'none'}"
        )
    kind, columns = _columns(names, scenario, path)
    if kind is Kind.JOINTS and scenario is not None:
        # Others, such as a gripper's, do not move the camera, and may be in rows of their own.
        known = joints_of(scenario)
        columns = [name for name in columns if name in known] or columns
    times = numbers_in(table, "time_s", path)
    values = np.stack([numbers_in(table, name, path) for name in columns], axis=1)
    there = np.isfinite(times) & np.isfinite(values).all(axis=1)
    times, values = times[there], values[there]
    span = float(times[-1] - times[0]) if len(times) else 0.0
    check_rules(
        (
            len(times) < FEWEST,
            f"{path}: {len(times)} rows of this log have a motion ({columns[0]} and others); "
            f"record at least {FEWEST}",
        ),
        (
            bool(np.any(np.diff(times) <= 0)),
            f"{path}: time_s does not increase from row to row: sort or correct the rows",
        ),
        (
            not SHORTEST <= span <= LONGEST,
            f"{path}: this log is {span:.6g} s long: record {SHORTEST:g} to {LONGEST:g} s, best "
            "30 s of the motion that --wiggle writes",
        ),
        (
            len(times) > 1 and float(np.median(np.diff(times))) > SPARSEST,
            f"{path}: the rows of this log are more than {SPARSEST:g} s apart: record "
            "one each 20 ms",
        ),
        (
            bool(np.any(abs(values) > 1e6)),
            f"{path}: a number in {columns[0]} ... is beyond +-10^6: correct or leave out its row",
        ),
    )
    if kind is Kind.POSES:
        lengths = np.linalg.norm(values[:, 3:], axis=1)
        if np.any(abs(lengths - 1) > 0.1):
            raise Mistake(
                f"{path}: the quaternion is no unit quaternion: its length is "
                f"{lengths.min():.3g} to {lengths.max():.3g}; log qw, qx, qy, qz of the hand"
            )
        values[:, 3:] = continuous(values[:, 3:])
    grid, even = smoothed(times, values)
    poses_of = None
    if kind is Kind.JOINTS and scenario is not None:
        poses_of = kinematics(scenario, columns, path)
    smooth = Smooth(kind, grid, even, tuple(columns), poses_of)
    _check_motion(smooth, path)
    return HandLog(smooth, float(np.median(np.diff(times))))


def _columns(names: Sequence[str], scenario: str | None, path: Path) -> tuple[Kind, list[str]]:
    """Return the kind and the names of the columns from which the hand's motion follows: joints if
    a scenario is given and the log has some; otherwise poses, or else twists.

    Raises:
        Mistake: The log has no such columns.
    """
    joints = [name for name in names if name.startswith("joint_") and name[-2:] in ("_m", "ad")]
    if scenario is not None and joints:
        return Kind.JOINTS, joints
    for hand in HANDS:
        wanted = [f"{hand}_{each}" for each in POSE]
        if set(wanted) <= set(names):
            return Kind.POSES, wanted
    wanted = [f"measured_{each}" for each in TWIST]
    if set(wanted) <= set(names):
        return Kind.TWISTS, wanted
    hint = (
        "give --scenario, the scenario whose robot has these joints"
        if joints
        else f"a log needs time_s and {COLUMNS}; this one has {listed(names, 12)}"
    )
    raise Mistake(f"{path}: the motion of the hand does not follow from this log: {hint}")


def joints_of(scenario: str) -> list[str]:
    """Return the names of the columns that a log has for the joints of a scenario's robot, such as
    "joint_shoulder_rad".

    Raises:
        Mistake: The scenario cannot be used.
    """
    with Episode(load(scenario), seen=False) as episode:
        return columns_of(episode.world.robot)


def columns_of(robot: Robot) -> list[str]:
    """Return the names of a log's columns of a robot's joints."""
    return [f"joint_{name}_{unit}" for name, unit in zip(robot.names, robot.units, strict=True)]


def kinematics(scenario: str, columns: Sequence[str], path: Path) -> Callable[[Array], Array]:
    """Return the forward kinematics of a scenario's robot: a function from joint positions (n, k)
    [m, rad], in the order of the log's columns, to poses (n, 7) of the camera in the world frame
    (of the hand if the robot holds the target): x, y, z [m] and a quaternion x, y, z, w.

    Args:
        scenario: The scenario.
        columns: The log's columns of joints, such as "joint_shoulder_rad".
        path: The log's file, for messages.

    Raises:
        Mistake: The scenario cannot be used, or the log lacks a joint of its robot.
    """
    with Episode(load(scenario), seen=False) as episode:
        robot, data = episode.world.robot, episode.world.data
    known = columns_of(robot)
    if set(known) - set(columns):
        missing = [name for name in known if name not in columns]
        raise Mistake(
            f"{path}: the robot of '{scenario}' has joints that the log lacks: {', '.join(missing)}"
        )
    order = [list(columns).index(name) for name in known]

    def poses(joints: Array) -> Array:
        rows: list[Array] = []
        for q in joints[:, order]:
            pose = robot.mounting.hand(robot.place(data, q))
            w, *vector = quaternion_of(pose.rotation)
            rows.append(np.array([*pose.translation, *vector, w]))
        return np.stack(rows)

    return poses


def command_log(table: pa.Table, path: Path, motion: RobotMotion) -> Log:
    """Return the log of commands and motion, as `identify` reads it; a log that has commanded
    twists of the hand (command_vx_m_s ...) but no measured ones gets those of the hand's motion.

    Args:
        table: The log's rows.
        path: The log, for messages.
        motion: The hand's motion.

    Raises:
        Mistake: The log has no commands, or `servo.identify` refuses it.
    """
    names = [f"measured_{each}" for each in TWIST]
    if any(f"command_{each}" in table.column_names for each in TWIST) and not (
        set(names) & set(table.column_names)
    ):
        times = numbers_in(table, "time_s", path)
        before = np.append(2 * times[:1] - times[1:2], times[:-1])
        for name, column in zip(names, motion.twists(before, times).T, strict=True):
            table = table.append_column(name, pa.array(column))
    return log_of(table, path)


def is_camera(table: pa.Table, path: Path, scenario: str | None) -> bool:
    """Return True if a log states where the camera is: by columns camera_..., or by the joints of a
    scenario's robot, whose model has a camera.

    Raises:
        Mistake: The log has no motion of the hand.
    """
    return _columns(table.column_names, scenario, path)[1][0].startswith(("camera_", "joint_"))


def _check_motion(smooth: Smooth, path: Path) -> None:
    """Check that a value of a log changes by more than 1e-5.

    Raises:
        Mistake: None does; the hand does not move.
    """
    if not np.any(np.ptp(smooth.values, axis=0) > 1e-5):
        raise Mistake(
            f"{path}: the hand does not move in this log: play the motion that "
            "`servobench preflight --wiggle FILE` writes, and record it"
        )


@dataclass(slots=True)
class FilmClock:
    """The time at which a film begins, on the clock of a robot's log."""

    begins: float
    """Time of the first picture on the log's clock [s]; the log's begin if it is not known."""
    is_known: bool
    """True if this time is known, but for a constant offset: the user says it, or the film has
    stamps of the log's clock."""


def film(
    text: str, rate: float, topic: str | None, stamps: Path | None
) -> tuple[Source, Iterator[Picture]]:
    """Return a film as a source, and an iterator over its pictures.

    Args:
        text: A video, a folder of pictures, or a bag.
        rate: Frame rate of a folder of pictures [Hz].
        topic: Image topic of a bag; None: the only one.
        stamps: CSV with the stamp of each picture in the column time_s [s], which replaces the
            film's own times; None: the film's own times stay.

    Raises:
        Mistake: The film or the stamps cannot be read, the stamps do not increase, or there are
            more or fewer stamps than pictures.
    """
    with as_mistake():
        source = source_of(text, rate, topic)
    if stamps is None:
        return source, iter(source)
    try:
        table = pyarrow.csv.read_csv(stamps)
        times = numbers_in(table, "time_s", stamps)
    except (OSError, pa.ArrowException) as error:
        raise Mistake(f"{stamps}: cannot read these stamps: {error}") from None
    if not (len(times) and np.all(np.diff(times) > 0)):
        raise Mistake(
            f"{stamps}: the column time_s is empty, has an empty cell or does not increase: sort "
            "or correct its rows"
        )
    if source.count is not None and source.count != len(times):
        raise Mistake(
            f"{stamps}: there are {len(times)} stamps for {source.count} pictures of {text}: give "
            "one stamp for each picture"
        )
    return source, _stamped(source, times)


def _stamped(source: Source, times: Array) -> Iterator[Picture]:
    for picture, time in zip(source, times.tolist(), strict=False):
        yield Picture(picture.name, time - float(times[0]), picture.image, stamp=round(time / NANO))


def clock_of(first: int | None, log: Smooth, begins: float | None) -> FilmClock:
    """Return when a film begins on the clock of a robot's log: as the user says, or else at the
    first picture's stamp if this is inside the log's time (or up to 1 s before), or else, with
    `is_known` False, at the log's begin.

    Args:
        first: Stamp of the film's first picture [ns]; None: it has none.
        log: The smoothed log.
        begins: Time of the first picture on the log's clock, as the user says [s]; None: not said.
    """
    if begins is not None:
        return FilmClock(begins, is_known=True)
    start, end = float(log.times[0]), float(log.times[-1])
    stamp = start if first is None else first * NANO
    if start - APART <= stamp <= end:
        return FilmClock(stamp, is_known=first is not None)
    return FilmClock(start, is_known=False)
