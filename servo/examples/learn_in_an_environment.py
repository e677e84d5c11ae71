"""Example of learning in the Gymnasium environment: a random search for the gain k of the action -k
times the feature errors, which the environment adds to the control law's camera twist.
"""

import gymnasium
import numpy as np

ID = "servo.gym:servobench/Line-v0"
env = gymnasium.make(ID, overrides=["run.duration=1.5", "estimator.kind=none"], tracker="truth")


def reward_of(gain):
    """Return the sum of the rewards of one episode, with seed 0, in which each action is -gain
    times the feature errors of the last observation.
    """
    observation, _ = env.reset(seed=0)
    total, over = 0.0, False
    while not over:
        errors = observation[: env.action_space.shape[0]]
        observation, reward, terminated, truncated, _ = env.step(-gain * errors)
        total += float(reward)
        over = terminated or truncated
    return total


rng = np.random.default_rng(0)
best, best_reward = 0.0, reward_of(0.0)
print(f"law alone: {best_reward:.2f}")
for _ in range(6):
    gain = best + rng.normal(0.0, 2.0)
    if (found := reward_of(gain)) > best_reward:
        best, best_reward = gain, found
print(f"with a residual of {best:.2f} times the errors: {best_reward:.2f}")
env.close()
