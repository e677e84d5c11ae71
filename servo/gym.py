"""A run as an environment of Gymnasium: `gymnasium.make("servo.gym:servobench/Line-v0")`.

Each shipped scenario has an id, such as `servobench/Arm7Line-v0` for arm7_line;
`servobench/Servo-v0` takes any scenario.

| choice | meaning |
|---|---|
| observation | "features" (errors, rates, twist, last action, seen), "picture", or "both" |
| action | "twist" of the camera in place of the control law's, or a "residual" added to it |
| reward | 1 / (1 + d / 10 px), d the mean distance of the target's true corners from their goals |
| info["reward_terms"] | what d is the mean of: the four distances, `corner_1_px` to `corner_4_px` |
| terminated | the tracker has lost the target, or the target's true centre is out of the picture |
| truncated | the scenario's duration is over, and the run is not terminated |

Why this reward: d is one number in px for centre, angle, size and tilt, so that no weights are
needed; 10 px is also the limit of the measure not_held_pct, and the slope is largest at the goal.
It is never negative, so that losing the target never pays.

The seed given to `reset` is the scenario's: the scenario is that of `servobench run NAME --seed
SEED`, with all settings that `[vary]` draws for this seed. Without a seed, one is drawn. If the
start that a seed gives is impossible, further seeds are drawn; info["seed"] is that of the run.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servo import Episode, Mistake, Scenario, Step, load
from servo.loop.episode import ImpossibleStart, Kept
from servo.loop.run_measures import CONVERGED_PX
from servo.output.annotated import View, annotated
from servo.output.local_page import has_display
from servo.parts import ChoosesMoves
from servo.scenario.arguments import each_once, numbers, one_of, texts, whole
from servo.scenario.catalogue import shipped
from servo.scenario.keywords import own_parts
from servo.scenario.load import parse
from servo.scenario.toml import with_settings
from servo.types import DOF
from sim.channels import Channel, needs_of
from sim.types import Array, Image, Pose
from tracking.types import Status

try:
    import gymnasium
    from gymnasium import spaces
except ModuleNotFoundError as error:
    sentence = "servo.gym needs the extra 'gym': pip install 'servobench[gym]'"
    raise ModuleNotFoundError(sentence, name=error.name) from None

Observation = NDArray[np.generic] | dict[str, NDArray[np.generic]]
"""Features (n,), a picture (H, W, 3), or both by name."""
ID = "servobench/Servo-v0"
OBSERVATIONS = ("features", "picture", "both")
ACTIONS = ("twist", "residual")
LARGEST_FEATURE = 10.0
"""Largest absolute value in the observation "features": errors are of the order of 1, and larger
values would disturb a network."""
REDRAW = 20
"""Default number of further seeds for an impossible start: on "line" 1 of 60 starts is impossible,
so that this many never all fail."""
LAST_SEED = 2**31
"""Upper bound of drawn seeds."""
SEED = "a seed cannot be set here: give it as reset(seed=...)"
LEVEL_DOF = [0, 1, 2, 5]
"""Components of the twist in an action for a law whose settings do not choose any: vx, vy, vz, wz.
"""


class ServoEnv(gymnasium.Env[Any, Any]):
    """Gymnasium environment of a scenario. An action, -1 to 1, is a camera twist or is added to the
    twist of the scenario's control law; the reward, 0 to 1, is 1 while the target is exactly at its
    goal in the picture.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array", "human"], "render_fps": 30}  # noqa: RUF012

    def __init__(
        self,
        scenario: str = "reversal",
        overrides: Sequence[str] = (),
        observation: str = "features",
        action: str = "residual",
        reach: tuple[float, float] = (0.2, 0.5),
        dof: Sequence[str] | None = None,
        render_mode: str | None = None,
        goal_picture: bool = False,
        redraw: int = REDRAW,
        **settings: Any,
    ) -> None:
        """Load the scenario; nothing is rendered before `reset`.

        Args:
            scenario: Name of a shipped scenario, or a file.
            overrides: Changes of settings, such as "estimator.kind=none".
            observation: "features" (numbers), "picture" (RGB) or "both".
            action: "twist" (the camera's whole twist) or "residual" (added to the law's twist).
            reach: Speed [m/s] and angular speed [rad/s] of an action of 1.
            dof: Components of the twist in an action; by default those that the law's settings let
                move, all six for a policy, and vx, vy, vz, wz for another law without such a
                setting.
            render_mode: "rgb_array", "human" (a window) or None.
            goal_picture: Whether `reset` returns the camera's picture at the goal, as
                info["goal_picture"]. It is taken first, which changes the sensor noise of the run.
            redraw: How often `reset` draws another seed if the start is impossible, such as out of
                an arm's reach; 0: never. Each draw takes seconds.
            **settings: Settings by their last name, such as gain=1.0 or vary={}, as for
                `servo.load`.

        Raises:
            Mistake: The scenario, a setting or a choice does not exist, a value is not allowed, a
                setting changes the seed, or there is no display for "human".
        """
        one_of(observation, "observation", OBSERVATIONS)
        one_of(action, "action", ACTIONS)
        one_of(goal_picture, "goal_picture", (False, True))
        one_of(render_mode, "render_mode", (None, *self.metadata["render_modes"]))
        if render_mode == "human" and not has_display():
            raise Mistake("render_mode='human': there is no display here; use 'rgb_array'")
        self.render_mode = render_mode
        self._observation = observation
        self._goal_picture = goal_picture
        self._redraw = whole(redraw, "redraw", 0)
        self._residual = action == "residual"
        self._given = scenario, texts(overrides), settings
        self._base = load(*self._given[:2], **settings)
        if self._base.run.seed != load(scenario).run.seed:
            raise Mistake(f"{scenario}: {SEED}")
        self._frames = self._base.frames
        outline = self._base.target.build(np.random.default_rng(0)).outline
        self._features = len(self._base.features.build(outline).names)
        self._moves = self._law_moves() if dof is None else each_once(dof, "dof", DOF)
        self._reach = np.repeat(numbers(reach, "reach", 2), 3)[self._moves]
        if self._reach.min() < 0:
            raise Mistake(f"reach: expected speeds of at least 0, got {reach!r}")
        modes = [m for m in self.metadata["render_modes"] if m != "human" or has_display()]
        self.metadata = {"render_modes": modes, "render_fps": round(self._base.camera.rate)}
        self._error = np.zeros(self._features)
        self.action_space = spaces.Box(-1.0, 1.0, (len(self._moves),), np.float32)
        self._episode: Episode | None = None
        self._kept: Kept = {}
        self._window: View | None = None
        self.observation_space = self._space()

    def _law_moves(self) -> list[int]:
        law = self._base.controller
        if Channel.PICTURE in needs_of(law):
            return list(range(len(DOF)))
        if not isinstance(law, ChoosesMoves):
            return LEVEL_DOF
        return np.flatnonzero(law.moves(six=self._features >= len(DOF))).tolist()

    def _space(self) -> spaces.Space[Any]:
        camera = self._base.camera
        length = 2 * self._features + len(DOF) + len(self._moves) + 1
        own = spaces.Box(-LARGEST_FEATURE, LARGEST_FEATURE, (length,), np.float32)
        picture = spaces.Box(0, 255, (camera.height, camera.width, 3), np.uint8)
        both = spaces.Dict({"features": own, "picture": picture})
        return {"features": own, "picture": picture, "both": both}[self._observation]

    def reset(
        self, *, seed: int | None = None, options: dict[str, object] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """End the last run, begin a new one, and return its first observation. If the start is
        impossible (such as out of an arm's reach) and the scenario depends on the seed, up to
        `redraw` further seeds are tried.

        Args:
            seed: Seed of the scenario, 0 for the scenario as it is written; None: a drawn one. It
                also seeds the draws of further seeds.
            options: Settings for this run only, as for `servo.load`, with `overrides` (added to
                those of the environment) and `scenario`.

        Returns:
            The first observation, and the info: that of `step`, the seed of the run ("seed"), the
            settings drawn for it ("drawn"), the number of further seeds that were tried
            ("redrawn"), and "goal_picture" if the environment was made with it.

        Raises:
            Mistake: A setting is wrong, sets the seed, or would change the shape of the
                observations.
            ImpossibleStart: The start is impossible, also for `redraw` further seeds; these are not
                tried if the scenario does not depend on the seed.
        """
        super().reset(seed=seed)
        drawn = self._seed() if seed is None else seed
        redrawn = 0
        while True:
            scenario = self._scenario(drawn, options or {})
            if scenario.run.seed != drawn:
                raise Mistake(f"options: {SEED}")
            try:
                episode = Episode(
                    scenario,
                    steered=True,
                    seen=self._observation != "features" or self.render_mode is not None,
                    shows_goal=self._goal_picture,
                    kept=self._kept,
                )
                break
            except ImpossibleStart as error:
                if not scenario.drawn:
                    raise
                if redrawn == self._redraw:
                    raise ImpossibleStart(
                        f"{error} (redraw = {redrawn}: {redrawn} other seeds were tried too, and "
                        "none has a possible start; a larger redraw tries more)"
                    ) from error
            redrawn += 1
            drawn = self._seed()
        self._end()  # only now: a run goes on where what shall follow it is refused
        self._episode = episode
        self._frames = episode.frames
        self.metadata["render_fps"] = round(scenario.camera.rate)
        self._error = np.zeros(self._features)
        self._action = np.zeros(len(self._moves))
        step = self._look()
        seen = self._observed(step)
        if seen not in self.observation_space:
            self._end()
            raise Mistake(
                "options: these settings change the shape of the observations; make a new "
                "environment with them (the old run was ended)"
            )
        info = self._info(step) | {"seed": drawn, "drawn": scenario.drawn, "redrawn": redrawn}
        if self._goal_picture:
            info["goal_picture"] = self._episode.goal_picture
        return seen, info

    def _seed(self) -> int:
        """Return a seed drawn from this environment's own generator."""
        return int(self.np_random.integers(1, LAST_SEED))

    def _scenario(self, seed: int, options: Mapping[str, object]) -> Scenario:
        """Return the scenario for a seed, with the settings of `options`."""
        name, overrides, settings = self._given
        if options:
            given: dict[str, Any] = {"scenario": name, "overrides": ()} | settings | {**options}
            overrides = *overrides, *texts(given.pop("overrides"))
            name = given.pop("scenario")
            seed = given.pop("seed", seed)
            return load(name, overrides, seed, **given)
        base = self._base
        table = with_settings(base.table, {"run.seed": seed}, name)
        return parse(table, base.name, name, own=own_parts(settings))

    def step(self, action: Array) -> tuple[Observation, float, bool, bool, dict[str, object]]:
        """Move the camera until the next picture, by the action or, with action="residual", by the
        control law's twist plus the action, and return the observation of that picture. A run that
        is terminated or truncated is closed.

        Args:
            action: The components (n,) of the camera's twist that `dof` names, each divided by the
                speed that `reach` gives; values are clipped to -1..1.

        Returns:
            Observation; reward 1 / (1 + d / 10 px), where d is the mean distance [px] of the
            target's true corners from their goals; terminated, True if the tracker has lost the
            target or its true centre is out of the picture; truncated, True if the scenario's
            duration is over and the run is not terminated; and info, with the time [s], d as
            "distance_px", "is_success" (True if d is at most 10 px), the four distances
            ("reward_terms"), the distances of the target's true centre from its goal and from the
            tracker's estimate ("servo_error_px", "tracking_error_px"), the tracker's status, the
            twist (6,) that the control law commands from this picture, before an action is added
            ("twist", in the camera frame [m/s, rad/s]), the joint positions [m or rad], the
            camera's pose and its goal relative to the target, as matrices (4, 4) [m], and, if the
            camera measures it, the depth picture (H, W) [m].

        Raises:
            Mistake: No run has begun, it is over, or the action is not n finite numbers.
        """
        if self._episode is None:
            raise Mistake("step: there is no run; call reset first")
        clipped = numbers(action, "step", len(self._moves)).clip(-1.0, 1.0)
        twist = np.array(self._now.command.twist) if self._residual else np.zeros(6)
        twist[self._moves] += self._reach * clipped
        self._action = clipped
        self._episode.advance(twist)
        step = self._look()
        lost = self._is_lost(step)
        over = step.frame.index >= self._episode.frames - 1
        info = self._info(step)
        reward = 1.0 / (1.0 + info["distance_px"] / CONVERGED_PX)
        seen = self._observed(step)
        if lost or over:
            self._end()
        return seen, reward, lost, over and not lost, info

    @property
    def frames(self) -> int:
        """Number of pictures of the run that `reset` began last, or, before the first `reset`, of
        the scenario as it was loaded. A complete run has one step less than pictures.
        """
        return self._frames

    def _look(self) -> Step:
        assert self._episode is not None
        self._now = self._episode.look()
        if self.render_mode == "human":
            self._window = self._window or View(ID)
            self._window.show(annotated(self._now))
        return self._now

    def _is_lost(self, step: Step) -> bool:
        height, width = step.frame.image.shape[:2]
        u, v = step.truth.centre.tolist()
        inside = 0 <= u <= width and 0 <= v <= height and step.truth.depth > 0
        return step.estimate.status is Status.LOST or not inside

    def _info(self, step: Step) -> dict[str, Any]:
        assert self._episode is not None
        distances = step.corner_errors
        distance = float(distances.mean())
        depth = {} if step.frame.depth is None else {"depth": step.frame.depth}
        return depth | {
            "time_s": step.frame.time,
            "distance_px": distance,
            "is_success": distance <= CONVERGED_PX,
            "reward_terms": {
                f"corner_{i}_px": each for i, each in enumerate(distances.tolist(), 1)
            },
            "servo_error_px": step.servo_error,
            "tracking_error_px": step.tracking_error,
            "status": step.estimate.status.name,
            "twist": self._episode.law_twist.copy(),
            "joints": step.joints,
            "T_object_camera": _matrix(step.T_object_camera),
            "T_object_goal": _matrix(step.T_object_goal),
        }

    def _observed(self, step: Step) -> Observation:
        """Return the observation. Its features, in this order: k feature errors and k rates that
        the target's own motion causes (estimated), over `FeatureSet.scales`; the camera's measured
        twist (6); the last action; and 1 if the target is seen, else 0. Unknown numbers are 0, and
        all are clipped to -10..10.
        """
        picture = step.frame.image
        if self._observation == "picture":
            return picture
        trace = step.command.trace
        scales = 1.0 if trace is None else trace.scales
        parts = (
            self._errors(step),
            step.prediction.motion / scales,
            step.twist_measured,
            self._action,
            [step.seen],
        )
        numbers = np.concatenate(parts)
        numbers[np.isnan(numbers)] = 0.0
        own = numbers.clip(-LARGEST_FEATURE, LARGEST_FEATURE).astype(np.float32)
        return own if self._observation == "features" else {"features": own, "picture": picture}

    def _errors(self, step: Step) -> Array:
        """Return the last measured feature errors (k,) over `FeatureSet.scales`, also if the
        control law does not use features, as a policy does not.
        """
        trace = step.command.trace
        if trace is not None:
            return trace.error / trace.scales
        assert self._episode is not None
        sight = self._episode.sight
        if sight is not None:
            features = step.scene.features
            goal = features.values(step.goal_sight)
            self._error = features.error(features.values(sight), goal) / features.scales(goal)
        return self._error

    def render(self) -> Image | None:
        """Return the current picture, RGB, uint8 (h, w, 3), enlarged to about 640 px wide, with a
        line of text and the outlines of the target: true (white), at the goal (red) and tracked
        (its colour shows the tracker's status). Return None unless the render mode is "rgb_array".
        """
        return annotated(self._now) if self.render_mode == "rgb_array" else None

    def _end(self) -> None:
        if self._episode is not None:
            self._episode.close()
        self._episode = None

    def close(self) -> None:
        """End the run, if there is one, and close its renderer and the window of render mode
        "human".
        """
        self._end()
        if self._window is not None:
            self._window.close()
            self._window = None


def _matrix(pose: Pose) -> Array:
    """Return a pose as a homogeneous matrix (4, 4), translation in m."""
    matrix = np.eye(4)
    matrix[:3, :3] = pose.rotation
    matrix[:3, 3] = pose.translation
    return matrix


def environment_id(scenario: str) -> str:
    """Return the Gymnasium id of the environment of a shipped scenario, given the scenario's name.

    >>> environment_id("arm7_line")
    'servobench/Arm7Line-v0'
    """
    return f"servobench/{scenario.title().replace('_', '')}-v0"


def _register() -> None:
    if ID in gymnasium.registry:
        return
    settings: dict[str, dict[str, str]] = {environment_id(n): {"scenario": n} for n in shipped()}
    for name, given in {ID: {}, **settings}.items():
        gymnasium.register(
            name,
            "servo.gym:ServoEnv",
            kwargs=given,
            vector_entry_point="servo.gym_vector:ServoVectorEnv",
        )


_register()
