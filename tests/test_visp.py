"""The closed loops of ViSP 3.5, step by step: kinematic camera, exact SE(3) steps, no noise, no
delay.
"""

import numpy as np
import pytest
from servoing import parallel, plane_of, posture_of, task

from servo.controllers.ibvs import Config
from servo.estimators import difference, kalman_ca, kalman_cv, none
from servo.sight import shape_moments
from servo.types import DOF, Sight
from sim.geometry import exp_se3
from sim.types import Pose

RECTANGLE = np.array([[-0.1, -0.05, 0], [0.1, -0.05, 0], [0.1, 0.05, 0], [-0.1, 0.05, 0]])


def goal():
    return Sight(shape_moments.of_polygon(RECTANGLE[:, :2]), parallel(1.0))


def estimator_of(run):
    rng = np.random.default_rng()
    if run["comp"] in ("none", "raw"):
        return {"none": none, "raw": difference}[run["comp"]].Config().build(rng)
    kf = run["kf"]
    constants = {
        "rho": kf["rho"],
        "ratio": kf["sigma_state"] / kf["sigma_measure"],
        "noise": "difference",
    }
    if run["comp"] == "kf_ca":
        ratio = kf["sigma_state2"] / kf["sigma_measure"]
        constants["acceleration_ratio"] = ratio / run["hz"] ** 2
        return kalman_ca.Config(**constants).build(rng)
    return kalman_cv.Config(**constants).build(rng)


@pytest.mark.reference
def test_closed_loop(visp_run):
    run = visp_run
    dof = DOF if run["dof"] == 6 else ("vx", "vy", "vz", "wz")
    config = Config(
        gain=run["lambda"],
        dof=dof,
        feed_forward=("xn", "yn", "an", "theta"),
        matrix=run["L"],
        interval="end",
        fastest=1e9,
        fastest_turn=1e9,
    )
    controller = config.build(np.random.default_rng())
    controller.start(task(goal(), estimator_of(run)))
    twist, dt = np.zeros(6), 1 / run["hz"]
    first = np.array(run["wMc_3x4"][0]).reshape(3, 4)
    camera = Pose(first[:, :3], first[:, 3])
    for k, (_, x, y, theta) in enumerate(run["t_target_xyth"]):
        expected = np.array(run["wMc_3x4"][k]).reshape(3, 4)
        np.testing.assert_allclose(camera.rotation, expected[:, :3], rtol=0, atol=1e-8)
        np.testing.assert_allclose(camera.translation, expected[:, 3], rtol=0, atol=1e-8)
        T_camera_target = camera.inverse() @ Pose.planar(x, y, theta)
        points = T_camera_target.apply(RECTANGLE)
        m = shape_moments.of_polygon(points[:, :2] / points[:, 2:])
        seen = Sight(m, plane_of(T_camera_target, 0.0))
        command = controller.command(seen, posture_of(twist), dt)
        where = f"step {k} of {run['scenario']}, {run['comp']}"
        trace = command.trace
        np.testing.assert_allclose(trace.error, run["e"][k], rtol=0, atol=1e-8, err_msg=where)
        np.testing.assert_allclose(command.twist, run["v"][k], rtol=0, atol=1e-8, err_msg=where)
        np.testing.assert_allclose(trace.prediction.motion, run["dedt_hat"][k], rtol=0, atol=1e-8)
        twist = command.twist
        camera = camera @ exp_se3(twist * dt)
