"""Several environments of one scenario in one process, as a vector environment of Gymnasium.

    envs = gymnasium.make_vec(
        "servo.gym:servobench/Line-v0", num_envs=64, vectorization_mode="vector_entry_point"
    )

Each environment gives the numbers that it would give alone with its seed. They share the scenario,
the robot and the target, which are loaded once.
"""

from collections.abc import Mapping, Sequence
from copy import copy
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space, concatenate, create_empty_array
from numpy.typing import NDArray

from servo.gym import Observation, ServoEnv
from servo.mistake import Mistake
from servo.scenario.arguments import whole
from sim.types import Array, Image


class ServoVectorEnv(VectorEnv[Any, Any, Any]):
    """Vector environment of a scenario, whose n environments run one after the other. Where a run
    is over, the next step ignores the action of this environment, begins a new run with a drawn
    seed and without the options of the last `reset`, and has the reward 0 (Gymnasium's
    AutoresetMode.NEXT_STEP).
    """

    def __init__(self, num_envs: int = 1, **settings: Any) -> None:
        """Load the scenario; nothing is rendered before `reset`.

        Args:
            num_envs: Number n of environments.
            **settings: Arguments of `ServoEnv`, the same for all.

        Raises:
            Mistake: `num_envs` is no whole number above 0, `render_mode` is "human", or `ServoEnv`
                refuses an argument.
        """
        self.num_envs = whole(num_envs, "num_envs", 1)
        first = ServoEnv(**settings)
        if first.render_mode == "human":
            raise Mistake("render_mode='human': n environments have no window; use 'rgb_array'")
        self.render_mode = first.render_mode
        self.metadata = first.metadata | {"autoreset_mode": AutoresetMode.NEXT_STEP}
        self.envs = first, *(copy(first) for _ in range(num_envs - 1))
        """The single environments."""
        self.single_observation_space = first.observation_space
        self.single_action_space = first.action_space
        self.observation_space = batch_space(first.observation_space, num_envs)
        self.action_space = batch_space(first.action_space, num_envs)
        self._over = np.zeros(num_envs, bool)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, object] | None = None,
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin a new run in each of the n environments, and return their first observations and
        infos.

        Args:
            seed: A seed for each environment; or one number s, for the seeds s, s + 1, ...; None:
                drawn seeds.
            options: Settings for these runs only, as for `ServoEnv.reset`.

        Returns:
            The observations, stacked (n, ...); and the infos: an array (n, ...) for each key, and
            as "_key" a mask (n,) of the environments that have it.

        Raises:
            Mistake: The number of seeds is not n, or `ServoEnv.reset` refuses an argument.
        """
        if seed is None or isinstance(seed, int):
            seeds = [None if seed is None else seed + i for i in range(self.num_envs)]
        else:
            seeds = [*seed]
        self._check_count("seed", len(seeds))
        pairs = zip(self.envs, seeds, strict=True)
        started = [env.reset(seed=each, options=options) for env, each in pairs]
        self._over[:] = False
        return self._batch([seen for seen, _ in started]), self._infos([i for _, i in started])

    def step(
        self, actions: Array
    ) -> tuple[Observation, Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Make a step in each of the n environments; where the run is over, begin a new one
        instead, with the reward 0.

        Args:
            actions: Actions (n, k), one row of k twist components for each environment, as for
                `ServoEnv.step`.

        Returns:
            Observations, stacked (n, ...); rewards (n,); terminated (n,); truncated (n,); and the
            infos: an array (n, ...) for each key, and as "_key" a mask (n,) of the environments
            that have it.

        Raises:
            Mistake: The number of actions is not n, or `ServoEnv.step` refuses one.
        """
        self._check_count("step", len(actions))
        rewards = np.zeros(self.num_envs)
        terminated = np.zeros(self.num_envs, bool)
        truncated = np.zeros(self.num_envs, bool)
        seen: list[Observation] = []
        infos: list[Mapping[str, object]] = []
        for i, (env, action) in enumerate(zip(self.envs, actions, strict=True)):
            if self._over[i]:
                observation, info = env.reset()
            else:
                observation, rewards[i], terminated[i], truncated[i], info = env.step(action)
            seen.append(observation)
            infos.append(info)
        self._over = terminated | truncated
        return self._batch(seen), rewards, terminated, truncated, self._infos(infos)

    def render(self) -> tuple[Image, ...] | None:
        """Return the current pictures of all environments, each as `ServoEnv.render` returns it:
        RGB (h, w, 3) with the outlines of the target. Return None unless the render mode is
        "rgb_array".
        """
        pictures = [env.render() for env in self.envs]
        return tuple(each for each in pictures if each is not None) or None

    def close_extras(self, **_: object) -> None:
        """End the runs of all environments, and close their renderers; Gymnasium's `close` calls
        it.
        """
        for env in self.envs:
            env.close()

    def _check_count(self, what: str, count: int) -> None:
        if count != self.num_envs:
            raise Mistake(
                f"{what}: expected one for each of the {self.num_envs} environments, got {count}"
            )

    def _batch(self, seen: Sequence[Observation]) -> Any:
        """Return the observations of all environments as one, in new arrays."""
        space = self.single_observation_space
        return concatenate(space, seen, create_empty_array(space, self.num_envs))

    def _infos(self, infos: Sequence[Mapping[str, object]]) -> dict[str, Any]:
        """Return the infos of all environments as Gymnasium does: an array (n, ...) for each key,
        and as "_key" a mask (n,) of the environments that have it.
        """
        found: dict[str, Any] = {}
        for i, info in enumerate(infos):
            self._add_info(found, {**info}, i)
        return found
