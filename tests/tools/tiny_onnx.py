"""Tiny networks as ONNX files, written by hand: protobuf needs no package."""

import numpy as np

FLOAT, INTS = 1, 7
"""Numbers of a tensor's element type, and of an attribute's type, in onnx.proto."""

STEEP, BLUE = 16.0, 0.3
"""Of the score: its steepness, and the normalised value of the first channel at which it is 0.5."""


def varint(number):
    out = b""
    while number > 0x7F:
        out += bytes([number & 0x7F | 0x80])
        number >>= 7
    return out + bytes([number])


def part(tag, value):
    """A field of a message: a number, a text, or a message in it."""
    if isinstance(value, int):
        return varint(tag << 3) + varint(value)
    data = value.encode() if isinstance(value, str) else value
    return varint(tag << 3 | 2) + varint(len(data)) + data


def tensor(name, values):
    values = np.asarray(values, np.float32)
    dims = b"".join(part(1, n) for n in values.shape)
    return dims + part(2, FLOAT) + part(8, name) + part(9, values.tobytes())


def value(name, shape):
    dims = b"".join(part(1, part(1, n)) for n in shape)
    return part(1, name) + part(2, part(1, part(1, FLOAT) + part(2, dims)))


def node(op, inputs, output, **lists):
    attributes = b"".join(
        part(5, part(1, key) + part(20, INTS) + b"".join(part(8, n) for n in numbers))
        for key, numbers in lists.items()
    )
    return b"".join(part(1, i) for i in inputs) + part(2, output) + part(4, op) + attributes


def model(nodes, weights, inputs, outputs):
    """A file's bytes.

    Args:
        nodes: What `node` gives, in order.
        weights: Constants by name.
        inputs, outputs: Shapes by name.
    """
    graph = b"".join(part(1, n) for n in nodes) + part(2, "tiny")
    graph += b"".join(part(5, tensor(name, v)) for name, v in weights.items())
    graph += b"".join(part(11, value(name, shape)) for name, shape in inputs.items())
    graph += b"".join(part(12, value(name, shape)) for name, shape in outputs.items())
    return part(1, 8) + part(7, graph) + part(8, part(1, "") + part(2, 13))


def vit(size):
    """A network in the shape of TrackerVit's that finds what is blue, with a box of a fixed size.

    The search area is read on a grid of 16 x 16. Only the first channel is used: OpenCV 5.0 divides
    by the standard deviations as if they were a quaternion, which negates the others.

    Args:
        size: Width and height of the box over the side of the search area.
    """
    grid = np.zeros((5, 3, 16, 16))
    grid[0, 0] = STEEP / 256
    bias = np.array([-STEEP * BLUE, *size, 0.5, 0.5])
    shapes = {"output1": (1, 1, 16, 16), "output2": (1, 2, 16, 16), "output3": (1, 2, 16, 16)}
    parts = {"1": slice(0, 1), "2": slice(1, 3), "3": slice(3, 5)}
    weights = {f"w{k}": grid[at] for k, at in parts.items()}
    weights |= {f"b{k}": bias[at] for k, at in parts.items()} | {"zero": np.zeros((2, 3, 1, 1))}
    nodes = [
        node("Conv", ["search", f"w{k}", f"b{k}"], f"c{k}", kernel_shape=[16, 16], strides=[16, 16])
        for k in parts
    ]
    nodes += [
        # The template must be read; pooled before the sum, because OpenCV fuses it with a Conv.
        node("GlobalAveragePool", ["template"], "mean"),
        node("Conv", ["mean", "zero"], "c4", kernel_shape=[1, 1]),
        node("MaxPool", ["c4"], "nothing", kernel_shape=[1, 1]),
        node("MaxPool", ["c3"], "offset", kernel_shape=[1, 1]),
        node("Add", ["offset", "nothing"], "output3"),
        node("Sigmoid", ["c1"], "output1"),
        node("Identity", ["c2"], "output2"),
    ]
    inputs = {"template": (1, 3, 128, 128), "search": (1, 3, 256, 256)}
    return model(nodes, weights, inputs, shapes)
