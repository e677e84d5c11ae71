"""Example of a study as a loop in Python: three trackers, each with two seeds of one scenario."""

import servo

for tracker in ("kams", "pf_ssd", "cv_mean_shift"):
    errors = []
    for seed in range(2):
        scenario = servo.load("clutter", tracker=tracker, seed=seed, duration=2.0)
        last = max(servo.run(scenario), key=lambda step: step.frame.index)
        errors.append(f"{last.servo_error:.1f} px")
    print(f"{tracker}: {' and '.join(errors)} from the goal in the end")
