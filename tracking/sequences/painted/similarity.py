"""Painted sequence: similarity, in which a textured rectangle moves, turns, scales, blurs and is
hidden, over clutter.

It tests the claims of the multi-kernel paper (figures 6 and 7): x, y, theta and scale are known
exactly. The rectangle, 60 x 40 px with three by three coloured fields, follows smooth curves, with
motion blur. In the middle of the sequence its speed doubles; later a bar hides it completely. With
the setting `away` it leaves the picture for a while.
"""

from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from annotated_types import Ge, Le

from sim.types import Array, Image
from tracking.sequences.painted._painting import HEIGHT, WIDTH, blotches, noisy, paste
from tracking.sequences.sequence import Sequence
from tracking.types import Region, State

REGION = Region(60.0, 40.0)
FIELDS = (3, 3)
"""Number of coloured fields of the target along each side."""
PATCHES = 60
"""Number of rectangles on the ground."""
EXPOSURES = 5
"""Number of pictures that are averaged into a blurred one."""
SHUTTER = 0.5
"""Share of the frame's duration in which the shutter is open."""
FAST = (0.35, 0.6)
"""Begin and end of the part in which the target is fast, as shares of the sequence."""
HIDDEN_AT = 0.75
"""Middle of the part in which the bar covers the target, as a share of the sequence."""
BAR = (90, 90, 90)
"""Colour of the bar (RGB)."""
AWAY_AT = 0.3
"""Begin of the part in which the target is out of the picture, as a share of the sequence."""
GOING = 6
"""Number of frames in which the target leaves the picture, and in which it comes back."""


@dataclass(frozen=True, slots=True)
class Config:
    """Settings of a painted sequence whose target moves, turns and changes its size: how many
    pictures there are, in how many of them the target is hidden or outside, how far it turns [deg],
    its largest scale, and the noise of the pictures.
    """

    frames: Annotated[int, Ge(20), Le(100_000)] = 200
    """Number of pictures."""
    turn_deg: Annotated[float, Ge(0), Le(720)] = 70.0
    """Largest rotation from the start [deg]."""
    zoom: Annotated[float, Ge(1), Le(3)] = 1.4
    """Largest scale of the target; its smallest scale is the inverse."""
    hidden: Annotated[int, Ge(0), Le(100)] = 11
    """Number of frames in which the target is fully hidden."""
    away: Annotated[int, Ge(0), Le(100_000)] = 0
    """Number of frames in which the target is out of the picture, without those in which it leaves
    and comes back; 0: it never leaves."""
    noise: Annotated[float, Ge(0), Le(100)] = 3.0
    """Standard deviation of the noise of the pictures [grey levels]."""

    def build(self, rng: np.random.Generator) -> Sequence:
        """Return a new sequence of painted pictures with the target's exact states, whose random
        numbers come from `rng`. Its true corners are nan where the target is out of the picture.
        """
        ground = _ground(rng)
        patch = _target(rng)
        fine = self._states(rng)
        noise_seed = int(rng.integers(1 << 31))
        hidden_from = int(HIDDEN_AT * self.frames) - self.hidden // 2

        def paint(index: int) -> Image:
            exposed = fine[index * EXPOSURES : index * EXPOSURES + EXPOSURES]
            pictures = [paste(ground, patch, REGION, State(*row)) for row in exposed.tolist()]
            image = np.mean(pictures, axis=0)
            if hidden_from <= index < hidden_from + self.hidden:
                _hide(image, exposed[0])
            return noisy(image, self.noise, noise_seed, index)

        middle = fine.reshape(self.frames, EXPOSURES, 4).mean(axis=1)
        sequence = Sequence.painted("similarity", paint, REGION, middle)
        sequence.truth[sequence.truth[..., 0].min(axis=1) >= WIDTH] = np.nan
        return sequence

    def _states(self, rng: np.random.Generator) -> Array:
        """Return the target's states (frames * EXPOSURES, 4), x, y [px], theta [rad], scale, in all
        exposures; the first exposure of a frame is at the frame's time.
        """
        frame = np.repeat(np.arange(self.frames), EXPOSURES)
        phase = np.tile(np.arange(EXPOSURES), self.frames) * SHUTTER / EXPOSURES
        at = (frame + phase) / self.frames
        # In the fast part, time advances twice as fast.
        warped = at + np.clip(at - FAST[0], 0, FAST[1] - FAST[0])
        begin = rng.uniform(0, 2 * np.pi, 4)
        cycles = rng.uniform((1.5, 1.5, 1.0, 1.0), (2.5, 2.5, 2.0, 2.0))
        wave = np.sin(2 * np.pi * cycles * warped[:, None] + begin)
        x = WIDTH / 2 + 0.28 * WIDTH * wave[:, 0]
        if self.away:
            since = self.frames * (at - AWAY_AT)
            gone = np.minimum(since / GOING + 1, (self.away - since) / GOING + 1).clip(0, 1)
            x = x + WIDTH * gone
        y = HEIGHT / 2 + 0.25 * HEIGHT * wave[:, 1]
        theta = np.radians(self.turn_deg) * (wave[:, 2] - wave[0, 2]) / 2
        size = np.log(self.zoom) * (wave[:, 3] - wave[0, 3]) / 2
        return np.column_stack([x, y, theta, np.exp(size)])


def _ground(rng: np.random.Generator) -> Image:
    """Return a background (HEIGHT, WIDTH, 3) of blotches with random rectangles."""
    image = blotches(rng, WIDTH, HEIGHT, 6.0, np.full(3, 128.0), 30.0)
    for _ in range(PATCHES):
        size = rng.uniform(8, 40, 2)
        box = (tuple(rng.uniform((0, 0), (WIDTH, HEIGHT))), tuple(size), rng.uniform(0, 90))
        colour = rng.integers(20, 236, 3).tolist()
        corners = np.round(cv2.boxPoints(box)).astype(np.int32)
        cv2.fillConvexPoly(image, corners, colour, cv2.LINE_AA)
    return image


def _target(rng: np.random.Generator) -> Image:
    """Return a picture (h, w, 3) of the target at twice its size."""
    fields = rng.integers(20, 236, (*FIELDS, 3)).astype(np.uint8)
    size = (round(2 * REGION.width), round(2 * REGION.height))
    plain = cv2.resize(fields, size, interpolation=cv2.INTER_NEAREST)
    return blotches(rng, *size, 3.0, plain.astype(float), 12.0)


def _hide(image: Array, state: Array) -> None:
    """Paint an upright bar over the target, whose state is (4,), into an image (H, W, 3)."""
    x = state[0]
    reach = float(np.hypot(REGION.width, REGION.height)) / 2 * state[3] + 2
    image[:, max(int(x - reach), 0) : int(x + reach) + 1] = BAR
