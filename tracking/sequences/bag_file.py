"""The pictures of one topic of a bag: MCAP, ROS 1 (.bag), ROS 2 (a folder, or one .db3 file).

`mcap` and `rosbags` read the files and decode the messages.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from sim.files import reading
from tracking.sequences.image_message import KINDS, NANO, decoder_of, picture_of, plain_kind
from tracking.sequences.sources import RATE, End, Picture, Times

if TYPE_CHECKING:
    from mcap.records import Channel, Message, Schema

MCAP = b"\x89MCAP0\r\n"
ROS1 = b"#ROSBAG V"
SQLITE = b"SQLite format 3"
"""First bytes of the files."""
INDEX = "metadata.yaml"
INDEX_KEY = b"rosbag2_bagfile_information"
"""The file that makes a folder a ROS 2 bag, and its key near the beginning."""
HEAD = 1000
"""Length of the beginning in which the key is searched for [bytes]."""
LARGEST_RECORD = 1_000_000_000
"""Largest record of an MCAP file that is read into memory [bytes]."""
MOST_NAMED = 8
"""Most topics in a message."""


@dataclass(frozen=True, slots=True)
class Topic:
    """One topic: its type without "/msg", how its messages are written, how many there are."""

    name: str
    kind: str
    serialization: str
    count: int
    schema: Schema | None = None
    """The definition that an MCAP file holds; Protobuf cannot be decoded without."""

    @property
    def has_pictures(self) -> bool:
        return self.kind in KINDS.get(self.serialization, ())

    @property
    def shown_kind(self) -> str:
        """The type, and how it is written if it is not read for that reason."""
        other = any(self.kind in kinds for kinds in KINDS.values()) and not self.has_pictures
        return f"{self.kind} as {self.serialization}" if other else self.kind


@dataclass(frozen=True, slots=True)
class Contents:
    """An open bag."""

    topics: list[Topic]
    span: float
    """Time from the first message to the last [s]."""
    messages: Callable[[str], Iterator[tuple[float, bytes]]]
    """Gives the messages of a topic: when each was recorded [s], and its bytes."""


def is_bag(path: Path) -> bool:
    """Return whether a path is a bag by its content; false for what cannot be read."""
    try:
        folder = path.is_dir()
        with reading.opened(path / INDEX if folder else path, "bag") as file:
            head = file.read(HEAD)
    except (OSError, ValueError):
        return False
    return INDEX_KEY in head if folder else head.startswith((MCAP, ROS1, SQLITE))


class Bag:
    """Pictures of a topic, with the stamps of their headers."""

    end: End | None = None

    def __init__(self, path: Path, topic: str | None) -> None:
        """Find the topic; None stands for the only one with pictures.

        Raises:
            ValueError: The bag cannot be read, or has no such topic of pictures.
        """
        self.path = path
        with _opened(path) as bag:
            topics = bag.topics
            span = bag.span
        self._topic = _chosen(path, topics, topic)
        self.count = self._topic.count
        self.rate = (self.count - 1) / span if self.count > 1 and span > 0 else RATE

    def __iter__(self) -> Iterator[Picture]:
        topic = self._topic
        times = Times(self.rate)
        index = 0
        self.end = None
        try:
            with _opened(self.path) as bag:
                decode = decoder_of(topic.kind, topic.serialization, topic.schema)
                for recorded, data in bag.messages(topic.name):
                    name = f"message {index}"
                    try:
                        stamp, image = picture_of(decode, data)
                        time = times.since_first(recorded if stamp is None else stamp)
                        picture = Picture(name, time, image)
                    except ValueError as error:
                        picture = Picture(name, times.since_first(None), None, str(error))
                    yield picture
                    index += 1
        except ValueError as error:
            if index == 0:
                raise
            reason = str(error).removeprefix(f"{self.path}: ")
            self.end = End(f"{self.path}: {index} pictures, then {reason}", lost=True)


def _chosen(path: Path, topics: list[Topic], name: str | None) -> Topic:
    images = [topic for topic in topics if topic.has_pictures]
    if not images:
        there = _listed([f"{topic.name} ({topic.shown_kind})" for topic in topics])
        raise ValueError(f"{path}: no topic has pictures; there is {there}")
    found = [topic for topic in images if name in (None, topic.name)]
    there = _listed([f"{topic.name} ({topic.count})" for topic in images])
    if not found:
        raise ValueError(f"{path}: there is no topic '{name}' with pictures; there is {there}")
    if len(found) > 1:
        raise ValueError(
            f"{path}: there are several topics with pictures; choose one with --topic: {there}"
        )
    if not found[0].count:
        raise ValueError(f"{path}: there are no messages in {found[0].name}")
    return found[0]


def _listed(names: list[str]) -> str:
    more = len(names) - MOST_NAMED
    return ", ".join(names[:MOST_NAMED] + ([f"and {more} more"] if more > 0 else [])) or "none"


@contextmanager
def _opened(path: Path) -> Generator[Contents]:
    """Open a bag of any kind.

    Raises:
        ValueError: It cannot be read; also later, where it is damaged.
    """
    head = b""
    try:
        if not path.is_dir():
            with reading.opened(path, "bag") as file:
                head = file.read(HEAD)
        with _mcap(path) if head.startswith(MCAP) else _ros(path, head) as found:
            yield found
    except ModuleNotFoundError as error:
        package = str(error.name).partition(".")[0]
        raise ValueError(
            f"{path}: bags are read by the package '{package}', which is not "
            "installed: install servobench[ros]"
        ) from None
    except Exception as error:
        # The libraries raise all kinds of them for a damaged file, MemoryError for one length.
        mend = "; 'rosbag reindex' may mend it" if head.startswith(ROS1) else ""
        known = type(error).__name__ == "ReaderError" and not mend
        reason = f" ({str(error).rstrip('.')})" if known else ""
        raise ValueError(f"{path}: this bag is damaged or incomplete{reason}{mend}") from None


@contextmanager
def _ros(path: Path, head: bytes) -> Generator[Contents]:
    from rosbags import rosbag1, rosbag2

    with rosbag1.Reader(path) if head.startswith(ROS1) else rosbag2.Reader(path) as reader:
        topics: dict[str, Topic] = {}
        for c in reader.connections:
            written = getattr(c.ext, "serialization_format", "ros1")
            before = topics[c.topic].count if c.topic in topics else 0
            count = before + c.msgcount
            topics[c.topic] = Topic(c.topic, plain_kind(c.msgtype), written, count)

        def messages(name: str) -> Iterator[tuple[float, bytes]]:
            of_topic = [c for c in reader.connections if c.topic == name]
            for _, recorded, data in reader.messages(of_topic):
                yield NANO * recorded, bytes(data)

        yield Contents(list(topics.values()), NANO * reader.duration, messages)


@contextmanager
def _mcap(path: Path) -> Generator[Contents]:
    with reading.opened(path, "bag") as file:

        def messages(name: str) -> Iterator[tuple[float, bytes]]:
            for _, _, message in _records(file, name):
                yield NANO * message.log_time, message.data

        topics, span = _summary(file) or _scan(file)
        yield Contents(topics, NANO * span, messages)


def _records(
    file: BinaryIO, topic: str | None = None
) -> Iterator[tuple[Schema | None, Channel, Message]]:
    """Read a log from its beginning to its end, or to the place where it was cut off."""
    from mcap.reader import NonSeekingReader

    file.seek(0)
    reader = NonSeekingReader(file, record_size_limit=LARGEST_RECORD)
    return reader.iter_messages(topic, log_time_order=False)


def _summary(file: BinaryIO) -> tuple[list[Topic], int] | None:
    """Return the topics and the span [ns] that a log states; None if it was cut off."""
    from mcap.reader import SeekingReader

    summary = None
    with suppress(Exception):  # mcap fails in many ways where the end is missing
        summary = SeekingReader(file, record_size_limit=LARGEST_RECORD).get_summary()
    if summary is None or summary.statistics is None:
        return None
    numbers = summary.statistics
    topics: dict[str, Topic] = {}
    for number, channel in summary.channels.items():
        count = numbers.channel_message_counts.get(number, 0)
        _count(topics, summary.schemas.get(channel.schema_id), channel, count)
    return list(topics.values()), numbers.message_end_time - numbers.message_start_time


def _scan(file: BinaryIO) -> tuple[list[Topic], int]:
    """Return the topics and the span [ns] of a log without a summary."""
    topics: dict[str, Topic] = {}
    times: list[int] = []
    try:
        for schema, channel, message in _records(file):
            _count(topics, schema, channel, 1)
            times.append(message.log_time)
    except Exception:  # the place where it was cut off
        if not times:
            raise
    return list(topics.values()), max(times, default=0) - min(times, default=0)


def _count(topics: dict[str, Topic], schema: Schema | None, channel: Channel, more: int) -> None:
    """Add messages of a channel to the topic it belongs to."""
    kind = plain_kind(schema.name) if schema else "no type"
    new = Topic(channel.topic, kind, channel.message_encoding, 0, schema)
    known = topics.get(channel.topic, new)
    topics[channel.topic] = replace(known, count=known.count + more)
