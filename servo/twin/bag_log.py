"""A robot's log in a bag of ROS: joint states, poses or twists of its hand and commanded twists, as
the table that a log in CSV would be.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa

from servo.mistake import Mistake, as_mistake
from tracking.sequences.bag_file import Topic, messages_in, topics_in

JOINTS = "sensor_msgs/JointState"
POSE = "geometry_msgs/PoseStamped"
TWISTS = "geometry_msgs/TwistStamped", "geometry_msgs/Twist"
Message = Any
"""A message of ROS, whose type is made at run time."""
Cells = Callable[[Message], dict[str, float]]
"""Returns the cells of a log's row by their columns, given a message."""


def is_bag_log(path: Path) -> bool:
    """Return True if a bag has messages of ROS; an MCAP file with JSON messages alone is read as a
    table instead.

    Raises:
        Mistake: The bag cannot be read.
    """
    with as_mistake():
        return any(topic.serialization in ("cdr", "ros1") for topic in topics_in(path))


def bag_table(
    path: Path, units: Mapping[str, str], motion: str | None, commands: str | None
) -> pa.Table:
    """Return the table of a log in a bag: a row for each stamp of a message of the motion or of the
    commands; cells without a message of this stamp are empty.

    Args:
        path: The bag.
        units: Unit of each joint by its name, "m" or "rad"; empty if the robot is not known. If it
            is known, joint states are preferred as the motion; otherwise, or without them, poses,
            then joint states, then twists.
        motion: Topic of the hand's motion; None: the only one of the preferred type.
        commands: Topic of the commanded twists; None: the only topic of twists, or no commands if
            there is none or if twists are the motion.

    Raises:
        Mistake: The bag cannot be read, lacks a topic of the motion or a named topic, or has
            several topics where none is named.
    """
    cells: dict[str, Cells] = {
        JOINTS: lambda message: _joints(message, units),
        POSE: _pose,
        **dict.fromkeys(TWISTS, lambda message: _twist(message, "measured")),
    }
    with as_mistake():
        topics = [topic for topic in topics_in(path) if topic.kind in cells and topic.count]
        order = [(JOINTS,)] * bool(units) + [(POSE,), (JOINTS,), TWISTS]
        moving = next((found for kinds in order if (found := _of(topics, kinds))), [])
        moved = _chosen(path, topics if motion else moving, motion, "the hand's motion", "--motion")
        if moved is None:
            raise Mistake(
                f"{path}: this bag has no topic with the hand's motion: {JOINTS}, {POSE} or "
                f"{TWISTS[0]}; record one of them, or give a log beside the bag"
            )
        parts = [(moved, cells[moved.kind])]
        asked = [] if moved.kind in TWISTS and not commands else _of(topics, TWISTS)
        asking = _chosen(path, asked, commands, "commanded twists", "--commands")
        if asking is not None:
            parts.append((asking, lambda message: _twist(message, "command")))
        rows: dict[float, dict[str, float]] = {}
        for topic, of in parts:
            for time, message in messages_in(path, topic):
                rows.setdefault(time, {}).update(of(message))
    times = sorted(rows)
    names = dict.fromkeys(name for row in rows.values() for name in row)
    columns = {name: [rows[time].get(name) for time in times] for name in names}
    return pa.table({"time_s": times, **columns})


def _of(topics: list[Topic], kinds: tuple[str, ...]) -> list[Topic]:
    """Return the topics of some types."""
    return [topic for topic in topics if topic.kind in kinds]


def _chosen(
    path: Path, topics: list[Topic], name: str | None, what: str, option: str
) -> Topic | None:
    """Return the topic with a name; for the name None the only topic, or None if there is none.

    Raises:
        Mistake: There is no topic of this name, or there are several and no name.
    """
    there = ", ".join(f"{topic.name} ({topic.count} of {topic.kind})" for topic in topics)
    found = [topic for topic in topics if name in (None, topic.name)]
    if name is not None and not found:
        raise Mistake(
            f"{path}: this bag has no topic '{name}' with {what}; it has {there or 'none'}"
        )
    if len(found) > 1:
        raise Mistake(
            f"{path}: there are several topics with {what}: {there}; choose one with {option}"
        )
    return found[0] if found else None


def _joints(message: Message, units: Mapping[str, str]) -> dict[str, float]:
    """Return the positions in a sensor_msgs/JointState by column, such as "joint_elbow_rad"; a
    joint without a known unit counts as rad.
    """
    named = zip(message.name, message.position, strict=False)
    return {f"joint_{name}_{units.get(name, 'rad')}": float(value) for name, value in named}


def _pose(message: Message) -> dict[str, float]:
    """Return the hand's position [m] and quaternion in a geometry_msgs/PoseStamped by column, such
    as "hand_x_m" and "hand_qw".
    """
    place, turn = message.pose.position, message.pose.orientation
    cells = {f"hand_{axis}_m": float(getattr(place, axis)) for axis in "xyz"}
    return cells | {f"hand_q{axis}": float(getattr(turn, axis)) for axis in "wxyz"}


def _twist(message: Message, begin: str) -> dict[str, float]:
    """Return the twist in a geometry_msgs/TwistStamped or Twist [m/s, rad/s] by column; the columns
    begin with `begin`, such as "command_vx_m_s".
    """
    twist = message.twist if hasattr(message, "twist") else message
    cells = {f"{begin}_v{axis}_m_s": float(getattr(twist.linear, axis)) for axis in "xyz"}
    return cells | {f"{begin}_w{axis}_rad_s": float(getattr(twist.angular, axis)) for axis in "xyz"}
