"""A recording drawn again: each picture of a film beside the one that the simulated camera takes at
the recorded posture, and their difference.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from servo.closing import closing
from servo.loop.episode import Episode
from servo.output.recording.destination import RecordingFile
from servo.output.recording.layout import REPLAY
from servo.output.recording.replay_log import ReplayLog
from servo.twin.compare import Comparison
from servo.twin.diagnosis import effect
from servo.twin.mount import Mount, camera_poses
from servo.twin.scene_camera import SceneCamera
from sim.camera.lens import Lens
from sim.geometry import log_so3
from sim.types import Array, Camera, Image, Pose
from tracking.drawing import colours
from tracking.drawing.film_page import FilmPage, panel
from tracking.drawing.running_chart import Chart
from tracking.sequences.sources import Picture

FILM = "replay.mp4"
RECORDING = "replay.rrd"
PANEL = 416, 312
"""Width and height of each picture on a page of the film [px]: three of them, with the margins, are
1312 px wide."""
LOUDER = 3.0
"""Factor on the drawn difference."""
UPRIGHT = np.radians(3.0)
NEAR = 0.03
"""The base's frame is the room's own if the scene's plane is level to within `UPRIGHT` [rad] and at
the height of the base's origin to within `NEAR` [m]."""
NO_STATUS = ""
STEP = 0.5
"""Interval of the postures that place the scene [s]."""


def room_in(compared: Comparison) -> Pose | None:
    """Return T_room_base [m] for a comparison of log and film, from `room_of` with camera poses
    0.5 s apart; None: the base's frame is the room's.
    """
    times = np.arange(compared.motion.times[0], compared.motion.times[-1], STEP)
    poses = camera_poses(compared.motion, compared.fits.mount, times)
    return room_of(poses, compared.fits.mount.plane)


def room_of(poses: list[Pose], plane: Array) -> Pose | None:
    """Return T_room_base [m], the pose of a real robot's base in the simulated room, so that the
    plane of the scene is the table's top, and the point at the middle of the pictures is at the
    table's middle, on average over the poses. The rotation about the vertical is not known; the
    room's x axis is turned to that of the camera. None: the base's frame is the room's, as the
    plane is level to 3 deg and at the height of the base's origin to 3 cm.

    Args:
        poses: Poses T_base_camera [m].
        plane: The scene's plane in the camera's frame, n (3,) with n . X = 1 [1/m].
    """
    turns = np.stack([pose.rotation for pose in poses])
    places = np.stack([pose.translation for pose in poses])
    # The normal of the plane towards the camera, and where the axis meets it.
    up = -(turns @ (plane / np.linalg.norm(plane))).mean(axis=0)
    up /= np.linalg.norm(up)
    middle = (places + turns[:, :, 2] / plane[2]).mean(axis=0)
    right = turns[:, :, 0].mean(axis=0)
    right -= up * (up @ right)
    right /= np.linalg.norm(right)
    R = np.stack([right, np.cross(up, right), up])
    is_room = np.arccos(np.clip(up[2], -1, 1)) < UPRIGHT and abs(middle[2]) < NEAR
    return None if is_room else Pose(R, -R @ middle)


def write_replay(
    pictures: Iterable[Picture],
    begins: float,
    compared: Comparison,
    camera: Camera,
    room: Pose | None,
    episode: Episode,
    folder: Path,
    tick: Callable[[str], None],
) -> list[float]:
    """Write the pictures of a film beside those of its simulation as a film (replay.mp4) and for
    Rerun (replay.rrd), and return the median absolute difference of each pair of pictures [grey
    levels]. Pictures that cannot be decoded, or are outside the log's time, are left out.

    Args:
        pictures: The film's pictures.
        begins: Time of the first picture on the log's clock [s], before the estimated offset is
            added.
        compared: The comparison of log and film.
        camera: The film's camera.
        room: Pose T_room_base of the base in the simulated room, from `room_in`.
        episode: The simulated scene.
        folder: Folder to write into.
        tick: Called after each pair of pictures, with a note; Ctrl-C ends the film there.

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed before the first pair of pictures.
    """
    motion, mount = compared.motion, compared.fits.mount
    stretch, flips = effect(compared.fits.diagnosis.best.corrections)
    middle = float(compared.fits.tracks.times[[0, -1]].mean())
    first, last = motion.times[0], motion.times[-1]
    lens = Lens(replace(camera, fx=camera.fx * mount.focal, fy=camera.fy * mount.focal))
    curves = {"median difference": colours.CURVES[0]}
    chart = Chart(curves, "grey levels")
    page = FilmPage(folder / FILM, 30.0, "Replay", tuple(REPLAY.values()), PANEL, chart)
    log = ReplayLog(RecordingFile(folder / RECORDING))
    scene = SceneCamera(episode, lens.view)
    found: list[float] = []
    with closing(page.close, log.close, scene.close):
        try:
            for number, picture in enumerate(pictures):
                time = begins + stretch * picture.time
                time += mount.offset + mount.drift * (time - middle)
                if picture.image is None or not first < time < last:
                    continue
                (pose,) = camera_poses(motion, mount, np.array([time]))
                pose = pose if room is None else room @ pose
                drawn = lens.bend(scene.picture(pose, time))
                seen = np.ascontiguousarray(picture.image[:: int(flips[1]), :: int(flips[0])])
                off = _difference(seen, drawn)
                found.append(float(np.median(off)))
                shown = np.clip(LOUDER * off, 0, 255).astype(np.uint8)
                shown = np.repeat(shown[..., None], 3, axis=2)
                three = seen, drawn, shown
                log.add(number, picture.time, three, found[-1])
                panels = [panel(each, *PANEL) for each in three]
                note = f"{found[-1]:.1f} levels"
                page.add(picture.time, panels, [found[-1]], [NO_STATUS], note)
                tick(note)
        except KeyboardInterrupt:
            if not found:
                raise
    return found


def _difference(real: Image, drawn: Image) -> Array:
    """Return the absolute difference (H, W) of two pictures in grey."""
    one, other = (
        cv2.cvtColor(each.astype(np.float32), cv2.COLOR_RGB2GRAY) for each in (real, drawn)
    )
    return np.abs(one - other)


def turned_by(believed: Mount, mount: Mount) -> tuple[Array, Array]:
    """Return the pose of the stated camera in the frame of the estimated one: rotation vector (3,)
    [rad] and position (3,) [m].

    Args:
        believed: The pose of the camera in the hand as the user states it.
        mount: The pose of the camera in the hand as it was estimated.
    """
    R = mount.rotation.T @ believed.rotation
    return log_so3(R), mount.rotation.T @ (believed.lever - mount.lever)
