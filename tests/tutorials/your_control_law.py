# %% [markdown]
# # Your control law
#
# A law is a `Config` (its settings) whose `build` gives an object with `start`, `aim` and
# `command`. Here: proportional and integral, v = -L# (kp e + ki sum(e dt)). The integral takes away
# the lag behind a target at constant speed, for which our law needs an estimator of the target's
# motion. The classes: [`servo/parts.py`](../../servo/parts.py); another law as a package:
# [a law that switches](../../servo/README.md#example-a-law-that-switches).
#
# %%
import os
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import servo
from servo.testing import check_controller

DOF = [0, 1, 2, 5]  # vx, vy, vz, wz: a camera that looks straight down stays level
OUT = Path(os.environ.get("SERVOBENCH_TUTORIALS", "."))


# %%
@dataclass(frozen=True)
class Config:
    kp: float = 2.0  # [1/s]
    ki: float = 2.0  # [1/s^2]
    fastest: float = 0.5  # of any part of the twist [m/s, rad/s]

    def build(self, rng):
        return ProportionalIntegral(self)


class ProportionalIntegral:
    def __init__(self, config: Config) -> None:
        self.config = config

    def start(self, task: servo.Task) -> None:
        self.features, self.goal = task.features, task.goal
        self.sum = np.zeros(len(task.features.names))

    def aim(self, goal: servo.Sight) -> None:
        self.goal = goal

    def command(self, seen: servo.Sight | None, posture: servo.Posture, dt: float) -> servo.Command:
        if seen is None:
            return servo.Command(np.zeros(6))
        features, config = self.features, self.config
        error = features.error(features.values(seen), features.values(self.goal))
        error = np.where(features.known(seen), error, 0.0)
        new = self.sum + error * dt
        inverse = np.linalg.pinv(features.matrix(seen)[:, DOF])
        twist = np.zeros(6)
        twist[DOF] = -inverse @ (config.kp * error + config.ki * new)
        limited = np.clip(twist, -config.fastest, config.fastest)
        saturated = bool((limited != twist).any())
        if not saturated:  # else the sum would grow while the camera cannot follow
            self.sum = new
        return servo.Command(limited, saturated=saturated)


check_controller(Config)

# %% [markdown]
# The car drives on at 0.1 m/s: proportional alone lags by f v / (Z kp) = 14.5 px. Then it goes to
# and fro: an integral is late at each turn.
#
# %%
LAWS = {
    "proportional": {"controller": Config(ki=0.0)},
    "proportional, integral": {"controller": Config()},
    "ibvs with kalman_cv (default)": {},
}
figure, rows = plt.subplots(2, 1, figsize=(7, 5), layout="constrained")
rms: dict[tuple[str, str], float] = {}
for axes, (name, seconds) in zip(rows, {"line": 5, "sine": 6}.items(), strict=True):
    for law, part in LAWS.items():
        scenario = servo.load(name, [f"run.duration={seconds}"], **part)
        steps = [(step.frame.time, step.servo_error) for step in servo.run(scenario)]
        times, errors = np.array(steps).T
        rms[name, law] = float(np.sqrt(np.mean(errors[times > 3.0] ** 2)))
        axes.plot(times, errors, label=f"{law}: {rms[name, law]:.2f} px rms after 3 s")
    axes.set(title=name, ylabel="true error [px]", ylim=(0, 50))
    axes.legend(loc="upper right")
rows[-1].set(xlabel="time [s]")
figure.savefig(OUT / "your_control_law.png", dpi=120)
for (name, law), value in rms.items():
    print(f"{name}, {law}: {value:.2f} px")
