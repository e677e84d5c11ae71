"""The simulated world of a run: it renders pictures, moves robot and target, and gives their exact
poses (the truth).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from typing import Annotated

import mujoco
import numpy as np
from annotated_types import Ge, Le

from sim import placement
from sim.camera.camera import CameraConfig, camera_of
from sim.camera.choice import renderer_of
from sim.camera.depth_sensor import DepthSensor
from sim.camera.lens import Lens, Sensor
from sim.camera.renderer import MakeRenderer, Promise, Supersampled, camera_pose
from sim.geometry import log_se3
from sim.kinematics.inverse_kinematics import Reach, reach
from sim.kinematics.robot import Design, Robot
from sim.leader import LeaderConfig
from sim.miscalibration import RIGHT, BelievedConfig, as_believed
from sim.models.assembly import TARGET, build_model
from sim.models.target import Target
from sim.mounting import CAMERA, mounting_of
from sim.stage import Disturbance, Motion, Stage
from sim.surroundings import Surroundings
from sim.timing import Rates, exposures
from sim.types import Array, DepthPicture, Frame, Image, Pose, Posture, Truth

UNSTABLE = [
    mujoco.mjtWarning.mjWARN_BADQPOS.value,
    mujoco.mjtWarning.mjWARN_BADQVEL.value,
    mujoco.mjtWarning.mjWARN_BADQACC.value,
]
"""Warnings after which MuJoCo has put everything back to its start."""


@dataclass(frozen=True, slots=True)
class WorldConfig:
    """Settings of the simulation: physics and drive rates [Hz], and measuring of visibility.

    With `visibility`, each frame measures which fraction of the target's silhouette in the picture
    is not hidden by other bodies, by two more renderings.
    """

    physics_rate: Annotated[float, Ge(240), Le(100_000)] = 480.0
    """Physics steps a second [Hz]; a few more where the camera's rate does not divide it."""
    drive_rate: Annotated[float, Ge(0.1), Le(100_000)] = 120.0
    """Rate at which the drives compute joint rates from the twist [Hz]; at least once a frame,
    after a whole number of physics steps. They know the joints' positions of one physics step
    before, and the present ones at a frame and at each picture of an exposure."""
    visibility: bool = False
    """Measure in each frame which fraction of the target's silhouette in the picture is not hidden
    by other bodies (two more renderings a frame)."""


@dataclass(frozen=True, slots=True)
class WorldParts:
    """What a simulated world is made of: robot, target, motion and disturbances; the settings of
    camera, simulation and leader (a moving tag to follow); the errors of calibration that the robot
    relies on; and the surroundings.
    """

    robot: Design
    target: Target
    motion: Motion
    disturbances: Sequence[Disturbance] = ()
    camera: CameraConfig = field(default_factory=CameraConfig)
    believed: BelievedConfig = RIGHT
    config: WorldConfig = field(default_factory=WorldConfig)
    surroundings: Surroundings = field(default_factory=Surroundings)
    leader: LeaderConfig = field(default_factory=LeaderConfig)


class Unstable(RuntimeError):
    """Error: the simulated physics diverged; the message names a setting to change."""


@dataclass(frozen=True, slots=True)
class Moment:
    """The state of the simulated world at the time of one frame. It holds a function that waits for
    the picture; the target's exact pose and projection (`truth`), and those of a target at its goal
    (None without a leader, a moving tag); T_world_target one frame interval ago; the robot's exact
    posture, and the one that it believes; poses (n, 3, 4) of the n bodies of the scene in the
    world; and measured joint rates (m,) [m/s or rad/s].
    """

    picture: Callable[[], Frame]
    """Function that waits for the picture and returns it."""
    truth: Truth
    goal: Truth | None
    """The truth of a target at its desired pose relative to the leader; None without a leader."""
    target_before: Pose
    """T_world_target one frame interval ago, as `World.target_at` has it."""
    posture: Posture
    """The exact posture of the robot."""
    believed: Posture
    """The posture as the robot believes it."""
    bodies: Array
    """Poses (n, 3, 4) of all bodies except the fixed world body, in the world, [R | t] [m], in the
    order of `World.moving`."""
    rates: Array
    """Measured joint rates (m,) [m/s or rad/s]."""


class World:
    """The simulated world of one run: robot, camera, table and target. Call `start` and `step` to
    move the robot, `look` for pictures, and `close` after use.

    `rng` draws the noise of the pictures, `depth` that of depth pictures, and `encoders` that of
    the encoders (None for either: a generator with seed 0). `renderer` makes the camera's renderer
    in place of the one that the camera's settings name.
    """

    def __init__(
        self,
        parts: WorldParts,
        rng: np.random.Generator,
        encoders: np.random.Generator | None = None,
        renderer: MakeRenderer | None = None,
        depth: np.random.Generator | None = None,
    ) -> None:
        """Build the scene from its parts and set it to time 0.

        Args:
            parts: What to put together.
            rng: Draws the noise of the camera's sensor.
            encoders: Draws the noise of the robot's encoders; None: a generator with seed 0.
            renderer: Makes the renderer of the camera; None: that of the camera's settings.
            depth: Draws the noise of the depth pictures; None: a generator with seed 0.

        Raises:
            ValueError: A part does not fit the others, a picture or colour of the surroundings
                cannot be used, or MuJoCo refuses the scene's model; the message says which.
        """
        config = parts.config
        camera = parts.camera
        robot = replace(parts.robot, mounting=mounting_of(camera))
        rates = Rates.of(config.physics_rate, config.drive_rate, camera.rate)
        steps = rates.steps
        self._drive_steps = rates.drive_steps
        self.period = 1.0 / camera.rate
        props = [prop for d in parts.disturbances for prop in d.props]
        leader = parts.leader.leads(parts.target.outline)
        self.model = build_model(
            rates.physics, camera, robot, parts.target, props, parts.surroundings, leader
        )
        self.data = mujoco.MjData(self.model)
        self.robot = Robot(self.model, robot)
        self.camera = camera_of(camera, self.model, CAMERA)
        self.camera_believed = parts.believed.camera(self.camera)
        self._known = as_believed(self.robot, robot, parts.believed, encoders)
        self._eye = self.model.camera(CAMERA).id
        self.outline = parts.target.outline
        self.outline_found = parts.target.found
        self._stage = Stage(
            self.model, parts.motion, parts.disturbances, self.robot, self.data, leader
        )
        self._visibility = config.visibility
        self._lens = Lens(self.camera)
        make = _supersampled(renderer or renderer_of(camera), camera.supersample)
        self._renderer = make(self.model, CAMERA, self._lens.view)
        bands = exposures(camera, steps)
        self._sensor = Sensor(camera, self._lens, rng, bands)
        depth = depth or np.random.default_rng(0)
        self._depth_sensor = DepthSensor(camera, depth) if camera.depth else None
        self._exposed_at = {k for band in bands for k in band.steps} - {steps}
        # The physics steps of a frame interval at which something is to be done, and its end.
        self._moments = sorted({*range(0, steps, self._drive_steps), *self._exposed_at, steps})
        self.ticks = self.period / steps * np.arange(0.0, steps, self._drive_steps)
        """Times after a frame at which the drives get new joint rates (n,) [s]."""
        # Times from each update of the drives to the next one [s]. Drives are updated at each
        # frame: the last time of a frame is shorter where a frame has no whole number of others.
        updates = [*range(0, steps, self._drive_steps), steps]
        held = np.diff(updates)
        self._holds: list[float] = (held / rates.physics).tolist()
        self.shares = held / held[0]
        """The time from each update of the drives to the next one, over the first of these times
        (n,): 1, and less for the last update of a frame that has no whole number of the others."""
        self._pictures: list[Promise] = []
        self._frames = 0
        self._mean_twist = np.zeros(6)
        self._accepted = np.zeros(6)
        self._rates = np.zeros(len(self.robot.names))
        """The last joint rates (n,) [m/s or rad/s] for which the motors were driven, without the
        effect of backlash; acceleration limits refer to them."""
        self._image: Image = np.zeros((camera.height, camera.width, 3), np.uint8)
        self._depth: DepthPicture | None = None
        self._has_looked = False
        self._eye_at = self._set_stage(0.0)

    def close(self) -> None:
        """Release the renderer's buffers; the world cannot be used afterwards."""
        self._renderer.close()

    def start(
        self,
        pixel: Array,
        theta: float,
        depth: float,
        tilt: float = 0.0,
        towards: float = 0.0,
        way: Callable[[], Sequence[Pose]] | None = None,
    ) -> Reach:
        """Move the robot at once, without physics, so that the camera sees the target at a given
        pixel, angle and depth, or as near to that as possible; return how near.

        Args:
            pixel: Desired projection of the target's centre (2,) [px].
            theta: Desired direction of the target's nose in the image, from +u towards +v [rad].
            depth: Desired distance along the optical axis, before the tilt [m].
            tilt: Angle by which the camera is then moved around the target's centre [rad].
            towards: Direction in the picture to which it is moved, from +u towards +v [rad].
            way: Function that returns the camera poses that follow, one every 0.2 s, on which no
                joint should reach a limit: T_world_camera, or T_target_camera if the robot holds
                the target. None: no path follows.

        Raises:
            ValueError: At the desired pose the camera would be below the table's top, or would not
                see the target's front.
        """
        target = self._target_seen()
        heading = float(np.arctan2(target.rotation[1, 0], target.rotation[0, 0]))
        point = target.apply(self.outline.mean(axis=0))
        pose = placement.camera_above(self.camera, point, heading, pixel, theta, depth)
        return self._go(placement.tilted(pose, point, tilt, towards) if tilt else pose, way)

    def start_facing(
        self, T_camera_object: Pose, way: Callable[[], Sequence[Pose]] | None = None
    ) -> Reach:
        """Move the robot at once, without physics, so that the target's reference rectangle has a
        given pose in the camera frame, or one as near to it as possible; return how near.

        Args:
            T_camera_object: Pose of the rectangle's own frame: its origin in the centre, x along
                the target's nose, z away from a viewer of its front.
            way: Function that returns the camera poses that follow, one every 0.2 s, on which no
                joint should reach a limit: T_world_camera, or T_target_camera if the robot holds
                the target. None: no path follows.

        Raises:
            ValueError: At the desired pose the camera would be below the table's top, or would not
                see the target's front.
        """
        target = self._target_seen()
        return self._go(placement.camera_facing(self.outline, target, T_camera_object), way)

    def eye_at_goal(self, time: float, T_camera_object: Pose, *, turns: bool) -> Pose:
        """Return the camera pose at which the target is at its goal, at a given time:
        T_world_camera, or T_target_camera if the robot holds the target.

        Args:
            time: Time since the start of the run [s].
            T_camera_object: Desired pose of the target's reference rectangle in the camera frame;
                not used with a leader, whose motion gives the goal.
            turns: True: the camera turns with the target; False: its orientation stays that at the
                start of the run.
        """
        led = self._stage.goal(time)
        if led is not None:
            return led.inverse() @ self.robot.camera(self.data)
        target = self._target_seen(time)
        if not turns:
            target = Pose(self._target_seen().rotation, target.translation)
        return placement.camera_facing(self.outline, target, T_camera_object)

    def _target_seen(self, time: float = 0.0) -> Pose:
        """Return the target's pose at a time of the run [s], in the frame of `Robot.eye`: the
        world, or the held target itself.
        """
        return self.robot.mounting.seen_from(self._stage.target(time))

    def _go(self, T_world_camera: Pose, way: Callable[[], Sequence[Pose]] | None) -> Reach:
        target = self._target_seen()
        self.robot.mounting.check_start(T_world_camera)
        placement.check_sight(self.outline, T_world_camera, target)
        point = target.apply(self.outline.mean(axis=0))
        reached = reach(self.robot, self.data, T_world_camera, point, way)
        mujoco.mj_forward(self.model, self.data)
        self._eye_at = self._set_stage(0.0)
        return reached

    def step(self, twists: Array) -> tuple[str, ...]:
        """Simulate one frame interval, until the time of the next frame; return the joints whose
        limits changed the commanded camera twist, each with the limit's kind, such as "elbow
        (range)" or "elbow (speed)".

        Args:
            twists: Commanded camera twist (6,) in the camera frame [m/s, rad/s], or one for each of
                the n updates of the drives in the frame interval (n, 6), whose times are `ticks`.

        Raises:
            Unstable: The simulated physics diverged.
        """
        self._pictures = []  # those of an interval that nobody looked at are of no use
        before = self.robot.eye(self.data)
        each = twists if twists.ndim == 2 else [twists] * len(self.ticks)
        slowed_by = dict[str, None]()
        accepted = list[Array]()
        for k, until in pairwise(self._moments):
            if k in self._exposed_at:
                self._set_stage(self.data.time)
                self._pictures.append(self._renderer.begin(self.data))
            if k % self._drive_steps == 0:
                update = k // self._drive_steps
                hold = self._holds[update]
                rates, made, limits = self._known.rates(self.data, each[update], hold, self._rates)
                slowed_by |= dict.fromkeys(limits)
                accepted.append(made * self.shares[update])
                self._rates = rates
                self.data.ctrl[self.robot.drives] = self._known.driven(rates, hold)
            mujoco.mj_step(self.model, self.data, until - k)
        if self.data.warning.number[UNSTABLE].any():
            fastest = np.linalg.norm(np.reshape(each, (-1, 2, 3)), axis=2).max(axis=0)
            raise Unstable(
                "the simulation became unstable, at commanded camera twists of up to "
                f"{fastest[0]:.3g} m/s and {fastest[1]:.3g} rad/s: limit the law's twists if these "
                "are too fast, else raise world.physics_rate, which is too low for drives or masses"
            )
        self._frames += 1
        self._accepted = np.add.reduce(accepted) / self.shares.sum()
        self.data.time = self._frames * self.period
        self._eye_at = self._set_stage(self.data.time)
        self._mean_twist = log_se3(before.inverse() @ self.robot.eye(self.data)) / self.period
        return tuple(slowed_by)

    def posture(self) -> Posture:
        """Return the robot's exact posture (camera pose, joint positions, Jacobian, twists) at the
        present time. Its twists are means since the last frame, zero before the first `step`.
        """
        return self.robot.posture(self.data, self._mean_twist, self._accepted)

    def believed(self, posture: Posture) -> Posture:
        """Return the posture that the robot believes to have now; if it makes no errors, this is
        `posture`, the exact one. Call it once a frame, because it draws encoder noise, and its
        measured twist is the mean since the last call.
        """
        if isinstance(self._known, Robot):
            return posture
        return self._known.posture(self.data, self._accepted)

    def look(self) -> Frame:
        """Render the present scene and return the camera's frame. If a disturbance lets the camera
        drop it, the frame holds the last picture, and its `fresh` is False; the first frame is
        never dropped.
        """
        return self.begin()()

    def begin(self) -> Callable[[], Frame]:
        """Begin to render the picture of the present time; the simulation may go on meanwhile.

        Returns:
            Function that waits for the picture and returns the camera's frame. Call the functions
            of several pictures in the order in which the pictures were begun.
        """
        time = self.data.time
        index = self._frames
        effect = self._stage.effect(time)
        pictures = self._pictures
        self._pictures = []
        if effect.dropped and self._has_looked:
            return lambda: Frame(self._image, time, index, fresh=False, depth=self._depth)
        self._has_looked = True
        pictures.append(self._renderer.begin(self.data))
        depths = None if self._depth_sensor is None else self._renderer.begin_depth(self.data)

        def picture() -> Frame:
            if self._depth_sensor is not None and depths is not None:
                self._depth = self._depth_sensor.develop(self._lens.nearest(depths()))
            self._image = self._sensor.develop([made() for made in pictures], effect.gain)
            return Frame(self._image, time, index, depth=self._depth)

        return picture

    def moment(self) -> Moment:
        """Begin to render the picture of the present time, and return it with the state of the
        world. Call this once a frame, because it draws encoder noise.
        """
        picture = self.begin()
        posture = self.posture()
        return Moment(
            picture,
            self.truth(),
            self.goal(),
            self.target_at(self.data.time - self.period),
            posture,
            self.believed(posture),
            self.bodies(),
            self.robot.rates_measured(self.data),
        )

    def truth(self) -> Truth:
        """Return the exact pose and projection of the target at the present time. Its `visible` is
        the fraction that the method `visible` returns, or None if the setting `visibility` is off.
        """
        visible = self.visible() if self._visibility else None
        target = self._stage.target(self.data.time)
        return placement.truth(self.camera, self.outline, self._eye_at, target, visible)

    def goal(self) -> Truth | None:
        """Return the exact pose and projection that the target, which the robot holds, would have
        at the present time if it were at its desired pose relative to the leader, a moving tag;
        None if there is no leader.
        """
        goal = self._stage.goal(self.data.time)
        if goal is None:
            return None
        return placement.truth(self.camera, self.outline, self._eye_at, goal)

    def target_at(self, time: float) -> Pose:
        """Return the target's pose T_world_target at a time since the start of the run [s].

        If the robot holds the target, only the motion of its goal counts: the returned pose has the
        same error to the present goal as the held target, where it is now, has to the goal at that
        time. Without a leader (the moving tag that gives the goal) it is the held target's present
        pose.
        """
        target = self._stage.target(time)
        now = self._stage.goal(self.data.time)
        then = self._stage.goal(time)
        return target if now is None or then is None else now @ then.inverse() @ target

    @property
    def moving(self) -> tuple[str, ...]:
        """Names of all bodies of the scene except the fixed world body, those that never move
        included, in the order of the method `bodies`.
        """
        return tuple(self.model.body(i).name for i in range(1, self.model.nbody))

    def bodies(self) -> Array:
        """Return the poses (n, 3, 4) in the world, rotation and translation [R | t] [m], of all
        bodies of the scene except the fixed world body, in the order of `moving`.
        """
        rotations = self.data.xmat[1:].reshape(-1, 3, 3)
        return np.concatenate([rotations, self.data.xpos[1:, :, None]], axis=2)

    def _set_stage(self, time: float) -> Pose:
        """Set the prescribed bodies (target, leader, board) and the lights for a time of the run
        [s]; return T_world_camera.
        """
        if self._stage.follows_robot:
            self._refresh()
        self._stage.place(self.data, time, partial(camera_pose, self.data, self._eye))
        self._refresh()
        return camera_pose(self.data, self._eye)

    def _refresh(self) -> None:
        """Compute all poses of the scene anew, which are outdated after a physics step or new body
        poses.
        """
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)

    def visible(self) -> float:
        """Return which fraction, 0 to 1, of the part of the target's silhouette that lies in the
        picture is not hidden by other bodies; 0 if the target is outside of the picture. It renders
        the scene twice.
        """
        model = self.model
        own = model.body_rootid[model.geom_bodyid] == model.body(TARGET).id
        alone, seen = (
            self._lens.count(self._renderer.silhouette(self.data, own, alone=a))
            for a in (True, False)
        )
        return seen / alone if alone else 0.0


def _supersampled(make: MakeRenderer, factor: int) -> MakeRenderer:
    """Return a maker of renderers whose pixels are means of factor x factor pixels."""
    return partial(Supersampled, make, factor) if factor > 1 else make
