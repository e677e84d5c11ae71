"""Tracker of the true state with chosen noise and dropouts: an ideal tracker, which reads no
picture.

It needs a simulation. Other trackers are compared with it, and studies of control laws use it to
leave tracking errors out. Its delay is set by `run.tracker_ms`, as that of any tracker.
"""

from dataclasses import dataclass
from typing import Annotated, final

import numpy as np
from annotated_types import Ge, Le

from sim.channels import Channel, View
from sim.types import Array, Frame, Truth
from tracking.types import Estimate, Region, State, Status, Trait, Traits, goes_around

NO_TRUTH = (
    "the tracker 'truth' needs the true pose of the target, which only a simulation provides: "
    "choose another tracker"
)


@dataclass(frozen=True, slots=True)
class Config:
    """Settings of an ideal tracker: standard deviations of the errors of the centre and of corners
    [px], the angle [deg] and the size [%], all normally distributed (that of the size in ln scale)
    and independent from picture to picture; the share of pictures in which the target is reported
    as not seen; and whether corners are reported.
    """

    noise: Annotated[float, Ge(0), Le(100)] = 0.0
    """Standard deviation of each coordinate of the centre, and of each corner [px]."""
    angle_noise_deg: Annotated[float, Ge(0), Le(90)] = 0.0
    """Standard deviation of the angle [deg]."""
    scale_noise_pct: Annotated[float, Ge(0), Le(50)] = 0.0
    """Standard deviation of the size [%]."""
    dropouts: Annotated[float, Ge(0), Le(1)] = 0.0
    """Share of the pictures in which the target is reported as not seen."""
    corners: bool = False
    """Report the four corners, as `tag` does, and not centre, angle and size alone."""
    needs = frozenset({Channel.TRUTH, Channel.EGO_MOTION})

    @property
    def traits(self) -> Traits:
        """Set of the tracker's properties (`Trait`): CORNERS if it reports corners, otherwise
        empty.
        """
        return frozenset({Trait.CORNERS}) if self.corners else frozenset()

    def build(self, rng: np.random.Generator) -> "TruthTracker":
        """Return a new tracker with these settings, which draws errors and dropouts from `rng`."""
        return TruthTracker(self, rng)


@final
class TruthTracker:
    """An ideal tracker for simulations: it reports the true state, which the simulation passes to
    `see`, with noise and dropouts drawn from `rng`; LOST where the target's centre is outside the
    picture, or behind the camera.
    """

    def __init__(self, config: Config, rng: np.random.Generator) -> None:
        self._config = config
        self._rng = rng
        self._truth: Truth | None = None

    def see(self, view: View) -> None:
        """Store the target's true state in the next frame (`view.truth`), for the next call of
        `start` or `update`; None outside a simulation.
        """
        self._truth = view.truth

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Store the target's true size in the first frame, which counts as scale 1 from then on,
        and `state`, which is reported until the target is seen. Frame and region are not used.

        Raises:
            ValueError: `see` was not given a true state, as outside a simulation.
        """
        if self._truth is None:
            raise ValueError(NO_TRUTH)
        self._first_size = self._truth.size
        self._state = state

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Return the true state with drawn errors, LOCKED, and with the covariance of these errors.
        In a dropout, or if the corners with noise are no convex outline (UNSURE), or with the
        target's centre outside the picture or behind the camera (LOST), return the last state,
        moved by `ego` if it is given, with a covariance of nan.

        Args:
            frame: The next frame; only its size is used.
            ego: Change (4,) of x, y [px], theta [rad] and ln scale since the last frame that the
                camera's own motion causes; None if it is unknown.

        Raises:
            ValueError: `see` was not given a true state, as outside a simulation.
        """
        if self._truth is None:
            raise ValueError(NO_TRUTH)
        c = self._config
        truth = self._truth
        # All errors are drawn in each frame, used or not: settings do not shift later draws.
        errors = self._rng.normal(size=(6, 2))
        size = frame.image.shape[1::-1]
        inside = truth.depth > 0 and bool(((truth.centre >= 0) & (truth.centre <= size)).all())
        dropped = self._rng.uniform() < c.dropouts
        corners = truth.corners + c.noise * errors[2:] if c.corners else None
        if corners is not None and not goes_around(corners):
            # A corner is behind the camera, or the noise is larger than the target.
            dropped = True
        if not inside or dropped:
            self._state = self._state.moved(ego)
            status = Status.UNSURE if inside else Status.LOST
            return Estimate(self._state, np.full((4, 4), np.nan), 1.0, status)
        turn = np.radians(c.angle_noise_deg)
        growth = c.scale_noise_pct / 100
        x, y = truth.centre + c.noise * errors[0]
        self._state = State(
            float(x),
            float(y),
            truth.theta + turn * float(errors[1, 0]),
            truth.size / self._first_size * float(np.exp(growth * errors[1, 1])),
        )
        return Estimate(
            self._state,
            np.diag([c.noise, c.noise, turn, growth]) ** 2,
            0.0,
            Status.LOCKED,
            corners=corners,
        )
