"""Settings of the simulated camera, and its intrinsics, which follow from these settings and the
robot's model.
"""

from dataclasses import dataclass, replace
from typing import Annotated, Literal

import mujoco
import numpy as np
from annotated_types import Ge, Gt, Le, Lt

from sim.camera.distortion import WIDEST, Distortion, Model
from sim.ranges import Degrees, File, Interval, Place, Share, check
from sim.types import Array, Camera

FOVY = 45.0
"""Default vertical field of view [deg]."""
NEAREST, FARTHEST = 0.1, 10.0
"""Default range of a depth camera [m]."""
SAME_PIXEL = 1e-6
"""A pixel of the border that is undistorted and distorted again must return with a smaller error
than this [px]; with absurd coefficients it does not."""
Brightness = Annotated[float, Ge(0), Le(100)]
Noise = Annotated[float, Ge(0), Le(100)]
Kind = Literal["opengl", "exact", "recording"]
"""Renderers."""
STANDS = (0.0, -1.0, 0.8, -100.0, 0.0, 0.0)
HELD = (0.0, 0.0, 0.05, 0.0, 0.0, 0.0)
"""Defaults of `pose`, with which the camera stands beside the table and is tilted down to it, and
of `held`, with which the target is 5 cm before the hand."""
Pose6 = tuple[Place, Place, Place, Degrees, Degrees, Degrees]
Focal = Annotated[float, Ge(1), Le(100_000)]
Principal = Annotated[float, Ge(-10_000), Le(10_000)]


@dataclass(frozen=True, slots=True)
class CameraConfig:
    """Settings of the camera: mounting, image, lens, shutter, noise, renderer, depth pictures.

    Poses are x, y, z [m] and roll, pitch, yaw [deg]: with `mounted` = "world", `pose` is that of
    the camera in the world, and `held` that of the target in the frame that the robot's camera
    would have. `rate` is the frame rate [Hz]; a pixel is the mean of `supersample` x `supersample`
    rendered ones; `noise` is in grey levels of 255; `exposure` is a fraction of the frame interval;
    `readout_ms` is the delay from the first to the last row of a rolling shutter, for which `bands`
    exposures are rendered. `textures` (their filter) and `shadows` (soft ones) act in the renderer
    "exact" only. `auto_gain` is a time constant [s]; `depth` adds depth pictures, whose noise and
    range are in m and whose `depth_holes` are in px. None means the value of the robot's model, or
    no such effect.
    """

    mounted: Literal["robot", "world"] = "robot"
    """Mounting: in the hand of the "robot" (eye in hand); or in the "world", where the robot holds
    the target (eye to hand)."""
    pose: Pose6 = STANDS
    """Pose of a camera in the world: x, y, z [m], roll, pitch, yaw [deg] about the fixed axes x, y,
    z. With zeros for the angles the camera looks straight up, and the rows of its picture run along
    world x. By default it looks across the table."""
    held: Pose6 = HELD
    """Pose of the target in the frame that the robot's camera would have in the hand: x, y, z [m],
    roll, pitch, yaw [deg]; by default 5 cm before the hand, facing away from it.
    """
    width: Annotated[int, Ge(16), Le(2560)] = 320
    """Image width [px]."""
    height: Annotated[int, Ge(16), Le(1920)] = 240
    """Image height [px]."""
    rate: Annotated[float, Ge(0.5), Le(1000)] = 30.0
    """Frames a second [Hz]; where it does not divide the physics rate, the physics step is made a
    little shorter."""
    fovy_deg: Annotated[float, Gt(1), Lt(170)] | None = None
    """Vertical field of view, with the distortion if there is one [deg]; by default what the camera
    of the robot's model has, by its sensor or its own field of view, or else 45."""
    fx: Focal | None = None
    """Focal length along u, in place of the field of view [px]."""
    fy: Focal | None = None
    """Focal length along v [px]; by default fx."""
    cx: Principal | None = None
    """Principal point, u from the image's left border [px], 0.5 more than OpenCV's; by default the
    middle, or what the model's sensor gives."""
    cy: Principal | None = None
    """Principal point, v from the upper border [px]; by default as for cx."""
    distortion: Model | None = None
    """Distortion of the lens: "plumb_bob" (k1 k2 p1 p2 k3), "rational" (k1 k2 p1 p2 k3 k4 k5 k6) or
    "fisheye" (k1 k2 k3 k4); by default there is none."""
    coefficients: tuple[Annotated[float, Ge(-10_000), Le(10_000)], ...] = ()
    """Coefficients of the distortion, in OpenCV's order."""
    calibration: File | None = None
    """File (ROS camera_info, or OpenCV's YAML or XML) that gives fx, fy, cx, cy, distortion and
    image size; beside the scenario's file, or in the working directory where --set names it."""
    supersample: Annotated[int, Ge(1), Le(4)] = 1
    """Each pixel is the mean of a block of this many by this many rendered pixels: edges then move
    smoothly, and not from pixel to pixel. Rendering takes three times as long with 2.
    """
    brightness: Brightness = 1.0
    """Factor on the brightness of every picture, before noise is added: below 1 for a dark room."""
    noise: Noise = 0.0
    """Standard deviation of the sensor noise [grey levels of 255]."""
    exposure: Share = 0.0
    """Exposure as a fraction of the frame interval, rounded to a whole number of physics steps
    (`world.physics_rate`), so less than half a step is none; what moves meanwhile is blurred."""
    readout_ms: Annotated[float, Ge(0), Le(1000)] = 0.0
    """Delay of a rolling shutter from the exposure of the first row to that of the last row, which
    ends at the frame's time [ms]; the exposures end at physics steps, and less than half a step is
    none. By default all rows are exposed together."""
    bands: Annotated[int, Ge(2), Le(64)] = 8
    """Number of exposures that are rendered for a rolling shutter, each ending at a physics step;
    there are fewer if the readout has fewer steps. Rows between two of them are a weighted mean."""
    renderer: Kind = "opengl"
    """Renderer of the pictures: "opengl", MuJoCo's renderer with this machine's graphics driver; or
    "exact", which needs no driver, gives the same pictures on every machine, and draws no
    reflections, translucence or shadows of lamps. Without OpenGL "exact" is used, and a line says
    so. A table [recording] sets "recording"."""
    textures: Literal["fast", "fine"] = "fast"
    """Filter of textures in the renderer "exact". "fast" takes the nearest mipmap level and
    computes texture coordinates every 32 px of a row; "fine" takes the weighted mean of two levels,
    as OpenGL always does, and computes texture coordinates every 8 px. Between these pixels the
    coordinates are interpolated. `--exact` sets "fine"."""
    shadows: bool = False
    """Draw a soft shadow on the table under each thing on it, as under an overcast sky; only in the
    renderer "exact"."""
    auto_gain: Interval | None = None
    """Time constant [s] with which an automatic gain, 1/8 to 8, brings the picture's mean
    brightness back to that of the first picture; by default the gain is fixed."""
    depth: bool = False
    """Add a depth picture to each picture: distances along the optical axis [m], of the same
    pixels at the frame's time."""
    depth_noise: Annotated[float, Ge(0), Le(1)] = 0.0
    """Standard deviation of a depth at 1 m [m]; it grows with the square of the distance, as that
    of stereo and structured light. 0.0014 is a Kinect (Khoshelham and Elberink 2012)."""
    depth_holes: Annotated[int, Ge(0), Le(50)] = 0
    """Number of pixels without a depth on each side of an edge between near and far."""
    depth_nearest: Annotated[float, Ge(0), Le(1000)] = NEAREST
    """Smallest depth that is measured [m]; nearer points have no depth."""
    depth_farthest: Annotated[float, Gt(0), Le(1000)] = FARTHEST
    """Largest depth that is measured [m]; farther points have no depth."""

    def __post_init__(self) -> None:
        """Check that the settings fit each other.

        Raises:
            ValueError: Two settings exclude each other, one needs another that is not given, the
                principal point is far outside the picture, readout and exposure do not fit into a
                frame interval, or the distortion has a wrong number of coefficients.
        """
        of_depth = (self.depth_noise, self.depth_holes, self.depth_nearest, self.depth_farthest)
        check(
            (
                self.mounted == "robot" and (self.pose, self.held) != (STANDS, HELD),
                'pose and held need mounted = "world"',
            ),
            (
                self.fovy_deg is not None and self.fx is not None,
                "fovy_deg and fx both give the focal length; leave one of them out",
            ),
            (
                self.fy is not None and self.fx is None,
                "fy needs fx, the focal length along u",
            ),
            (
                self.distortion is None and bool(self.coefficients),
                "coefficients need a distortion: plumb_bob, rational or fisheye",
            ),
            (
                self.readout_ms / 1e3 * self.rate + self.exposure > 1 + SAME_PIXEL,
                f"readout_ms = {self.readout_ms:g} and the exposure do not fit into a frame at "
                f"{self.rate:g} Hz: lower readout_ms, exposure or rate",
            ),
            (
                not self.depth and of_depth != (0.0, 0, NEAREST, FARTHEST),
                "depth_noise, depth_holes and the range of depths need depth = true",
            ),
            (
                self.depth_nearest >= self.depth_farthest,
                f"depth_nearest = {self.depth_nearest:g} should be below depth_farthest = "
                f"{self.depth_farthest:g}",
            ),
            *(
                (
                    not -size <= at <= 2 * size,
                    f"{name} = {at:g} px is far outside of a picture of {size} px; it should be "
                    f"from {-size} to {2 * size}",
                )
                for name, at, size in (("cx", self.cx, self.width), ("cy", self.cy, self.height))
                if at is not None
            ),
        )
        _ = self.lens

    @property
    def lens(self) -> Distortion | None:
        """The distortion of the lens that these settings give; None without one, and for a
        plumb_bob or rational distortion whose coefficients are all zero.
        """
        if self.distortion is None:
            return None
        lens = Distortion(self.distortion, self.coefficients)
        return lens if self.distortion == "fisheye" or any(self.coefficients) else None


def pinhole(model: mujoco.MjModel, name: str, width: int, height: int) -> Camera:
    """Return the pinhole intrinsics [px] of a camera of a MuJoCo model, given the camera's name,
    for images of width x height [px].

    A camera with a sensor size has its focal length and principal point in metres on the sensor,
    which the image fills; all others have a vertical field of view, square pixels, and the
    principal point in the middle of the image.

    Raises:
        ValueError: The camera's projection is not perspective.
    """
    camera = model.camera(name).id
    if model.cam_projection[camera] != mujoco.mjtProjection.mjPROJ_PERSPECTIVE:
        raise ValueError(
            f"the camera '{name}' of the robot's model is not a perspective one: set its "
            "projection to perspective"
        )
    sensor = model.cam_sensorsize[camera].astype(float)
    if not sensor.all():
        f = height / 2 / np.tan(np.radians(model.cam_fovy[camera]) / 2)
        return Camera(fx=f, fy=f, cx=width / 2, cy=height / 2, width=width, height=height)
    intrinsic = model.cam_intrinsic[camera].reshape(2, 2).astype(float)
    focal, offset = (intrinsic / sensor * (width, height)).tolist()
    # MuJoCo's offset says where the middle of the image lies as seen from the principal point.
    cx = width / 2 - offset[0]
    cy = height / 2 - offset[1]
    return Camera(fx=focal[0], fy=focal[1], cx=cx, cy=cy, width=width, height=height)


def camera_of(config: CameraConfig, model: mujoco.MjModel, name: str) -> Camera:
    """Return the intrinsics [px] and the distortion of a camera of a MuJoCo model, given the
    camera's name. Focal lengths, principal point and field of view in the settings replace those of
    the model. A vertical field of view, where it gives the focal length, is that of the distorted
    image.

    Raises:
        ValueError: The distortion or the field of view cannot be rendered, the model's camera is
            not perspective, or the settings name a calibration file, which is read only when a
            scenario is loaded.
    """
    if config.calibration is not None:
        raise ValueError(
            "camera.calibration is read only where a scenario is loaded: give servo.load the "
            'setting "camera.calibration=FILE"'
        )
    own = pinhole(model, name, config.width, config.height)
    fx = own.fx
    fy = own.fy
    lens = config.lens
    has_sensor = bool(model.cam_sensorsize[model.camera(name).id].all())
    if config.fx is not None:
        fx = config.fx
        fy = config.fy or config.fx
    elif config.fovy_deg is not None or (lens is not None and not has_sensor):
        fovy = config.fovy_deg or float(model.cam_fovy[model.camera(name).id])
        # The field of view holds with the distortion: the bent ray at its edge meets the border.
        edge = np.array([0.0, np.tan(np.radians(fovy) / 2)])
        fx = fy = config.height / 2 / float((edge if lens is None else lens.bend(edge))[1])
    cx = own.cx if config.cx is None else config.cx
    cy = own.cy if config.cy is None else config.cy
    camera = replace(own, fx=fx, fy=fy, cx=cx, cy=cy, distortion=lens)
    _check(camera)
    return camera


def border(camera: Camera) -> Array:
    """Return the pixel coordinates (n, 2), u, v [px], of points 1 px apart along the four borders
    of a camera's image, of which the upper left corner is (0, 0).
    """
    u = np.arange(camera.width + 1.0)
    v = np.arange(camera.height + 1.0)
    sides = [(u, 0 * u), (u, 0 * u + camera.height), (0 * v, v), (0 * v + camera.width, v)]
    return np.concatenate([np.stack(side, axis=-1) for side in sides])


def _check(camera: Camera) -> None:
    """Check that the picture of a camera can be rendered as a plane and bent by its lens.

    Raises:
        ValueError: The distortion folds back or cannot be inverted inside the picture, or the
            picture is too wide.
    """
    pixels = border(camera)
    lens = camera.distortion
    rays = camera.normalise(pixels)
    farthest = float(np.hypot(*rays.T).max())
    if lens is not None and lens.folds and farthest >= lens.reach:
        angle = np.degrees(np.arctan(lens.reach))
        raise ValueError(
            f"camera.coefficients: the distortion {lens.model} folds back inside the picture: it "
            f"holds up to {angle:.3g} deg from the optical axis, and the picture reaches farther; "
            "correct camera.coefficients or the calibration file that gives them, or use a longer "
            "focal length or a smaller picture"
        )
    if not farthest < np.tan(np.radians(WIDEST)):
        raise ValueError(
            "camera: the border of the picture is more than "
            f"{WIDEST:g} deg from the optical axis, which cannot be rendered; use a longer "
            "focal length"
        )
    if not np.abs(camera.to_pixels(rays) - pixels).max() < SAME_PIXEL:
        raise ValueError(
            "camera.coefficients: the distortion cannot be inverted in the picture; correct "
            "camera.coefficients or the calibration file that gives them, or use a longer focal "
            "length or a smaller picture"
        )
