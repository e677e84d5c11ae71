"""Bags that are compressed, or damaged: these are refused or end in one sentence."""

import re
import shutil

import numpy as np
import pytest

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
    if path.name == "whole":
        return compressed_folder(path, CompressionMode.FILE)
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


@pytest.mark.parametrize("name", ["log.mcap", "lz4.bag", "bz2.bag", "messages", "chunks", "whole"])
def test_every_compression_is_read(tmp_path, name):
    path = compressed(tmp_path / name)
    assert [picture.image.shape for picture in Bag(path, None)] == FRAMES * [(200, 200, 3)]


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
    assert bag.end.sentence.startswith(
        f"{path}: {len(found)} pictures, then this bag is damaged or incomplete: copy "
        "or record it again ("
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
    sentence = f"{path}: this bag is damaged or incomplete: copy or record it again (crc validation failed in Chunk, "
    assert refusal(path).startswith(sentence)


def test_a_link_out_of_a_bag_is_not_followed(tmp_path):
    path = bags.write(tmp_path / "log_db3", {"/eye": grey})
    (file,) = path.glob("*.db3")
    shutil.move(file, tmp_path / "elsewhere.db3")
    file.symlink_to(tmp_path / "elsewhere.db3")
    assert (
        refusal(path)
        == f"{path}: {file.name} is a link out of the folder of this bag: replace the link by its file"
    )


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
    assert [p.reason for p in Bag(path, None)] == [
        "the message with this picture is cut off or damaged: copy or record the bag again"
    ]
