"""From pictures to sights: a scenario's tracker, and what its estimates say of the target."""

from typing import final

import numpy as np

from servo.loop.part_failures import Part, PartFailed
from servo.loop.settings import Setup
from servo.sight.estimate_to_sight import EstimateToSight
from servo.types import Sight
from sim.channels import Channel, Sees, View, needs_of
from sim.marker import marker_of
from sim.types import Array, Camera, Frame, Posture, Truth
from tracking.types import (
    SEES_PICTURES,
    Estimate,
    Region,
    SeesOutline,
    State,
    Status,
    Tracker,
    unknown_covariance,
)


@final
class Perception:
    """Shows pictures to a tracker, and turns its estimates into sights."""

    def __init__(
        self, scenario: Setup, camera: Camera, outline: Array, rng: np.random.Generator
    ) -> None:
        """Build the tracker.

        Args:
            scenario: Kind and settings of the tracker.
            camera: Intrinsics, as they are believed to be.
            outline: Corners (4, 3) of the target's reference rectangle in its frame [m].
            rng: Source of the tracker's draws.

        Raises:
            PartFailed: The tracker cannot be built.
        """
        self._scenario = scenario
        self._camera = camera
        self._outline = outline
        part = Part("tracker", scenario.tracker)
        built = part.build(rng)
        self.tracker: Tracker = part.guarded(built)
        self.needs = needs_of(scenario.tracker, SEES_PICTURES)
        """The channels that the tracker declares."""
        self._viewer = part.guarded(built) if isinstance(built, Sees) else None
        marker = marker_of(scenario.target)
        is_marker = marker is not None and marker.is_outline(outline)
        self._finder = built if is_marker and isinstance(built, SeesOutline) else None

    def start(
        self,
        frame: Frame,
        region: Region,
        state: State,
        truth: Truth | None,
    ) -> Estimate:
        """Show the target to the tracker in the first picture.

        Args:
            frame: The first picture.
            region: The target's rectangle in it.
            state: Where that is. Where the target is a marker, and the tracker finds markers, the
                marker counts that is seen near it.
            truth: Where the target is; only a simulation knows it.

        Returns:
            The estimate before the first update. The tracker has not reported yet what it follows,
            so neither angle nor size count.

        Raises:
            PartFailed: The tracker raised an exception.
            ValueError: The tracker refuses the region.
        """
        if self._finder is not None:
            region, state = self._finder.outline(frame, region, state)
        self._show(frame, truth)
        try:
            self.tracker.start(frame, region, state)
        except PartFailed:
            raise
        except ValueError as error:
            raise ValueError(f"first frame: {error}") from None
        self._estimate = Estimate(
            state, unknown_covariance(), 0.0, Status.LOCKED, follows=(False, False)
        )
        s = self._scenario
        self._to_sight = EstimateToSight(
            s.sight, self._camera, region, self._outline, s.believed.depth_factor
        )
        self._carried = np.zeros(4)
        self.has_reported = False
        """Whether the tracker has said what it follows: it does when it first sees the target."""
        self.by_corners = False
        """Whether the tracker has reported corners."""
        return self._estimate

    def track(
        self, frame: Frame, posture: Posture, interval: float, truth: Truth | None
    ) -> Estimate:
        """Show the tracker the next picture, and return its estimate. The tracker does not learn of
        a picture that is not fresh: its last estimate stays.

        Args:
            frame: The picture.
            posture: What the robot knows of itself at the time of the picture.
            interval: Time since the picture before [s].
            truth: Where the target is; only a simulation knows it.
        """
        ego = None
        if self._scenario.run.ego and Channel.EGO_MOTION in self.needs:
            self._carried += self._to_sight.ego(self._estimate.state, posture.twist, interval)
            ego = self._carried
        if not frame.fresh:
            return self._estimate
        self._carried = np.zeros(4)
        self._show(frame, truth)
        self._estimate = self.tracker.update(frame, ego)
        if not self.has_reported and self._estimate.status is Status.LOCKED:
            self.has_reported = True
            self.by_corners = self._estimate.corners is not None
        return self._estimate

    def sight(
        self, frame: Frame, estimate: Estimate, posture: Posture, goal: Sight
    ) -> Sight | None:
        """Return the target as an estimate of a picture says that it is seen; None where it is
        not.
        """
        return self._to_sight.see(estimate, posture, goal, frame.depth)

    def _show(self, frame: Frame, truth: Truth | None) -> None:
        """Give the tracker its channels of a picture."""
        if self._viewer is not None:
            self._viewer.see(View.of(frame, self.needs, truth=truth))
