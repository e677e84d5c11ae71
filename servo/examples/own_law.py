"""A custom control law is a function: v = -gain L# e, limited in speed."""

import numpy as np

import servo


def slow_law(seen, task, gain=2.0, fastest=0.2):
    """Return the camera twist (6,) in the camera frame [m/s, rad/s] for the target as it is seen,
    with a linear speed of at most `fastest` [m/s].
    """
    features = task.features
    error = features.error(features.values(seen), features.values(seen.goal))
    twist = -gain * np.linalg.pinv(features.matrix(seen)) @ error
    return twist * min(1.0, fastest / max(np.linalg.norm(twist[:3]), 1e-9))


ours = servo.simulate("turn_90_points", controller=slow_law, duration=6.0)
theirs = servo.simulate("turn_90_points", duration=6.0)
for name, result in (("slow_law", ours), ("ibvs", theirs)):
    print(f"{name}: {result.outcome.name}, path {result.record.measures['camera_path_m']:.3f} m")
