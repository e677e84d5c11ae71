"""The classic schemes against ViSP 3.5: values, matrices, one step, closed loops."""

from dataclasses import replace

import numpy as np
import pytest
from schemes import SETS, features_of, pose_of, seen_in, without_turns
from servoing import posture_of

from servo.controllers.ibvs import Config
from servo.estimators import none
from servo.features.photometric import brightness, brightness_matrix
from servo.parts import Task
from servo.types import DOF, CameraImage, Plane, Prediction
from sim.geometry import exp_se3
from sim.types import Camera, Pose

CAMERA = Camera(600.0, 600.0, 320.0, 240.0, 640, 480)


def bound(expected, factor=1.0):
    """The largest difference that rounding explains, entry by entry."""
    return factor * 1e-9 * np.maximum(1.0, np.abs(expected))


def near(found, expected, factor=1.0, where=""):
    expected = np.array(expected)
    wrong = np.abs(np.asarray(found) - expected) - bound(expected, factor)
    assert wrong.max() <= 0, f"{where}: {wrong.max():.2e} over the bound"


def law(sets, matrix, **changes):
    """The law of a scheme without limits, on all six degrees of freedom."""
    config = {"gain": 1.0, "dof": DOF, "matrix": matrix, "fastest": 1e9, "fastest_turn": 1e9}
    return Config(**(config | {"feed_forward": sets.names} | changes)).build(
        np.random.default_rng()
    )


def started(controller, sets, goal, estimator):
    estimator.start(sets)
    controller.start(Task(goal, sets, estimator, CAMERA, np.zeros((4, 3))))
    return controller


@pytest.mark.reference
@pytest.mark.parametrize("scheme", SETS)
def test_values_matrices_and_a_step(scheme_case, scheme):
    case, expected = scheme_case, scheme_case["schemes"][scheme]
    goal = seen_in(pose_of(case["t_star"], case["thetau_star"]))
    seen = seen_in(pose_of(case["t"], case["thetau"]), goal)
    sets = features_of(scheme)
    values, values_star = sets.values(seen), sets.values(goal)
    for found, name in ((values, "s"), (values_star, "s_star")):
        left = without_turns(scheme, found - expected[name])
        near(np.array(expected[name]) + left, expected[name], where=name)
    near(sets.error(values, values_star), expected["e"], where="e")
    near(sets.matrix(seen), expected["L"], where="L")
    near(sets.matrix(goal), expected["L_star"], where="L*")
    for matrix in ("current", "desired", "mean"):
        estimator = none.Config().build(np.random.default_rng())
        controller = started(law(sets, matrix), sets, goal, estimator)
        twist = controller.command(seen, posture_of(np.zeros(6)), 0.04).twist
        near(twist, expected[f"v_{matrix}"], where=f"v_{matrix}")


@pytest.mark.reference
def test_photometric_matrix_and_step(luminance_case):
    case = luminance_case
    camera = Camera(
        case["px"], case["py"], case["u0"] + 0.5, case["v0"] + 0.5, case["cols"], case["rows"]
    )
    now, goal = (
        CameraImage(np.repeat(np.array(case[name], np.uint8)[..., None], 3, axis=2), camera)
        for name in ("I", "I_star")
    )
    L, L_star = (brightness_matrix(p, case["Z"]) for p in (now, goal))
    near(L, case["L"], where="L")
    near(L_star, case["L_star"], where="L*")
    e = (brightness(now) - brightness(goal)).ravel()
    for matrix, name in ((L, "current"), (L_star, "desired"), ((L + L_star) / 2, "mean")):
        near(-np.linalg.pinv(matrix, 1e-6) @ e, case[f"v_{name}"], where=name)


@pytest.mark.reference
def test_closed_loop_of_a_scheme(scheme_loop):
    run = scheme_loop
    sets, goal = features_of(run["scheme"]), wrong_depth(seen_in(pose_of(*run["desired"])), run)
    gain = dict(zip(("gain", "gain_far", "gain_slope"), run["gain"], strict=False))
    estimator = Ideal() if run.get("feedforward") else none.Config().build(None)
    controller = started(law(sets, run["L"], **gain), sets, goal, estimator)
    camera, target = pose_of(*run["start"]).inverse(), Pose(np.eye(3), np.zeros(3))
    factor = 10.0 if run["amplification"] > 1e3 else 1.0
    stored = {k: i for i, k in enumerate(run["k"]) if k <= run.get("exact_until_k", np.inf)}
    for k in range(max(stored) + 1):
        T_camera_object = camera.inverse() @ target
        exact, move = seen_in(T_camera_object, goal), velocity(run, k)
        if run.get("feedforward"):
            relative = [*(-camera.rotation.T @ move), 0.0, 0.0, 0.0]
            estimator.motion = sets.matrix(exact) @ relative
        command = controller.command(wrong_depth(exact, run), posture_of(np.zeros(6)), run["dt"])
        if k in stored:
            where, i = f"{run['name']}, {run['scheme']} {run['L']}, step {k}", stored[k]
            pose = np.column_stack([T_camera_object.rotation, T_camera_object.translation])
            near(pose.ravel(), run["cMo"][i], factor, f"{where}: cMo")
            near(command.trace.error, run["e"][i], factor, f"{where}: e")
            near(command.twist, run["v"][i], factor, f"{where}: v")
        camera = camera @ exp_se3(command.twist * run["dt"])
        target = Pose(target.rotation, target.translation + move * run["dt"])


class Ideal:
    """An estimator that knows the target's own motion."""

    def start(self, features):
        pass

    def update(self, error, own, dt):
        return Prediction.unmeasured(error, self.motion)


def velocity(run, k):
    """Of the target in the world over a step (3,) [m/s]."""
    v = np.array(run.get("target_velocity", (0.0, 0.0, 0.0)))
    return -v if run.get("reversal_step") and k >= run["reversal_step"] else v


def wrong_depth(sight, run):
    """The sight with depths that are wrong by the run's factor."""
    plane = Plane(*(sight.plane.vector / run["depth_factor"]).tolist())
    return sight if run["depth_factor"] == 1.0 else replace(sight, plane=plane)
