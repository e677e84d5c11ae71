"""Bags with image topics: MCAP, ROS 1, ROS 2; written by rosbags and mcap, as recorders do."""

import cv2
import numpy as np
from foxglove import messages
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
NS = 10**9
START = 1_700_000_000
RAW, COMPRESSED, TEXT = (
    "sensor_msgs/msg/Image",
    "sensor_msgs/msg/CompressedImage",
    "std_msgs/msg/String",
)


def header(store, stamp):
    ns = round(stamp * NS)
    kinds = store.types
    time = kinds["builtin_interfaces/msg/Time"](ns // NS, ns % NS)
    count = {"seq": 7} if store is ROS1 else {}
    return kinds["std_msgs/msg/Header"](stamp=time, frame_id="eye", **count)


def raw(store, stamp, pixels, encoding, padding=0):
    """An Image message of an array (H, W, C), with unused bytes at the end of each row."""
    height, width = pixels.shape[:2]
    rows = np.ascontiguousarray(pixels).reshape(height, -1)
    rows = np.hstack([rows, np.full((height, padding), 99, np.uint8)])
    return store.types[RAW](
        header(store, stamp), height, width, encoding, 0, rows.shape[1], rows.ravel()
    )


def jpeg(store, stamp, bgr):
    data = cv2.imencode(".png", bgr)[1].ravel()
    return store.types[COMPRESSED](header(store, stamp), "png", data)


def text(store):
    return store.types[TEXT]("hello")


def write(path, topics):
    """A bag of the kind that its name tells; topics: name to a function of the type store that
    gives (recorded [s], type, message)."""
    form = {".bag": "ros1", ".mcap": "mcap"}.get(path.suffix, "ros2")
    store = ROS1 if form == "ros1" else ROS2
    items = {name: make(store) for name, make in topics.items()}
    if form == "mcap":
        return _mcap(path, store, items)
    plugin = StoragePlugin.MCAP if path.name.endswith("_mcap") else StoragePlugin.SQLITE3
    writer = Writer1(path) if form == "ros1" else Writer2(path, version=9, storage_plugin=plugin)
    code = store.serialize_ros1 if form == "ros1" else store.serialize_cdr
    with writer:
        for name, rows in items.items():
            connection = writer.add_connection(name, rows[0][1], typestore=store)
            for recorded, kind, message in rows:
                writer.write(connection, round(recorded * NS), code(message, kind))
    return path


def _mcap(path, store, items):
    rows = {
        name: (rows[0][1], [(recorded, store.serialize_cdr(m, kind)) for recorded, kind, m in rows])
        for name, rows in items.items()
    }
    return write_mcap(path, "cdr", "ros2msg", rows)


def write_mcap(path, encoding, schemas, topics, profile="ros2", *, compressed=True):
    """topics: name to (type, [(recorded [s], bytes)])."""
    packed = CompressionType.ZSTD if compressed else CompressionType.NONE
    with path.open("wb") as file:
        writer = McapWriter(file, chunk_size=20_000, compression=packed)
        writer.start(profile=profile, library="test")
        for name, (kind, rows) in topics.items():
            schema = writer.register_schema(name=kind, encoding=schemas, data=b"")
            channel = writer.register_channel(
                schema_id=schema, topic=name, message_encoding=encoding
            )
            for recorded, data in rows:
                ns = round(recorded * NS)
                writer.add_message(channel, log_time=ns, publish_time=ns, data=bytes(data))
        writer.finish()
    return path


def foxglove(path, topics):
    """An MCAP file of foxglove-sdk's; topics: name to messages, or to bytes of CompressedImage."""
    rows = {}
    for name, found in topics.items():
        kind = type(found[0]) if not isinstance(found[0], bytes) else messages.CompressedImage
        data = [m if isinstance(m, bytes) else m.encode() for m in found]
        rows[name] = (kind.get_schema(), [(START + k, d) for k, d in enumerate(data)])
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start(profile="", library="test")
        for name, (schema, items) in rows.items():
            number = writer.register_schema(schema.name, schema.encoding, schema.data)
            channel = writer.register_channel(name, "protobuf", number)
            for recorded, data in items:
                ns = round(recorded * NS)
                writer.add_message(channel, log_time=ns, publish_time=ns, data=data)
        writer.finish()
    return path
