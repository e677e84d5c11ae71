"""Example of the effect of delay and gain: print a table of the distance [px] of the target from
its goal after three seconds, by latency [frame intervals] and gain [1/s].
"""

import servo

GAINS = 2.0, 6.0, 12.0
print("latency  " + "  ".join(f"gain {gain:4.0f}" for gain in GAINS))
for latency in (1, 3, 6):
    row = []
    for gain in GAINS:
        scenario = servo.load(
            "still", gain=gain, latency=latency, tracker="truth", estimator="none", duration=3.0
        )
        *_, last = servo.run(scenario)
        row.append(f"{last.servo_error:6.1f} px")
    print(f"{latency:7}  " + "  ".join(row))
