"""The pictures of one topic of a bag: MCAP, ROS 1 (.bag), ROS 2 (a folder, or one .db3 file)."""

from __future__ import annotations

import importlib
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from sim.files import reading
from tracking.sequences.image_message import KINDS, NANO, picture_of, plain_kind
from tracking.sequences.sources import RATE, End, Picture, Times

MCAP, ROS1, SQLITE = b"\x89MCAP0\r\n", b"#ROSBAG V", b"SQLite format 3"
"""First bytes of the files."""
INDEX = "metadata.yaml"
INDEXED = b"rosbag2_bagfile_information"
"""The file that makes a folder a ROS 2 bag, and what it has near its beginning."""
HEAD = 1000
LARGEST = 1_000_000_000
"""Length of the beginning that is looked at, and of the largest record of an MCAP file [bytes]."""
MOST_NAMED = 8
"""Most topics in a message."""


@dataclass(frozen=True, slots=True)
class Topic:
    """One topic: its type without "/msg", how its messages are written, how many there are."""

    name: str
    kind: str
    serialization: str
    count: int

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

    topics: Iterable[Topic]
    span: float
    """Time from the first message to the last [s]."""
    messages: Callable[[str], Iterator[tuple[float, bytes]]]
    """The messages of a topic: when each was recorded [s], and its bytes."""


def is_bag(path: Path) -> bool:
    """Whether a path is a bag by its content; false for what cannot be read."""
    try:
        folder = path.is_dir()
        with reading.opened(path / INDEX if folder else path, "bag") as file:
            head = file.read(HEAD)
    except (OSError, ValueError):
        return False
    return INDEXED in head if folder else head.startswith((MCAP, ROS1, SQLITE))


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
            topics = list(bag.topics)
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
                for recorded, data in bag.messages(topic.name):
                    name = f"message {index}"
                    try:
                        stamp, image = picture_of(topic.kind, topic.serialization, data)
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
    found = [topic for topic in images if name in (None, topic.name)]
    if len(found) == 1 and found[0].count:
        return found[0]
    if found and not found[0].count and len(found) == 1:
        raise ValueError(f"{path}: there are no messages in {found[0].name}")
    if not images:
        there = [f"{topic.name} ({topic.shown_kind})" for topic in topics]
        raise ValueError(f"{path}: no topic has pictures; there is {_listed(there)}")
    there = _listed([f"{topic.name} ({topic.count})" for topic in images])
    if name is None:
        raise ValueError(
            f"{path}: there are several topics with pictures; choose one with --topic: {there}"
        )
    raise ValueError(f"{path}: there is no topic '{name}' with pictures; there is {there}")


def _listed(names: list[str]) -> str:
    more = len(names) - MOST_NAMED
    return ", ".join(names[:MOST_NAMED] + ([f"and {more} more"] if more > 0 else [])) or "none"


@contextmanager
def _opened(path: Path) -> Generator[Contents]:
    """A bag of any kind.

    Raises:
        ValueError: It cannot be read; also later, where it is damaged. The libraries raise all
            kinds of exceptions for a damaged file.
    """
    head = b""
    try:
        if not path.is_dir():
            with reading.opened(path, "bag") as file:
                head = file.read(HEAD)
        with _mcap(path) if head.startswith(MCAP) else _ros(path, head) as found:
            yield found
    except (MemoryError, GeneratorExit):
        raise
    except ModuleNotFoundError as error:
        raise ValueError(
            f"{path}: bags are read by the package '{error.name}', which is not "
            "installed: install servobench[ros]"
        ) from None
    except Exception as error:
        mend = "; 'rosbag reindex' may mend it" if head.startswith(ROS1) else ""
        known = type(error).__name__ in ("ReaderError", "EndOfFile") and not mend
        reason = f" ({str(error).rstrip('.')})" if known and str(error) else ""
        raise ValueError(f"{path}: this bag is damaged or incomplete{reason}{mend}") from None


@contextmanager
def _ros(path: Path, head: bytes) -> Generator[Contents]:
    if head.startswith(ROS1):
        reader: Any = importlib.import_module("rosbags.rosbag1").Reader(path)
    else:
        plugins = importlib.import_module("rosbags.rosbag2.reader").Reader.STORAGE_PLUGINS
        reader = plugins["dir" if path.is_dir() else ".db3"](path)
    reader.open()
    try:
        topics: dict[str, Topic] = {}
        for c in reader.connections:
            before = topics[c.topic].count if c.topic in topics else 0
            written = getattr(c.ext, "serialization_format", "ros1")
            topics[c.topic] = Topic(c.topic, plain_kind(c.msgtype), written, before + c.msgcount)

        def messages(name: str) -> Iterator[tuple[float, bytes]]:
            asked = [c for c in reader.connections if c.topic == name]
            for _, recorded, data in reader.messages(asked, None, None):
                yield NANO * recorded, bytes(data)

        times = reader if head.startswith(ROS1) else reader.metadata
        yield Contents(topics.values(), NANO * times.duration, messages)
    finally:
        reader.close()


@contextmanager
def _mcap(path: Path) -> Generator[Contents]:
    with reading.opened(path, "bag") as file:
        log = _Log(file)

        def messages(name: str) -> Iterator[tuple[float, bytes]]:
            for record in log.records():
                if not isinstance(record, log.kinds.Message):
                    continue
                if log.channels[record.channel_id].topic == name:
                    yield NANO * record.log_time, record.data

        yield Contents(log.topics(), NANO * log.span, messages)


class _Log:
    """An open MCAP file: what its summary states, or else what a look at all records finds."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._reader = importlib.import_module("mcap.reader")
        self.kinds: Any = importlib.import_module("mcap.records")
        self.channels: dict[int, Any] = {}
        self._schemas: dict[int, Any] = {}
        self.counts: Counter[int] = Counter()
        self.span = 0
        summary = None
        with suppress(Exception):  # the file of a killed writer has none
            summary = self._reader.SeekingReader(file, record_size_limit=LARGEST).get_summary()
        if summary is None or summary.statistics is None:
            self._scan()
            return
        self.channels = dict(summary.channels)
        self._schemas = dict(summary.schemas)
        self.counts.update(summary.statistics.channel_message_counts)
        self.span = summary.statistics.message_end_time - summary.statistics.message_start_time

    def records(self) -> Iterator[Any]:
        """All records from the first on; channels are remembered."""
        self._file.seek(0)
        for record in self._reader.StreamReader(self._file, record_size_limit=LARGEST).records:
            if isinstance(record, self.kinds.Channel):
                self.channels[record.id] = record
            elif isinstance(record, self.kinds.Schema):
                self._schemas[record.id] = record
            yield record

    def _scan(self) -> None:
        times: list[int] = []
        try:
            for record in self.records():
                if isinstance(record, self.kinds.Message):
                    self.counts[record.channel_id] += 1
                    times.append(record.log_time)
        except Exception:
            if not times:
                raise
        self.span = max(times) - min(times) if times else 0

    def topics(self) -> list[Topic]:
        found: dict[str, Topic] = {}
        for number, channel in self.channels.items():
            schema = self._schemas.get(channel.schema_id)
            kind = plain_kind(schema.name) if schema else "no type"
            before = found[channel.topic].count if channel.topic in found else 0
            found[channel.topic] = Topic(
                channel.topic, kind, channel.message_encoding, before + self.counts[number]
            )
        return list(found.values())
