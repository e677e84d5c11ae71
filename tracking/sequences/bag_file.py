"""The pictures of one topic of a bag: MCAP, ROS 1 (.bag), ROS 2 (a folder, or one .db3 file).

`mcap` and `rosbags` read the files and decode the messages. What they decompress is limited here: a
few bytes can become more than the memory holds.
"""

from __future__ import annotations

from bz2 import BZ2Decompressor
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from io import BytesIO
from pathlib import Path
from tempfile import gettempdir
from types import SimpleNamespace
from typing import TYPE_CHECKING, BinaryIO

from sim.files import reading
from sim.files.bit_depth import BitDepth
from tracking.sequences.image_message import (
    KINDS,
    NANO,
    decoder_of,
    picture_of,
    plain_kind,
)
from tracking.sequences.sources import RATE, SECOND, End, Picture, timed

if TYPE_CHECKING:
    from mcap.records import Channel, McapRecord, Message, Schema

MCAP = b"\x89MCAP0\r\n"
ROS1 = b"#ROSBAG V"
SQLITE = b"SQLite format 3"
"""First bytes of the files."""
INDEX = "metadata.yaml"
INDEX_KEY = b"rosbag2_bagfile_information"
"""The file that makes a folder a ROS 2 bag, and its key near the beginning."""
HEAD = 1000
"""Length of the beginning in which the key is searched for [bytes]."""
LARGEST_INDEX = 1_000_000
"""Largest metadata.yaml [bytes]: thousands of files; the parser takes seconds for it."""
LARGEST_RECORD = 1_000_000_000
"""Largest record of an MCAP file that is read into memory [bytes]."""
LARGEST_UNPACKED = 150_000_000
"""Largest decompressed chunk or message [bytes]: a picture of 7680x4320 px in colour has 100 MB."""
LARGEST_RATIO = 100
"""Most that a larger file that is compressed whole may grow: pictures shrink by 2 to 20 times."""
PIECE = 1 << 20
"""Bytes that are unpacked at a time."""
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
    messages: Callable[[str], Iterator[tuple[int, bytes]]]
    """Gives the messages of a topic: when each was recorded [ns], and its bytes."""


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
        return timed(self._messages(), self.rate)

    def _messages(self) -> Iterator[tuple[float | None, Picture]]:
        """Give the stamp [s] of each picture, and the picture without its time."""
        topic = self._topic
        depth = BitDepth()
        index = 0
        self.end = None
        try:
            with _opened(self.path) as bag:
                decode = decoder_of(topic.kind, topic.serialization, topic.schema)
                for recorded, data in bag.messages(topic.name):
                    name = f"message {index}"
                    if len(data) > LARGEST_UNPACKED:
                        raise _Refused(f"{name} has over {LARGEST_UNPACKED:,} bytes")
                    try:
                        stated, image = picture_of(decode, data, depth)
                    except ValueError as error:
                        yield None, Picture(name, 0.0, None, str(error))
                    else:
                        stamp = recorded if stated is None else stated
                        picture = Picture(name, 0.0, image, stamp=stamp, notes=depth.notes)
                        yield stamp // SECOND + NANO * (stamp % SECOND), picture
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
        if path.is_dir():
            _check_folder(path)
        else:
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
    except _Refused as error:
        raise ValueError(f"{path}: {error}") from None
    except Exception as error:
        # The libraries raise all kinds of them for a damaged file, MemoryError for one length.
        mend = "; 'rosbag reindex' may mend it" if head.startswith(ROS1) else ""
        known = type(error).__name__ == "ReaderError" and not mend
        reason = f" ({str(error).rstrip('.')})" if known else ""
        raise ValueError(f"{path}: this bag is damaged or incomplete{reason}{mend}") from None


class _Refused(Exception):
    """What a bag has and should not have, in words that follow its path."""


def _check_folder(path: Path) -> None:
    """Refuse a ROS 2 bag with links to other folders, or with an index that takes long to parse."""
    for file in path.iterdir():
        if file.resolve().parent != path.resolve():
            raise _Refused(f"{file.name} is a link out of the folder of this bag")
    if (path / INDEX).stat().st_size > LARGEST_INDEX:
        raise _Refused(f"{INDEX} is too large; the limit is {LARGEST_INDEX:,} bytes")


def _unpacked(data: bytes, compression: str) -> bytes:
    """Decompress a chunk or message up to `LARGEST_UNPACKED`."""
    from lz4.frame import LZ4FrameDecompressor
    from rosbags.rosbag2.reader import zstd  # pyright: ignore[reportPrivateImportUsage]

    if not compression:
        return data
    kinds = {"zstd": zstd.ZstdDecompressor, "lz4": LZ4FrameDecompressor, "bz2": BZ2Decompressor}
    decompressor = kinds[compression]()
    found = BytesIO()  # it grows in place, where one call would hold all of it twice
    piece = decompressor.decompress(data, PIECE)
    while piece:
        found.write(piece)
        if found.tell() > LARGEST_UNPACKED:
            raise _Refused(f"a part of this bag is compressed from over {LARGEST_UNPACKED:,} bytes")
        piece = b"" if decompressor.eof else decompressor.decompress(b"", PIECE)
    return found.getvalue()


def _unpack_file(packed: BinaryIO, unpacked: BinaryIO, most: int) -> None:
    """Write a file that is compressed whole to the temporary disk, up to a size [bytes]."""
    while piece := packed.read(PIECE):
        if unpacked.tell() + len(piece) > most:
            raise _Refused(f"a file of this bag is compressed from over {most:,} bytes")
        try:
            unpacked.write(piece)
            unpacked.flush()
        except OSError as error:
            raise _Refused(f"it cannot be unpacked in {gettempdir()}: {error.strerror}") from None


@contextmanager
def _ros(path: Path, head: bytes) -> Generator[Contents]:
    from rosbags import rosbag1, rosbag2
    from rosbags.rosbag1 import reader as reader1
    from rosbags.rosbag2 import reader as reader2
    from rosbags.rosbag2 import storage_mcap

    largest = max((file.stat().st_size for file in path.glob("*")), default=0)
    most = max(LARGEST_UNPACKED, LARGEST_RATIO * largest)
    limited = SimpleNamespace(copyfileobj=partial(_unpack_file, most=most))
    reader2.__dict__["shutil"] = limited  # in this module only
    for name in ("lz4", "bz2"):
        reader1.decompressors[name] = lambda data, name=name: _unpacked(data, name)
    for name in ("lz4", "zstd"):
        storage_mcap.DECOMPRESSORS[name] = lambda data, _, name=name: _unpacked(data, name)
    with rosbag1.Reader(path) if head.startswith(ROS1) else rosbag2.Reader(path) as reader:
        packed = ""
        if isinstance(reader, rosbag2.Reader) and reader.compression_mode == "message":
            packed = reader.compression_format or ""
            reader.storage.metadata = reader.storage.metadata._replace(compression_mode=None)
        topics: dict[str, Topic] = {}
        for c in reader.connections:
            written = getattr(c.ext, "serialization_format", "ros1")
            count = (topics[c.topic].count if c.topic in topics else 0) + c.msgcount
            topics[c.topic] = Topic(c.topic, plain_kind(c.msgtype), written, count)

        def messages(name: str) -> Iterator[tuple[int, bytes]]:
            of_topic = [c for c in reader.connections if c.topic == name]
            for _, recorded, data in reader.messages(of_topic):
                yield recorded, _unpacked(bytes(data), packed)

        yield Contents(list(topics.values()), NANO * reader.duration, messages)


@contextmanager
def _mcap(path: Path) -> Generator[Contents]:
    with reading.opened(path, "bag") as file:

        def messages(name: str) -> Iterator[tuple[int, bytes]]:
            for _, channel, message in _records(file):
                if channel.topic == name:
                    yield message.log_time, message.data

        topics, span = _summary(file) or _scan(file)
        yield Contents(topics, NANO * span, messages)


def _records(file: BinaryIO) -> Iterator[tuple[Schema | None, Channel, Message]]:
    """Read a log from its beginning to its end, or to the place where it was cut off."""
    from mcap.records import Channel, Message, Schema

    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    for record in _parts(file):
        if isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel):
            channels[record.id] = record
        elif isinstance(record, Message):
            channel = channels[record.channel_id]
            yield schemas.get(channel.schema_id), channel, record


def _parts(file: BinaryIO) -> Iterator[McapRecord]:
    """Read all records of a log, also those in its chunks, and check their CRCs."""
    from mcap.records import Chunk
    from mcap.stream_reader import StreamReader, get_chunk_data_stream

    file.seek(0)
    reader = StreamReader(
        file, emit_chunks=True, validate_crcs=True, record_size_limit=LARGEST_RECORD
    )
    for record in reader.records:
        if isinstance(record, Chunk):
            data = _unpacked(record.data, record.compression)
            record = replace(record, data=data, compression="")
            _, length = get_chunk_data_stream(record, validate_crc=True)
            chunk = BytesIO(data)
            within = StreamReader(chunk, skip_magic=True, record_size_limit=LARGEST_RECORD).records
            while chunk.tell() < length:  # one by one: a list would hold all messages again
                yield next(within)
        else:
            yield record


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
