"""Example that compares the lag [px] of a proportional law behind a target at constant speed v with
theory: f v / (Z gain), with the focal length f [px] and the target's depth Z [m].
"""

from matplotlib import pyplot as plt

import servo

SPEED = 0.08  # [m/s]
gains = [1.0, 2.0, 4.0]
measured, theory = [], []
for gain in gains:
    motion = {"kind": "line", "x": -0.3, "speed": SPEED}
    ideal = {"tracker": "truth", "estimator": "none", "motion": motion}
    scenario = servo.load("line", gain=gain, duration=4.0, **ideal)
    *_, last = servo.run(scenario)
    measured.append(last.servo_error)
    theory.append(last.scene.camera.focal * SPEED / (scenario.goal.depth * gain))
    print(f"gain {gain:.0f}: {measured[-1]:.1f} px, in theory {theory[-1]:.1f} px")
figure, axes = plt.subplots()
axes.plot(gains, theory, label="theory")
axes.plot(gains, measured, "o", label="measured")
axes.set(xlabel="gain [1/s]", ylabel="error [px]")
axes.legend()
figure.savefig("lag.png")
