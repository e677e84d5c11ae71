"""Timing of a simulation: how many physics steps a frame interval has, and at which of them the
drives are updated and the pictures of an exposure are rendered.
"""

from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray

from sim.camera.camera import CameraConfig

WHOLE = 1e-9
"""Tolerance for a ratio of rates to count as whole."""
SUBFRAMES = 6
"""Pictures that are averaged over an exposure: chosen by hand, as each is a rendering."""


@dataclass(frozen=True, slots=True)
class Rates:
    """The rates of a simulation, adapted to the camera's frame rate: physics steps a second [Hz],
    physics steps in a frame interval, and physics steps between two updates of the drives.
    """

    physics: float
    """Physics steps a second [Hz]."""
    steps: int
    """Physics steps a frame."""
    drive_steps: int
    """Physics steps from one update of the drives to the next."""

    @staticmethod
    def of(physics_rate: float, drive_rate: float, rate: float) -> "Rates":
        """Return rates near the desired physics, drive and camera rates [Hz], such that a frame
        interval has a whole number of physics steps; the camera's rate is kept.

        If the camera's rate divides the physics rate, the physics rate is kept too, and the time
        between two updates of the drives is rounded to a whole number of physics steps, at least
        one. Else physics gets faster, never slower, until a frame interval is a whole number of
        drive updates, each a whole number of physics steps.
        """
        ratio = physics_rate / rate
        steps = round(ratio)
        if steps >= 1 and abs(ratio - steps) <= WHOLE * ratio:
            return Rates(physics_rate, steps, max(1, round(physics_rate / drive_rate)))
        updates = min(max(1, round(drive_rate / rate)), ceil(ratio))
        steps = updates * ceil(ratio / updates)
        return Rates(steps * rate, steps, steps // updates)

    def changed(self, physics_rate: float, drive_rate: float, rate: float) -> dict[str, float]:
        """Return those of the rates in use [Hz] that differ from the desired physics and drive
        rate, by the names "world.physics_rate" and "world.drive_rate". `rate` is the camera's frame
        rate; a desired drive rate below it counts as this rate, because drives are updated at least
        once a frame.
        """
        drive = max(self.physics / self.drive_steps, rate)  # once a frame at least
        pairs = {
            "world.physics_rate": (self.physics, physics_rate),
            "world.drive_rate": (drive, max(drive_rate, rate)),
        }
        return {
            name: used for name, (used, asked) in pairs.items() if abs(used / asked - 1) > WHOLE
        }


@dataclass(frozen=True, slots=True, eq=False)
class Band:
    """Neighbouring rows of a picture that share an exposure: all rows, or some of them with a
    rolling shutter. It has the number of the first row; the weight of the exposure in each row from
    there on (n, 1, 1); and the numbers of the physics steps of the frame interval after which a
    picture is rendered for it.
    """

    begin: int
    """The first row."""
    weights: NDArray[np.float32]
    """Share of this exposure in each row from there on (n, 1, 1)."""
    steps: tuple[int, ...]
    """The physics steps of a frame interval at which a sub-frame is taken, in order."""


def exposures(camera: CameraConfig, steps: int) -> tuple[Band, ...]:
    """Return the exposures of a frame, each with the rows to which it contributes, from the
    picture's top. The last exposure ends with the frame interval, which has `steps` physics steps.
    Without a rolling shutter there is one exposure, for all rows.

    The exposures of a rolling shutter end at equal intervals of time. A row between two of them is
    their mean, weighted by how near they are in time: something that moves by few pixels is then,
    row by row, where it was at the row's own time.
    """
    if camera.readout_ms == 0:
        whole = np.ones((camera.height, 1, 1), np.float32)
        return (Band(0, whole, _subframes(camera, steps, steps)),)
    readout = camera.readout_ms / 1e3 * camera.rate * steps
    ends = np.unique(np.rint(steps - readout * np.linspace(1, 0, camera.bands)).astype(int))
    rows = steps - readout * (1 - (np.arange(camera.height) + 0.5) / camera.height)
    found: list[Band] = []
    for i, end in enumerate(ends.tolist()):
        share = np.interp(rows, ends, np.arange(len(ends)) == i)
        within = np.flatnonzero(share)
        if not len(within):
            continue  # more bands than rows
        weights = share[within].astype(np.float32)[:, None, None]
        found.append(Band(int(within[0]), weights, _subframes(camera, steps, end)))
    return tuple(found)


def _subframes(camera: CameraConfig, steps: int, end: int) -> tuple[int, ...]:
    """Return the numbers of the physics steps at which an exposure that ends at step `end` is
    rendered.
    """
    if round(camera.exposure * steps) == 0:
        return (end,)
    before = np.linspace(0, camera.exposure * steps, SUBFRAMES)[1:]
    taken = np.clip(np.rint(end - before), 0, max(end - 1, 0))
    return tuple(sorted({int(k) for k in taken} | {end}))
