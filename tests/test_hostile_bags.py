"""Bags that are damaged, or made to fill the memory: each is refused or ends in one sentence."""

import bz2
import io
import re
import shutil
import tracemalloc
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.writer import CompressionType, Writer

from tracking.sequences import bag_file
from tracking.sequences.bag_file import Bag

bags = pytest.importorskip("bags", reason="rosbags and mcap are not installed")
pytest.importorskip("foxglove.messages", reason="foxglove-sdk is not installed")
FRAMES = 5
LIMIT = 100_000


def grey(store):
    """Pictures of one colour, which become small."""
    pixels = np.full((200, 200, 3), 90, np.uint8)
    return [
        (bags.START + k, bags.RAW, bags.raw(store, bags.START + k, pixels, "rgb8"))
        for k in range(FRAMES)
    ]


def refusal(path):
    with pytest.raises(ValueError) as refused:
        list(Bag(path, None))
    return str(refused.value)


def compressed_folder(path, mode):
    """A ROS 2 bag whose messages are compressed, each for itself, or whose file is."""
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    store = bags.ROS2
    plugin = StoragePlugin.MCAP if mode is CompressionMode.STORAGE else StoragePlugin.SQLITE3
    writer = Writer(path, version=9, storage_plugin=plugin)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/eye", bags.RAW, typestore=store)
        for recorded, kind, message in grey(store):
            writer.write(connection, recorded * bags.NS, store.serialize_cdr(message, kind))
    return path


def compressed(path):
    """A bag of 120 kB a picture whose chunks or messages are compressed to a few bytes."""
    from rosbags.rosbag1 import Writer
    from rosbags.rosbag2 import CompressionMode

    if path.suffix == ".mcap":
        return bags.write(path, {"/eye": grey})
    if path.name == "messages":
        return compressed_folder(path, CompressionMode.MESSAGE)
    if path.name == "chunks":
        return compressed_folder(path, CompressionMode.STORAGE)
    writer = Writer(path)
    writer.set_compression(getattr(Writer.CompressionFormat, path.stem.upper()))
    with writer:
        connection = writer.add_connection("/eye", bags.RAW, typestore=bags.ROS1)
        for recorded, kind, message in grey(bags.ROS1):
            data = bags.ROS1.serialize_ros1(message, kind)
            writer.write(connection, recorded * bags.NS, data)
    return path


@pytest.mark.parametrize("name", ["log.mcap", "lz4.bag", "bz2.bag", "messages", "chunks"])
def test_what_is_compressed_from_too_much_is_refused(tmp_path, monkeypatch, name):
    path = compressed(tmp_path / name)
    assert [picture.image.shape for picture in Bag(path, None)] == FRAMES * [(200, 200, 3)]
    monkeypatch.setattr(bag_file, "LARGEST_UNPACKED", LIMIT)
    sentence = f"{path}: a part of this bag is compressed from over 100,000 bytes"
    assert refusal(path) == sentence


@pytest.mark.parametrize("name", ["zstd", "lz4", "bz2"])
def test_data_is_decompressed_up_to_the_limit_whatever_they_state(monkeypatch, name):
    compress = {"zstd": zstandard.compress, "lz4": lz4.frame.compress, "bz2": bz2.compress}[name]
    monkeypatch.setattr(bag_file, "LARGEST_UNPACKED", LIMIT)
    small = bytes(range(200)) * 100
    assert bag_file._unpacked(compress(small), name) == small
    with pytest.raises(bag_file._Refused, match="compressed from over 100,000 bytes"):
        bag_file._unpacked(compress(bytes(50 * LIMIT)), name)


def test_inverted_bytes_in_a_log_end_it_with_a_sentence(tmp_path):
    path = bags.write(tmp_path / "log.mcap", {"/eye": lambda store: grey(store) * 3})
    whole = len(list(Bag(path, None)))
    data = bytearray(path.read_bytes())
    at = [match.start() for match in re.finditer(b"zstd", data)][7] + 30  # in the eighth chunk
    data[at : at + 30] = bytes(255 - byte for byte in data[at : at + 30])
    path.write_bytes(data)
    bag = Bag(path, None)
    found = list(bag)
    assert 0 < len(found) < whole == 3 * FRAMES
    assert bag.end.lost
    assert (
        bag.end.sentence == f"{path}: {len(found)} pictures, then this bag is damaged or incomplete"
    )


def test_inverted_bytes_in_a_log_that_is_not_compressed_are_noticed(tmp_path):
    """Its messages can be read, and only the CRC of their chunk does not fit."""
    path = tmp_path / "log.mcap"
    store = bags.ROS2
    rows = [(at, store.serialize_cdr(message, kind)) for at, kind, message in grey(store)]
    bags.write_mcap(path, "cdr", "ros2msg", {"/eye": (bags.RAW, rows)}, compressed=False)
    data = bytearray(path.read_bytes())
    at = data.index(bytes([90]) * 1000)
    data[at : at + 500] = bytes([165]) * 500
    path.write_bytes(data)
    assert refusal(path) == f"{path}: this bag is damaged or incomplete"


def test_a_file_that_is_compressed_whole_is_unpacked_up_to_a_limit(tmp_path, monkeypatch):
    from rosbags.rosbag2 import CompressionMode

    path = compressed_folder(tmp_path / "whole", CompressionMode.FILE)
    assert len(list(Bag(path, None))) == FRAMES
    monkeypatch.setattr(bag_file, "LARGEST_UNPACKED", LIMIT)
    monkeypatch.setattr(bag_file, "PIECE", 1000)
    monkeypatch.setattr(bag_file, "LARGEST_RATIO", 1)
    assert refusal(path) == f"{path}: a file of this bag is compressed from over 100,000 bytes"
    # A long recording is no bomb: it grows, but not by more than pictures do.
    monkeypatch.setattr(bag_file, "LARGEST_UNPACKED", 2 * LIMIT)
    monkeypatch.setattr(bag_file, "LARGEST_RATIO", 100_000)
    assert len(list(Bag(path, None))) == FRAMES


def test_a_full_temporary_disk_is_said():
    with (
        Path("/dev/full").open("r+b", buffering=0) as full,
        pytest.raises(bag_file._Refused, match=r"^it cannot be unpacked in .*: No space left on"),
    ):
        bag_file._unpack_file(io.BytesIO(bytes(10)), full, 100)


@pytest.mark.parametrize("name", ["log.mcap", "log_db3"])
def test_a_message_that_is_too_large_is_refused_though_nothing_compresses_it(
    tmp_path, monkeypatch, name
):
    path = tmp_path / name
    if name == "log_db3":
        bags.write(path, {"/eye": grey})
    else:
        store = bags.ROS2
        rows = [(at, store.serialize_cdr(message, kind)) for at, kind, message in grey(store)]
        bags.write_mcap(path, "cdr", "ros2msg", {"/eye": (bags.RAW, rows)}, compressed=False)
    monkeypatch.setattr(bag_file, "LARGEST_UNPACKED", LIMIT)
    assert refusal(path) == f"{path}: message 0 has over 100,000 bytes"


def test_an_index_that_takes_long_to_parse_is_refused(tmp_path):
    path = bags.write(tmp_path / "log_db3", {"/eye": grey})
    with (path / "metadata.yaml").open("a") as file:
        file.write("".join(f"key{k}: [1, 2, 3]\n" for k in range(60_000)))

    assert refusal(path) == f"{path}: metadata.yaml is too large; the limit is 1,000,000 bytes"


def test_a_link_out_of_a_bag_is_not_followed(tmp_path):
    path = bags.write(tmp_path / "log_db3", {"/eye": grey})
    (file,) = path.glob("*.db3")
    shutil.move(file, tmp_path / "elsewhere.db3")
    file.symlink_to(tmp_path / "elsewhere.db3")
    assert refusal(path) == f"{path}: {file.name} is a link out of the folder of this bag"


def test_a_link_to_a_whole_bag_and_a_link_inside_it_are_followed(tmp_path):
    path = bags.write(tmp_path / "log_db3", {"/eye": grey})
    (file,) = path.glob("*.db3")
    inside = path / "stored.db3"
    shutil.move(file, inside)
    file.symlink_to("stored.db3")
    (tmp_path / "link").symlink_to(path)
    assert len(list(Bag(tmp_path / "link", None))) == FRAMES


def test_a_message_of_one_endless_number_is_damaged_at_once(tmp_path):
    path = bags.foxglove(tmp_path / "log.mcap", {"/eye": [b"\x08" + b"\xff" * 1_000_000 + b"\x01"]})
    assert [p.reason for p in Bag(path, None)] == ["this message is cut off or damaged"]


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4])
def test_a_bag_of_one_chunk_is_held_in_memory_once(tmp_path, compression):
    size = 1 << 20
    path = tmp_path / "log.mcap"
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=1 << 30, compression=compression)
        writer.start()
        channel = writer.register_channel("/a", "json", 0)
        for k in range(30):
            writer.add_message(channel, k, bytes(size), k)
        writer.finish()
    tracemalloc.start()
    try:
        with bag_file._mcap(path) as bag:
            assert sum(len(data) for _, data in bag.messages("/a")) == 30 * size
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 45 * size  # 30 of the chunk, 4 of its growth, one message
