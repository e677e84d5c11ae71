"""A policy that is an ONNX file."""

import sys
import time

import cv2
import numpy as np
import pytest
import tiny_onnx
from onnx import TensorProto, helper, numpy_helper
from tiny_onnx import node

import servo
from servo import Mistake
from servo.loop.episode import Episode
from servo.testing import check_controller

SHORT = ["run.duration=0.2", "run.latency=0", "estimator.kind=none", "tracker.kind=frozen"]
HEIGHT, WIDTH = 24, 32
RNG = np.random.default_rng(0)
OF_PICTURE, OF_GOAL = RNG.normal(0, 1e-4, (2, 6, 3, HEIGHT, WIDTH))
OF_JOINTS = RNG.normal(0, 1e-2, (6, 6))


def network(shapes):
    """A file's bytes: the twist is a linear function of what it takes."""
    whole = {"kernel_shape": [HEIGHT, WIDTH]}
    parts = {
        "picture": [node("Conv", ["picture", "wp"], "cp", **whole), node("Flatten", ["cp"], "p")],
        "goal_picture": [
            node("Conv", ["goal_picture", "wg"], "cg", **whole),
            node("Flatten", ["cg"], "g"),
        ],
        "joints": [node("MatMul", ["joints", "wj"], "j")],
    }
    made = [each for name in shapes for each in parts.get(name, ())]
    sums = [name[0] for name in shapes if name in parts]
    made.append(node("Sum", sums, "twist"))
    weights = {"wp": OF_PICTURE, "wg": OF_GOAL, "wj": OF_JOINTS}
    return tiny_onnx.model(made, weights, shapes, {"twist": (1, 6)})


PICTURE = (1, 3, HEIGHT, WIDTH)


def linear(path, **shapes):
    path.write_bytes(network(shapes))
    return [*SHORT, "controller.kind=onnx", f"controller.file={path}"]


def small(picture):
    resized = cv2.resize(picture, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    return resized.transpose(2, 0, 1) / 255


def test_it_is_given_pictures_from_0_to_1_in_planes_and_joints(tmp_path):
    settings = linear(tmp_path / "p.onnx", picture=PICTURE, goal_picture=PICTURE, joints=(1, 6))
    with Episode(servo.load("line", settings)) as episode:
        steps = list(episode)
        goal = small(episode.goal_picture)
    assert steps[0].joints.shape == (6,)
    for step in steps:
        expected = np.tensordot(OF_PICTURE, small(step.frame.image), 3)
        expected = expected + np.tensordot(OF_GOAL, goal, 3) + step.joints @ OF_JOINTS
        np.testing.assert_allclose(step.command.twist, expected, rtol=1e-4, atol=1e-6)
    assert np.abs(steps[-1].command.twist).max() > 1e-3


def test_a_network_may_take_the_picture_alone(tmp_path):
    path = tmp_path / "p.onnx"
    settings = linear(path, picture=PICTURE)
    step = next(servo.run(servo.load("line", settings)))
    expected = np.tensordot(OF_PICTURE, small(step.frame.image), 3)
    np.testing.assert_allclose(step.command.twist, expected, rtol=1e-4, atol=1e-6)
    check_controller(servo.load("line", settings).controller)


def test_it_is_given_camera_pose_and_depth_since_the_first_picture(tmp_path):
    path = tmp_path / "p.onnx"
    shapes = {"camera": (1, 4), "pose": (1, 12), "depth": (1, 1), "joints": (1, 6)}
    shares = {name: np.zeros((shape[1], 6)) for name, shape in shapes.items()}
    shares["camera"][:, 0] = [1e-4, 2e-4, 3e-4, 5e-4]
    shares["pose"][9:, 1:4] = np.eye(3)
    shares["pose"][[0, 4, 8], 5] = 0.01
    shares["depth"][0, 4] = 0.1
    shares["joints"][:, 3] = 0.3
    products = [node("MatMul", [name, f"w{name}"], f"p{name}") for name in shapes]
    whole = node("Sum", [f"p{name}" for name in shapes], "twist")
    weights = {f"w{name}": share for name, share in shares.items()}
    path.write_bytes(tiny_onnx.model([*products, whole], weights, shapes, {"twist": (1, 6)}))
    settings = [*SHORT, "controller.kind=onnx", f"controller.file={path}"]
    with Episode(servo.load("line", settings)) as episode:
        steps = list(episode)
        camera, depth = episode.world.camera, 1 / episode.goal.sight_at(0.0).plane.C
    first = steps[0].truth.T_world_camera
    intrinsics = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    for step in steps:
        moved = first.inverse() @ step.truth.T_world_camera
        expected = np.concatenate([[intrinsics @ shares["camera"][:, 0]], moved.translation])
        joints = 0.3 * (step.joints - steps[0].joints).sum()
        expected[3] += joints
        expected = np.append(expected, [0.1 * depth, 0.01 * np.trace(moved.rotation)])
        np.testing.assert_allclose(step.command.twist, expected, atol=2e-5)
    assert abs(steps[-1].joints - steps[0].joints).max() > 1e-3


@pytest.mark.parametrize(
    ("shapes", "sentence"),
    [
        (
            {"image": PICTURE},
            "the network's input 'image' is not one of picture, goal_picture, joints, camera, "
            "pose, depth: rename the input",
        ),
        (
            {"picture": (1, 4, HEIGHT, WIDTH)},
            "the network's input 'picture' is (1, 4, 24, 32) of tensor(float); expected "
            "(1, 3, height, width) of tensor(float)",
        ),
        (
            {"picture": (1, 3, HEIGHT)},
            "the network's input 'picture' is (1, 3, 24) of tensor(float)",
        ),
    ],
)
def test_a_network_that_takes_something_else_is_refused(tmp_path, shapes, sentence):
    path = tmp_path / "p.onnx"
    nodes = [node("Flatten", [name], "twist") for name in shapes]
    path.write_bytes(tiny_onnx.model(nodes, {}, shapes, {"twist": (1, 6)}))
    assert f"line: controller: {path}: {sentence}" in refused(path)


def test_what_cannot_be_used_is_one_sentence(tmp_path, monkeypatch):
    path = tmp_path / "p.onnx"
    assert (
        refused(path)
        == f"line: controller: file = '{path}': there is no such file: name the network's file"
    )
    assert (
        refused("") == "line: controller: file = '': there is no such file: name the network's file"
    )
    path.write_bytes(b"no network at all" * 9)
    unreadable = (
        f"line: controller: file = '{path}': ONNX Runtime cannot load this network; export it"
    )
    assert refused(path).startswith(f"{unreadable} again: Load model from ")
    unknown = tiny_onnx.model(
        [node("Unknown", ["joints"], "twist")], {}, {"joints": (1, 6)}, {"twist": (1, 6)}
    )
    path.write_bytes(unknown)  # the reason itself has " : " in it
    assert refused(path).startswith(f"{unreadable} again: Load model from ")
    assert "No Op registered for Unknown" in refused(path)
    for weights, sentence in (
        (
            np.ones((3, 6)),
            "controller 'onnx': ONNX Runtime cannot run the network; correct it: Got invalid dimensions for",
        ),
        (np.ones((6, 3)), "it should be a NumPy array of six finite numbers (vx, "),
        (np.full((6, 6), np.nan), "Command.twist is [nan nan nan nan nan nan]"),
    ):
        taken, given = weights.shape
        shapes = {"joints": (1, taken)}, {"twist": (1, given)}
        product = node("MatMul", ["joints", "wj"], "twist")
        path.write_bytes(tiny_onnx.model([product], {"wj": weights}, *shapes))
        assert sentence in refused(path)
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    assert refused(path) == (
        "line: controller: the controller 'onnx' needs ONNX Runtime: pip install 'servobench[onnx]'"
    )


def test_a_network_that_never_ends_is_a_sentence(tmp_path):
    path = tmp_path / "p.onnx"
    path.write_bytes(endless())
    began = time.monotonic()
    assert refused(path, "controller.timeout=0.3") == (
        "controller 'onnx': the network gave no twist within 0.3 s: correct the network, or set a "
        "longer controller.timeout"
    )
    assert time.monotonic() - began < 20.0


def endless():
    """A file's bytes: a loop whose condition stays true, around the joints."""
    names = ("turn", TensorProto.INT64, []), ("goes", TensorProto.BOOL, [])
    state = "joints", TensorProto.FLOAT, [1, 6]
    inside = [helper.make_tensor_value_info(*each) for each in (*names, state)]
    outside = [helper.make_tensor_value_info("on", TensorProto.BOOL, [])]
    outside.append(helper.make_tensor_value_info("next", TensorProto.FLOAT, [1, 6]))
    nodes = [
        helper.make_node("Identity", ["goes"], ["on"]),
        helper.make_node("Sin", ["joints"], ["next"]),
    ]
    body = helper.make_graph(nodes, "body", inside, outside)
    yes = helper.make_node("Constant", [], ["yes"], value=numpy_helper.from_array(np.array(True)))
    loop = helper.make_node("Loop", ["", "yes", "joints"], ["twist"], body=body)
    given = helper.make_tensor_value_info(*state)
    found = helper.make_tensor_value_info("twist", TensorProto.FLOAT, [1, 6])
    graph = helper.make_graph([yes, loop], "endless", [given], [found])
    opset = [helper.make_opsetid("", 13)]
    return helper.make_model(graph, ir_version=8, opset_imports=opset).SerializeToString()


def refused(path, *more):
    with pytest.raises(Mistake) as found:
        servo.simulate("line", [*SHORT, "controller.kind=onnx", f"controller.file={path}", *more])
    assert "\n" not in str(found.value)
    return str(found.value)
