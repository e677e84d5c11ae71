"""Settings that several trackers share; a tracker's own `Config` adds to them."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Le

from sim.ranges import Share

MOST_LEVELS = 32
"""Most colour bins a channel: their joint numbers have 16 bits."""
PLAIN: dict[str, float | str] = {"contrast": 0.0, "learn": False}
"""Settings that switch off our additions to published methods, for the presets named "paper"."""
Levels = Annotated[int, Ge(2), Le(MOST_LEVELS)]
Inset = Annotated[float, Ge(0), Le(0.49)]
Contrast = Annotated[float, Ge(0), Le(100)]
CellPoints = Annotated[int, Ge(1), Le(64)]
DiscPoints = Annotated[int, Ge(2), Le(256)]
Count = Annotated[int, Ge(1), Le(100_000)]
Sharpness = Annotated[float, Ge(1e-6), Le(1e6)]
Spread = Annotated[float, Ge(0), Le(10)]
Turn = Annotated[float, Ge(0), Le(4)]


@dataclass(frozen=True)
class ParticleSettings:
    """Settings that all particle filters share: number of particles; standard deviations of their
    motion per frame (`noise` of position as a share of the target's size, `turn_noise` [rad],
    `scale_noise` of ln scale); sharpness `gamma` of the likelihood exp(-gamma d^2); share of the
    old velocity in the new one; and how a lost target is found again: share of the particles
    redrawn over the picture (`scatter`), and number of stored small pictures of the target
    (`views`), by which it is also judged lost. Instead of both, a correlation filter and two
    templates (`witness`) can decide with the colours where the target is and whether it is lost.
    """

    particles: Count = 200
    """Number of particles."""
    gamma: Sharpness = 50.0
    """Sharpness of the likelihood exp(-gamma d^2)."""
    noise: Spread = 0.15
    """Standard deviation of position per frame, as a share of the target's size."""
    turn_noise: Turn = 0.0
    """Standard deviation of theta per frame [rad]; 0: the particles do not turn, and the angle does
    not count as followed."""
    scale_noise: Share = 0.0
    """Standard deviation of ln scale per frame; 0: the tracker does not follow the size."""
    velocity_memory: Share = 0.5
    """Share of the old velocity that the new one keeps; 1: a random walk without velocity."""
    scatter: Share = 0.7
    """Share of the particles that is drawn uniformly over the picture while the target is LOST."""
    views: Annotated[int, Ge(0), Le(16)] = 0
    """Number of small pictures of the target, the first and the newest, by which it is recognised,
    judged LOST, and found again; 0: its colours alone decide."""
    witness: bool = False
    """Let a second witness decide with the colours where the target is, and whether it is LOCKED or
    LOST: a correlation filter and two templates, which know the layout of its grey levels. Then
    `views` and `scatter` are not used."""
