"""Learn a residual on the law without an estimator: a linear policy, by the cross-entropy method.

    python tests/tutorials/train_servo.py

The law with `estimator.kind=none` lags behind the car. The policy adds to each part of the twist a
share of its feature's error and a share of the camera's own speed: four numbers, one pair for x and
y, one for depth and angle. They begin at zero, where nothing is added.
"""

import gymnasium
import numpy as np

import servo.gym

MOVES = [0, 1, 2, 5]
"""Of the measured twist, those parts that an action has."""
REACH = np.array([0.2, 0.2, 0.2, 0.5])
LEARNED = np.array([0.485, 0.842, -0.096, -0.050])
"""What this script found (seed 0)."""


def environment(duration):
    """The law without an estimator, on the scenario reversal."""
    return gymnasium.make(
        servo.gym.ID,
        scenario="reversal",
        overrides=["estimator.kind=none", f"run.duration={duration}"],
    )


def act(weights, seen):
    """The action (4,) for what is seen: errors (4), the target's motion (4), twist (6), ..."""
    error, twist = seen[:4], seen[8:14][MOVES]
    of_error, of_twist = weights[[0, 0, 2, 2]], weights[[1, 1, 3, 3]]
    return np.clip((of_error * error + of_twist * twist) / REACH, -1, 1).astype(np.float32)


def play(env, weights, seed):
    """Mean reward of a run that is not lost, and its servo errors from 2 s on [px]."""
    seen, _ = env.reset(seed=seed)
    rewards, errors, over = [], [], False
    while not over:
        seen, reward, lost, ended, told = env.step(act(weights, seen))
        rewards.append(0.0 if lost else reward)
        errors += [told["servo_error_px"]] * (told["time_s"] >= 2.0)
        over = lost or ended
    return sum(rewards) / (env.unwrapped.frames - 1), np.array(errors)


def train(env, rounds=6, tries=10, best=3, seed=0):
    """The mean of the best tries, round by round."""
    rng, mean, spread = np.random.default_rng(seed), np.zeros(4), np.full(4, 0.5)
    for number in range(rounds):
        drawn = mean + spread * rng.standard_normal((tries, 4))
        scores = np.array([play(env, weights, seed=1 + number)[0] for weights in drawn])
        chosen = drawn[np.argsort(-scores)[:best]]
        mean, spread = chosen.mean(axis=0), chosen.std(axis=0) + 0.05
        print(number, np.round(mean, 3).tolist(), f"best {scores.max():.3f}", flush=True)
    return mean


def compare(weights, seeds):
    """Root mean square error [px] without and with the residual, over whole runs of other seeds."""
    env = environment(14.0)
    for name, used in (("none", np.zeros(4)), ("learned", weights)):
        runs = [np.sqrt(np.mean(play(env, used, seed)[1] ** 2)) for seed in seeds]
        print(name, np.round(runs, 2).tolist(), flush=True)


if __name__ == "__main__":
    learned = train(environment(5.0))
    print(learned.tolist(), flush=True)
    compare(learned, range(100, 105))
