"""Example of a custom control law, which is a function: v = -gain L# e, limited in speed."""

import numpy as np

import servo


def slow_law(seen, task, gain=2.0, fastest=0.2):
    """Return the camera twist (6,) in the camera frame [m/s, rad/s] of the law v = -gain L# e,
    shortened to a linear speed of at most `fastest`.

    Args:
        seen: The target as it is seen, with the desired view as `goal`.
        task: The run's task; its features give the error e and the interaction matrix L.
        gain: Gain [1/s].
        fastest: Largest linear speed of the camera [m/s].
    """
    features = task.features
    error = features.error(features.values(seen), features.values(seen.goal))
    twist = -gain * np.linalg.pinv(features.matrix(seen)) @ error
    return twist * min(1.0, fastest / max(np.linalg.norm(twist[:3]), 1e-9))


ours = servo.simulate("turn_90_points", controller=slow_law, duration=6.0)
theirs = servo.simulate("turn_90_points", duration=6.0)
for name, result in (("slow_law", ours), ("ibvs", theirs)):
    print(f"{name}: {result.outcome.name}, path {result.record.measures['camera_path_m']:.3f} m")
