"""Runs a scenario's tracker on pictures, and converts its estimates to what a control law needs of
the target: its moments, corners, plane and pose in the camera frame (`Sight`).
"""

from dataclasses import replace
from typing import final

import numpy as np

from servo.loop.part_failures import Part, PartFailed
from servo.loop.settings import Setup
from servo.sight.estimate_to_sight import EstimateToSight
from servo.sight.size_gate import SizeGate
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
    """Runs a scenario's tracker on pictures (`start`, then `track`), and converts its estimates to
    views of the target (`sight`): moments, corners, plane and pose in the camera frame.
    """

    def __init__(
        self, scenario: Setup, camera: Camera, outline: Array, rng: np.random.Generator
    ) -> None:
        """Build the tracker, and the converter of its estimates.

        Args:
            scenario: Kind and settings of the tracker.
            camera: Intrinsics of the camera, as the robot believes them.
            outline: Corners (4, 3) of the target's reference rectangle in its frame [m].
            rng: Random generator of the tracker.

        Raises:
            PartFailed: The tracker's code raised an exception, or the tracker breaks its contract.
            Mistake: The tracker's settings refused themselves with a ValueError.
        """
        self._scenario = scenario
        self._camera = camera
        self._outline = outline
        part = Part("tracker", scenario.tracker)
        built = part.build(rng)
        self.tracker: Tracker = part.guarded(built)
        self.needs = needs_of(scenario.tracker, SEES_PICTURES)
        """The channels (kinds of data) that the tracker's settings declare; `SEES_PICTURES` if they
        declare none."""
        self._viewer = part.guarded(built) if isinstance(built, Sees) else None
        marker = marker_of(scenario.target)
        is_marker = marker is not None and marker.is_outline(outline)
        self._finder = part.guarded(built) if is_marker and isinstance(built, SeesOutline) else None

    def start(
        self,
        frame: Frame,
        region: Region,
        state: State,
        truth: Truth | None,
    ) -> Estimate:
        """Start the tracker with the target in the first picture.

        Args:
            frame: The first picture.
            region: Width and height of the target's rectangle in that picture [px].
            state: Position [px], angle [rad] and scale of the target in that picture. If the target
                is a marker and the tracker detects markers, a marker that is detected near the
                given state replaces region and state.
            truth: The true poses at that picture; None if they are not known, as outside a
                simulation.

        Returns:
            An estimate with the start state and the status LOCKED, whose flags `follows` are False
                for angle and size: the tracker has not reported yet whether it follows them.

        Raises:
            PartFailed: The tracker raised an exception.
            ValueError: The tracker refuses the region or the picture.
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
        self._gate = SizeGate(state.scale)
        self._carried = np.zeros(4)
        self._waited = 0.0
        self.has_reported = False
        """Whether `track` has returned an estimate with the status LOCKED; the first one says what
        the tracker follows."""
        self.by_corners = False
        """Whether the first estimate of `track` with the status LOCKED had corners; False before
        that estimate."""
        return self._estimate

    def track(
        self, frame: Frame, posture: Posture, interval: float, truth: Truth | None
    ) -> Estimate:
        """Return the tracker's estimate for the next picture. If the estimated size has changed by
        more than target and camera can have moved, `likely_scale` of the estimate is the scale to
        use instead. If the camera delivered no new picture (`frame.fresh` is False), return the
        previous estimate without calling the tracker.

        Args:
            frame: The picture.
            posture: Camera pose, twist and joints of the robot at the time of the picture.
            interval: Time since the previous frame [s].
            truth: The true poses at that picture; None if they are not known, as outside a
                simulation.

        Raises:
            PartFailed: The tracker raised an exception, or returned an invalid value.
        """
        # Motions over dropped frames add up until the tracker gets the next picture.
        self._carried += self._to_sight.ego(self._estimate.state, posture.twist, interval)
        self._waited += interval
        if not frame.fresh:
            return self._estimate
        ego = self._carried
        waited = self._waited
        self._carried = np.zeros(4)
        self._waited = 0.0
        self._show(frame, truth)
        is_given = self._scenario.run.ego and Channel.EGO_MOTION in self.needs
        estimate = self.tracker.update(frame, ego if is_given else None)
        self._estimate = self._gate.judged(estimate, float(ego[3]), waited)
        if not self.has_reported and self._estimate.status is Status.LOCKED:
            self.has_reported = True
            self.by_corners = self._estimate.corners is not None
        return self._estimate

    def sight(
        self, frame: Frame, estimate: Estimate, posture: Posture, goal: Sight
    ) -> Sight | None:
        """Return the target as an estimate shows it (moments and corners in normalised image
        coordinates, plane and pose in the camera frame); None if the status is not LOCKED, the
        centre is too uncertain, or the corners fit no rectangle of the target's size.

        In the view of a tracker without corners, an angle or a size that the tracker does not
        follow or states too uncertainly, and a size that is impossible, are marked as not measured;
        but a size that follows from the depth picture counts as measured.

        Args:
            frame: The picture of the estimate; only its depth picture is used, if it has one.
            estimate: The tracker's estimate.
            posture: Camera pose, twist and joints of the robot at the time of the picture.
            goal: The desired view of the target, which is stored in the result.
        """
        if estimate.likely_scale is not None:
            state = replace(estimate.state, scale=estimate.likely_scale)
            estimate = replace(estimate, state=state, follows=(estimate.follows[0], False))
        return self._to_sight.see(estimate, posture, goal, frame.depth)

    def _show(self, frame: Frame, truth: Truth | None) -> None:
        """Give the tracker the data that it declares by its channels, such as the true poses."""
        if self._viewer is not None:
            self._viewer.see(View.of(frame, self.needs, truth=truth))
