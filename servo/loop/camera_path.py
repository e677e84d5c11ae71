"""The way of the camera as the target sees it: how long, how far back, and how near the goal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from servo.loop.step import Step
from sim.geometry import angle_of

MEANINGS = {
    "camera_path_m": ("m", "way of the camera, seen from the target"),
    "detour_m": ("m", "this way, less the straight line from start to goal"),
    "retreat_m": ("m", "how much farther from the target the camera was than at start and goal"),
    "advance_m": ("m", "how much nearer to the target the camera was than at start and goal"),
    "out_of_view_pct": ("%", "frames in which a corner of the target was outside the picture"),
    "end_position_mm": ("mm", "camera against its goal, seen from the target, at the end"),
    "end_rotation_deg": ("deg", "camera's orientation against the goal's, at the end"),
}
"""Unit and meaning of each measure."""


def path_measures(steps: Sequence[Step]) -> dict[str, float]:
    """Return the measures of a run's steps, by the names of `MEANINGS`."""
    cameras = [s.T_object_camera for s in steps]
    goal = steps[-1].goal_sight.pose.inverse()
    places = np.array([c.translation for c in cameras])
    there = goal.translation
    path = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
    away = np.linalg.norm(places, axis=1)
    ends = [np.linalg.norm(places[0]), np.linalg.norm(there)]
    turn = goal.rotation.T @ cameras[-1].rotation
    return {
        "camera_path_m": path,
        "detour_m": path - float(np.linalg.norm(places[0] - there)),
        "retreat_m": max(0.0, float(away.max() - max(ends))),
        "advance_m": max(0.0, float(min(ends) - away.min())),
        "out_of_view_pct": 100 * float(np.mean([_leaves(s) for s in steps])),
        "end_position_mm": 1e3 * float(np.linalg.norm(places[-1] - there)),
        "end_rotation_deg": float(np.degrees(angle_of(turn))),
    }


def _leaves(step: Step) -> bool:
    camera = step.scene.camera
    corners = step.truth.corners
    return bool(((corners < 0) | (corners > (camera.width, camera.height))).any())
