"""Measures of a run (numbers that say how well it went, such as an rms error): one `Measure` record
for each, with its name, unit and meaning.
"""

from dataclasses import dataclass

from servo.types import DOF


@dataclass(frozen=True, slots=True)
class Measure:
    """Name, unit and meaning of one number that says how well a run went (smaller is better). The
    flags say which frames count, which values are possible, and where the number is shown.
    """

    name: str
    unit: str
    meaning: str
    """What is measured, in a few words."""
    counted: bool = False
    """Whether only the steps from measure.after on count; the value is nan if the run ends before
    that time."""
    share: bool = False
    """Whether it is a share of the frames [%]."""
    exact: bool = False
    """Whether a good run gives exactly 0, without a rounding error, although it is not a share."""
    signed: bool = False
    """Whether it may be below 0."""
    of_joints: bool = False
    """Whether it is about joints with limits, which the free camera does not have."""
    brief: bool = False
    """Whether the short table of a notebook shows it."""
    timed: bool = False
    """Whether it is a wall-clock time, which differs when a run is repeated."""

    def __str__(self) -> str:
        return f"{self.meaning} [{self.unit}]"


MEASURES = {
    measure.name: measure
    for measure in (
        Measure(
            "servo_rms_px", "px", "true centre against the goal, rms", counted=True, brief=True
        ),
        Measure(
            "servo_peak_px", "px", "true centre against the goal, largest", counted=True, brief=True
        ),
        Measure(
            "servo_angle_rms_deg",
            "deg",
            "true angle against the goal, rms",
            counted=True,
            brief=True,
        ),
        Measure(
            "servo_angle_peak_deg", "deg", "true angle against the goal, largest", counted=True
        ),
        Measure(
            "servo_scale_rms_pct", "%", "true size against the goal, rms", counted=True, brief=True
        ),
        Measure("servo_scale_peak_pct", "%", "true size against the goal, largest", counted=True),
        Measure(
            "not_held_pct",
            "%",
            "time in which the true centre is over 10 px from the goal",
            counted=True,
            share=True,
        ),
        Measure(
            "settle_s",
            "s",
            "until the true error stays below 2 px, 1 deg and 2 %",
            exact=True,
            brief=True,
        ),
        Measure(
            "longest_off_s",
            "s",
            "longest time off the target (above measure.above)",
            counted=True,
            exact=True,
        ),
        Measure(
            "tracking_rms_px", "px", "estimated against true centre, rms", counted=True, brief=True
        ),
        Measure(
            "tracking_peak_px",
            "px",
            "estimated against true centre, largest",
            counted=True,
            brief=True,
        ),
        Measure(
            "tracking_angle_rms_deg",
            "deg",
            "estimated against true angle, rms",
            counted=True,
            brief=True,
        ),
        Measure(
            "tracking_scale_rms_pct",
            "%",
            "estimated against true size, rms",
            counted=True,
            brief=True,
        ),
        Measure(
            "tilt_peak_deg", "deg", "optical axis against straight down, largest", counted=True
        ),
        Measure(
            "joint_range_peak_pct",
            "%",
            "largest distance of a limited joint from mid-range, of half its range; 100: limit",
            counted=True,
            of_joints=True,
        ),
        Measure("camera_path_m", "m", "path length of the camera, seen from the target"),
        Measure(
            "camera_turn_deg", "deg", "turns of the camera, seen from the target, sum of all frames"
        ),
        Measure(
            "detour_m",
            "m",
            "camera_path_m, less the straight line from its start to its end",
            signed=True,
        ),
        Measure(
            "retreat_m",
            "m",
            "how much farther from the target the camera was than at start and goal",
        ),
        Measure(
            "advance_m", "m", "how much nearer to the target the camera was than at start and goal"
        ),
        Measure(
            "out_of_view_pct",
            "%",
            "frames in which a corner of the target was outside the picture",
            share=True,
        ),
        Measure(
            "excursion_px",
            "px",
            "corner of the target from the middle of the picture, largest distance",
        ),
        Measure(
            "end_position_mm", "mm", "camera against its goal, seen from the target, at the end"
        ),
        Measure("end_rotation_deg", "deg", "camera's orientation against the goal's, at the end"),
        Measure("end_speed_mm_s", "mm/s", "speed of the camera in the last second, rms"),
        Measure(
            "effort_rms_mm_s",
            "mm/s",
            "commanded velocity, change from one command to the next, rms",
            counted=True,
            brief=True,
        ),
        Measure(
            "effort_rms_deg_s",
            "deg/s",
            "commanded turn rate, change from one command to the next, rms",
            counted=True,
            brief=True,
        ),
        Measure(
            "acceleration_peak_m_s2",
            "m/s2",
            "acceleration of the camera, mean over a frame, largest",
            counted=True,
        ),
        Measure(
            "joint_way_pct",
            "%",
            "travel of the joints with limits over their ranges, mean of these joints",
            exact=True,
            of_joints=True,
        ),
        Measure("saturated_pct", "%", "frames in which a limit slowed the camera", share=True),
        Measure(
            "unseen_pct",
            "%",
            "frames in which the tracker did not see the target, or that were dropped",
            share=True,
        ),
        Measure("lost_pct", "%", "frames in which the tracker reported LOST", share=True),
        Measure(
            "age_ms", "ms", "from a picture to its estimate, mean over the estimates", exact=True
        ),
        Measure("skipped_pct", "%", "pictures that the tracker had no time for", share=True),
        Measure(
            "step_ms",
            "ms",
            "wall-clock time of a step in which the tracker worked, median",
            brief=True,
            timed=True,
        ),
    )
}
"""All measures of a run's steps, by name. Those whose names begin with "tracking" use only steps
with `Step.decided`, so that an estimate counts once however long a slow tracker lets it stand.
Those that are not `counted` do not depend on measure.after.
"""
COUNTED = tuple(name for name, measure in MEASURES.items() if measure.counted)
"""The measures that count from measure.after on."""
TIMED = "step_ms"
"""The wall-clock time of a step."""
OF_POSE = ("end_position_mm", "end_rotation_deg", "retreat_m")
"""The measures of the camera's pose, which the picture alone does not show."""


def pose_measures(features: int) -> tuple[str, ...]:
    """Return the names of the measures of the camera's pose that are shown among the first ones of
    a run: `OF_POSE` if the number of its features is at least 6, which determine the pose; else
    none.
    """
    return OF_POSE if features >= len(DOF) else ()
