"""Hidden robots: a camera on a moving hand films the table, and the robot logs its hand with errors
of its own. The truth is known to the caller alone.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from servo.loop.episode import Episode
from servo.scenario.load import load
from servo.twin.scene_camera import SceneCamera
from servo.twin.tracks import Tracks, follow
from servo.twin.wiggle import swings
from sim.types import Camera, Pose
from tracking.sequences.sources import Picture

AXES = ("m", "m", "m", "rad", "rad", "rad")
SIZE = 320, 240
FOCAL = 280.0
CAMERA = Camera(FOCAL, FOCAL, 160.0, 120.0, *SIZE)
STARTS = 2.0
"""The log begins and ends so long before and after the film [s]."""


@dataclass
class Film:
    """A camera's path, and what it films."""

    seed: int = 0
    seconds: float = 40.0
    rate: float = 30.0
    moves: tuple[float, ...] = (1.0,) * 6
    """Factors on the swings of the camera's axes."""
    size: float = 1.0
    scenario: str = "clutter"
    changes: list = field(default_factory=list)
    dark: float = 1.0
    cut: bool = False
    freeze: bool = False

    def pose(self, times):
        """R (n, 3, 3) and t (n, 3) of T_world_camera."""
        rng = np.random.default_rng([self.seed, 7])
        grid = np.arange(-STARTS, self.seconds + STARTS + 0.01, 0.005)
        path = swings(AXES, grid, self.seed, self.size) * self.moves
        path = np.stack([np.interp(times, grid, each) for each in path.T], axis=1)
        look = np.array([np.pi - rng.uniform(-0.25, 0.25), rng.uniform(-0.25, 0.25), 0.0])
        base = Rotation.from_euler("xyz", look) * Rotation.from_euler("z", rng.uniform(-3, 3))
        height = rng.uniform(0.55, 0.9)
        ahead = base.apply([0, 0, 1])
        middle = -ahead * height / -ahead[2] + [*rng.uniform(-0.1, 0.1, 2), 0]
        turns = base * Rotation.from_rotvec(path[:, 3:])
        return turns.as_matrix(), middle + path[:, :3]

    def pictures(self):
        """The film's pictures; the car drives through some of them."""
        with Episode(
            load(self.scenario, ["robot.kind=free", *self.changes]), seen=False
        ) as episode:
            scene = SceneCamera(episode, CAMERA)
            try:
                times = np.arange(round(self.seconds * self.rate)) / self.rate
                for k, (R, t) in enumerate(zip(*self.pose(times), strict=True)):
                    if self.cut and self.seconds / 3 < times[k] < self.seconds / 2:
                        continue
                    if self.cut and k % 40 == 0:
                        R = R @ Rotation.from_rotvec([0, 0, 2.0]).as_matrix()
                    time = 6 + 6 * np.sin(times[k] / 6)
                    image = scene.picture(Pose(R, t), time)
                    rng = np.random.default_rng([self.seed, k])
                    noise = rng.standard_normal(image.shape, dtype=np.float32)
                    image = np.clip(image * self.dark + 1.5 * noise, 0, 255).astype(np.uint8)
                    yield Picture(f"frame {k}", times[k], image)
            finally:
                scene.close()

    def tracks(self, tick=lambda _: None) -> Tracks:
        return follow(self.pictures(), lambda *_: CAMERA, tick)


@dataclass
class Robot:
    """A hidden robot: how it logs the film's camera path."""

    offset: float
    rotation: Rotation
    lever: np.ndarray
    rate: float = 125.0
    position_noise: float = 2e-4
    turn_noise: float = 4e-4
    jitter: float = 1e-3
    seed: int = 0

    @staticmethod
    def drawn(seed):
        rng = np.random.default_rng([seed, 3])
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        lever = rng.normal(size=3)
        lever *= rng.uniform(0.01, 0.05) / np.linalg.norm(lever)
        return Robot(
            rng.uniform(-0.2, 0.2),
            Rotation.from_rotvec(axis * np.radians(rng.uniform(5, 30))),
            lever,
            np.exp(rng.uniform(np.log(50), np.log(250))),
            rng.uniform(1e-4, 4e-4),
            rng.uniform(2e-4, 8e-4),
            rng.uniform(0.2e-3, 2e-3),
            seed,
        )

    def log(self, film):
        """Times (n,) and poses (n, 7): x, y, z, qx, qy, qz, qw of T_base_hand."""
        rng = np.random.default_rng([self.seed, 5])
        times = np.arange(-STARTS + 0.5, film.seconds + STARTS - 0.5, 1 / self.rate)
        R, t = film.pose(times)
        R, t = Rotation.from_matrix(R), t
        # T_world_hand = T_world_camera T_camera_hand
        hand = R * self.rotation.inv()
        place = t - hand.apply(self.lever)
        base = Rotation.random(rng=np.random.default_rng([self.seed, 9]))
        hand = base * hand * Rotation.from_rotvec(rng.normal(0, self.turn_noise, (len(times), 3)))
        place = base.apply(place) + rng.normal(0, self.position_noise, place.shape)
        stamps = times + self.offset + rng.uniform(-1, 1, len(times)) * self.jitter
        return np.sort(stamps), np.hstack([place, hand.as_quat()])

    def errors(self, mount):
        """Offset [s], rotation vector [rad] and lever [m] along the camera's axes: found - true."""
        turn = (self.rotation.inv() * Rotation.from_matrix(mount.rotation)).as_rotvec()
        return np.array(
            [
                mount.offset - self.offset,
                *turn,
                *(mount.arm - self.rotation.inv().apply(self.lever)),
            ]
        )


def played(changes=(), seconds=20.0, late=2, seed=0):
    """Play the wiggle on a simulated robot: yield pictures, and collect the rows of its log.

    Args:
        changes: Of the scenario "still".
        seconds: Length.
        late: Frames after which a command acts.
        seed: Seed of the motion.
    """
    rows = []

    def pictures():
        settings = ["robot.kind=gantry", *changes]
        with Episode(load("still", settings), seen=False) as episode:
            world = episode.world
            times = np.arange(round(seconds / world.period) + 1) * world.period
            path = swings(AXES, times, seed)
            asked = np.vstack([np.diff(path, axis=0) / world.period, np.zeros((1, 6))])
            for k, time in enumerate(times):
                posture = world.posture()
                R = Rotation.from_matrix(posture.T_base_camera.rotation).as_quat()
                names = zip(world.robot.names, world.robot.units, posture.joints, strict=True)
                rows.append(
                    {"time_s": float(time)}
                    | dict(
                        zip(
                            ("camera_x_m", "camera_y_m", "camera_z_m"),
                            posture.T_base_camera.translation.tolist(),
                            strict=True,
                        )
                    )
                    | dict(
                        zip(
                            ("camera_qx", "camera_qy", "camera_qz", "camera_qw"),
                            R.tolist(),
                            strict=True,
                        )
                    )
                    | {f"joint_{n}_{u}": float(q) for n, u, q in names}
                    | {
                        f"command_{n}_{'m' if n[0] == 'v' else 'rad'}_s": float(x)
                        for n, x in zip(("vx", "vy", "vz", "wx", "wy", "wz"), asked[k], strict=True)
                    }
                )
                yield Picture(f"frame {k}", float(time), world.look().image)
                world.step(asked[max(0, k - late)] if k >= late else np.zeros(6))

    return pictures(), rows
