"""Pictures of a bag (a file or folder of recorded messages): MCAP, ROS 1 (.bag), ROS 2 (a folder,
or one .db3 file).

The packages `mcap` and `rosbags` read the files; their errors become a ValueError with one
sentence.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from sim.files import reading
from sim.files.bit_depth import BitDepth
from sim.installed import plain
from tracking.sequences.image_message import (
    KINDS,
    decoder_of,
    picture_of,
    plain_kind,
)
from tracking.sequences.sources import NANO, RATE, SECOND, End, Picture, timed

if TYPE_CHECKING:
    from mcap.records import Channel, Schema

MCAP = b"\x89MCAP0\r\n"
"""First bytes of an MCAP file."""
ROS1 = b"#ROSBAG V"
"""First bytes of a ROS 1 bag."""
SQLITE = b"SQLite format 3"
"""First bytes of a ROS 2 bag of one file."""
INDEX = "metadata.yaml"
"""Name of the file by which a folder is a ROS 2 bag."""
INDEX_KEY = b"rosbag2_bagfile_information"
"""Key near the beginning of that file."""
TIMED = 100
"""Number of messages from which the rate of a topic is computed."""
HEAD = 1000
"""Length of the beginning of a file that shows its format [bytes]."""
LARGEST_RECORD = 1_000_000_000
"""Largest record of an MCAP file that is read into memory [bytes]."""


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic of a bag: a named series of messages of one type, with the type's name (`kind`), such
    as "sensor_msgs/Image", their encoding, such as "cdr", and their number.
    """

    name: str
    kind: str
    """Type of the messages, such as "sensor_msgs/Image", without "/msg"."""
    serialization: str
    """Encoding of the messages: "ros1", "cdr", "protobuf" or another one."""
    count: int
    """Number of messages."""
    schema: Schema | None = None
    """Definition of the type in an MCAP file, without which Protobuf cannot be decoded."""

    @property
    def has_pictures(self) -> bool:
        """True if the topic's messages are of a type of pictures that can be decoded, in an
        encoding that can be read.
        """
        return self.kind in KINDS.get(self.serialization, ())


@dataclass(frozen=True, slots=True)
class Contents:
    """An open bag: its topics, and a function that, for a topic's name, yields when each message
    was recorded [ns] and its bytes.
    """

    topics: Iterable[Topic]
    messages: Callable[[str], Iterator[tuple[int, bytes]]]
    """Yields the messages of a topic: when each was recorded [ns], and its bytes."""


def is_bag(path: Path) -> bool:
    """Return True if a file or folder is a bag (recorded messages of ROS 1, ROS 2 or MCAP) by its
    content; False also if it is missing or cannot be read.
    """
    try:
        folder = path.is_dir()
        with reading.opened(path / INDEX if folder else path, "bag") as file:
            head = file.read(HEAD)
    except (OSError, ValueError):
        return False
    return INDEX_KEY in head if folder else head.startswith((MCAP, ROS1, SQLITE))


def topics_in(path: Path) -> list[Topic]:
    """Return the topics (named series of messages) of a bag: MCAP, ROS 1 or ROS 2.

    Raises:
        ValueError: The bag cannot be read.
    """
    with _opened(path) as bag:
        return list(bag.topics)


def messages_in(path: Path, topic: Topic) -> Iterator[tuple[float, Any]]:
    """Yield, for each message of a topic of ROS, its time [s] and the decoded message. The time is
    the stamp of the message's header or, without such a stamp, when the message was recorded.

    Raises:
        ValueError: The bag is damaged.
    """
    decode = decoder_of(topic.kind, topic.serialization)
    with _opened(path) as bag:
        for recorded, data in bag.messages(topic.name):
            message = decode(data)
            stamp = 0
            if hasattr(message, "header"):
                stamp = message.header.stamp.sec * SECOND + message.header.stamp.nanosec
            yield (stamp or recorded) * NANO, message


class Bag:
    """Source of the pictures of one topic (named series of messages) of a bag, a file or folder of
    recorded messages. Pictures have the time stamps of their headers; without such a stamp, the
    time at which the message was recorded. `topic` None: the only topic with pictures.
    """

    end: End | None = None

    def __init__(self, path: Path, topic: str | None) -> None:
        """Open a bag and choose a topic.

        Args:
            path: The bag, a file or a folder.
            topic: Name of the topic; None: the only topic with pictures.

        Raises:
            ValueError: The bag cannot be read, has no such topic with pictures, or, for None, has
                several; or the topic has no messages.
        """
        self.path = path
        with _opened(path) as bag:
            topics = list(bag.topics)
        self._topic = _chosen(path, topics, topic)
        self.count = self._topic.count
        self.rate = self._rate()

    def _rate(self) -> float:
        """Return the mean rate [1/s] of the topic's first messages: the camera may have run for a
        part of the recording only.
        """
        times: list[int] = []
        with suppress(Exception), _opened(self.path) as bag:  # what is damaged is told when read
            times += (at for at, _ in islice(bag.messages(self._topic.name), TIMED))
        span = NANO * (max(times) - min(times)) if times else 0.0
        return (len(times) - 1) / span if span > 0 else RATE

    def __iter__(self) -> Iterator[Picture]:
        return timed(self._messages(), self.rate)

    def _messages(self) -> Iterator[Picture]:
        """Yield the topic's pictures, all with time 0 (their stamps give the times later), and set
        `end` to the report on the reading.
        """
        topic = self._topic
        depth = BitDepth()
        index = 0
        self.end = None
        try:
            with _opened(self.path) as bag:
                decode = decoder_of(topic.kind, topic.serialization, topic.schema)
                for recorded, data in bag.messages(topic.name):
                    name = f"message {index}"
                    try:
                        stated, image = picture_of(decode, data, depth)
                    except ValueError as error:
                        yield Picture(name, 0.0, None, str(error))
                    else:
                        stamp = recorded if stated is None else stated
                        yield Picture(name, 0.0, image, stamp=stamp, notes=depth.notes)
                    index += 1
        except ValueError as error:
            if index == 0:
                raise
            reason = str(error).removeprefix(f"{self.path}: ")
            self.end = End(f"{self.path}: {index} pictures, then {reason}", lost=True)


def _chosen(path: Path, topics: list[Topic], name: str | None) -> Topic:
    """Return the topic of a name, or the only one with pictures for None.

    Raises:
        ValueError: No such topic exists, several topics have pictures, or the topic has no
        messages.
    """
    images = [topic for topic in topics if topic.has_pictures]
    if not images:
        there = [f"{topic.name} ({topic.kind} as {topic.serialization})" for topic in topics]
        raise ValueError(
            f"{path}: this bag has no topic with pictures that can be read (sensor_msgs or "
            f"foxglove, raw or compressed); it has {', '.join(there) or 'no topic'}"
        )
    found = [topic for topic in images if name in (None, topic.name)]
    there = ", ".join(f"{topic.name} ({topic.count})" for topic in images)
    if not found:
        raise ValueError(f"{path}: this bag has no topic '{name}' with pictures; it has {there}")
    if len(found) > 1:
        raise ValueError(
            f"{path}: there are several topics with pictures: {there}; choose one with --topic, or "
            "give a scenario a bag with one of them"
        )
    if not found[0].count:
        raise ValueError(
            f"{path}: the topic {found[0].name} has no messages; choose another topic or bag"
        )
    return found[0]


@contextmanager
def _opened(path: Path) -> Generator[Contents]:
    """Open a bag of any format for the block.

    Raises:
        ValueError: The bag cannot be read; also in the block, where the bag is damaged.
    """
    head = b""
    if path.is_dir():
        _check_links(path)
    else:
        with reading.opened(path, "bag") as file:
            head = file.read(HEAD)
    try:
        with _mcap(path) if head.startswith(MCAP) else _ros(path, head) as found:
            yield found
    except ModuleNotFoundError as error:
        package = str(error.name).partition(".")[0]
        raise ValueError(
            f"{path}: bags are read by the package '{package}', which is not "
            "installed: install servobench[ros]"
        ) from None
    except Exception as error:
        # The libraries raise errors of many types for a damaged file, some without a text.
        reason = plain(str(error))
        quoted = f" ({reason.rstrip('.')})" if reason else ""
        raise ValueError(
            f"{path}: this bag is damaged or incomplete: copy or record it again{quoted}"
        ) from None


def _check_links(folder: Path) -> None:
    """Check that a ROS 2 bag has no links to files outside its folder.

    Raises:
        ValueError: The bag has such a link.
    """
    for file in folder.iterdir():
        if file.resolve().parent != folder.resolve():
            raise ValueError(
                f"{folder}: {file.name} is a link out of the folder of this bag: replace the link "
                "by its file"
            )


@contextmanager
def _ros(path: Path, head: bytes) -> Generator[Contents]:
    """Open a bag of ROS 1 or ROS 2 for the block; `head` is the beginning of a file."""
    from rosbags import rosbag1, rosbag2

    is_ros1 = head.startswith(ROS1)
    with rosbag1.Reader(path) if is_ros1 else rosbag2.Reader(path) as reader:
        serialization = "ros1" if is_ros1 else "cdr"  # of ROS 2, rosbags reads no other
        topics = [
            Topic(name, plain_kind(info.msgtype or "several types"), serialization, info.msgcount)
            for name, info in reader.topics.items()
        ]

        def messages(name: str) -> Iterator[tuple[int, bytes]]:
            for _, recorded, data in reader.messages(reader.topics[name].connections):
                yield recorded, bytes(data)

        yield Contents(topics, messages)


@contextmanager
def _mcap(path: Path) -> Generator[Contents]:
    """Open an MCAP file for the block."""
    from mcap.reader import NonSeekingReader

    with reading.opened(path, "bag") as file:

        def messages(name: str) -> Iterator[tuple[int, bytes]]:
            file.seek(0)
            reader = NonSeekingReader(file, validate_crcs=True, record_size_limit=LARGEST_RECORD)
            for _, _, message in reader.iter_messages([name], log_time_order=False):
                yield message.log_time, message.data

        yield Contents(_listed(file), messages)


def _listed(file: BinaryIO) -> Iterable[Topic]:
    """Return the topics of an MCAP file."""
    from mcap.reader import NonSeekingReader, SeekingReader

    topics: dict[str, Topic] = {}
    with suppress(Exception):  # mcap fails in many ways where the end is missing
        summary = SeekingReader(file, record_size_limit=LARGEST_RECORD).get_summary()
        if summary is not None and summary.statistics is not None:
            counts = summary.statistics.channel_message_counts
            for channel in summary.channels.values():
                count = counts.get(channel.id, 0)
                _count(topics, channel, summary.schemas.get(channel.schema_id), count)
            return topics.values()
    # A killed recorder leaves a file without a summary: its messages are counted.
    file.seek(0)
    reader = NonSeekingReader(file, record_size_limit=LARGEST_RECORD)
    try:
        for schema, channel, _ in reader.iter_messages(log_time_order=False):
            _count(topics, channel, schema, 1)
    except Exception:  # the place where it was cut off
        if not topics:
            raise
    return topics.values()


def _count(topics: dict[str, Topic], channel: Channel, schema: Schema | None, count: int) -> None:
    """Add a number of messages of a channel to the topic of its name."""
    kind = plain_kind(schema.name) if schema else "no type"
    new = Topic(channel.topic, kind, channel.message_encoding, 0, schema)
    known = topics.get(channel.topic, new)
    topics[channel.topic] = replace(known, count=known.count + count)
