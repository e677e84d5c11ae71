"""Painted sequence: texture, in which a textured car on a road of the same colour changes its size
and its speed.

It tests the claim of the PFJCTH paper that texture separates such a target from the background, and
colour alone does not. The car, 56 x 32 px, follows a smooth curve with changing speed; its size
grows and shrinks as if its distance changed.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from sim.kinds import kind_of
from sim.types import Array, Image
from tracking.sequences.painted._painting import HEIGHT, WIDTH, blotches, noisy, paste
from tracking.sequences.sequence import Sequence
from tracking.types import Region, State

REGION = Region(56.0, 32.0)
SIZE = (round(REGION.width), round(REGION.height))
ROAD = 24.0
"""Size of the road's blotches [px]: a smooth texture."""
SHADE = 14.0
"""Standard deviation of the road's colours [grey levels]: a weak texture."""
GRAIN = 1.4
"""Size of the car's blotches [px]: a fine texture."""
RELIEF = 34.0
"""Standard deviation of the car's colours [grey levels]: a strong texture."""


@dataclass(frozen=True, slots=True)
class Config:
    """Settings of a painted sequence of a textured car: how many pictures there are, the car's
    largest scale, its largest speed [px per frame], and the noise of the pictures.
    """

    frames: Annotated[int, Ge(20), Le(100_000)] = 160
    """Number of pictures."""
    zoom: Annotated[float, Ge(1), Le(3)] = 1.6
    """Largest scale of the car; its smallest scale is the inverse."""
    speed: Annotated[float, Ge(0), Le(50)] = 6.0
    """Largest speed [px per frame], as if the ellipse that the car follows were a circle of its
    mean radius; on the ellipse the speed is up to 22 % higher or lower. The speed rises and falls,
    down to a standstill."""
    noise: Annotated[float, Ge(0), Le(100)] = 2.0
    """Standard deviation of the noise of the pictures [grey levels]."""

    def build(self, rng: np.random.Generator) -> Sequence:
        """Return a new sequence of painted pictures with the target's exact states, whose random
        numbers come from `rng`.
        """
        ground, patch = self._paint(rng)
        states = self._states(rng)
        noise_seed = int(rng.integers(1 << 31))

        def paint(index: int) -> Image:
            image = paste(ground, patch, REGION, State(*states[index].tolist()))
            return noisy(image, self.noise, noise_seed, index)

        return Sequence.painted(kind_of(self), paint, REGION, states)

    def _paint(self, rng: np.random.Generator) -> tuple[Image, Image]:
        """Return pictures of the ground (HEIGHT, WIDTH, 3) and of the car (h, w, 3)."""
        colour = rng.uniform(80, 170, 3)
        ground = blotches(rng, WIDTH, HEIGHT, ROAD, colour, SHADE)
        return ground, blotches(rng, *SIZE, GRAIN, colour, RELIEF)

    def _states(self, rng: np.random.Generator) -> Array:
        """Return the car's states (n, 4), x, y [px], theta [rad], scale, along an ellipse, with a
        speed that rises and falls.
        """
        time = np.arange(self.frames)
        pace = self.speed * np.sin(np.pi * time / self.frames * rng.uniform(3, 5)) ** 2
        radius = np.array([0.28 * WIDTH, 0.24 * HEIGHT])
        around = np.cumsum(pace) / radius.mean() + rng.uniform(0, 2 * np.pi)
        turn = rng.choice([-1.0, 1.0])
        x = WIDTH / 2 + radius[0] * np.cos(around)
        y = HEIGHT / 2 + turn * radius[1] * np.sin(around)
        wave = np.sin(2 * np.pi * time / self.frames * rng.uniform(1.2, 2.2) + rng.uniform(0, 6))
        size = np.log(self.zoom) * (wave - wave[0]) / max(np.abs(wave - wave[0]).max(), 1.0)
        return np.column_stack([x, y, np.zeros(self.frames), np.exp(size)])
