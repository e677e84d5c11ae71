"""Differences between the world of the run and that in which the picture at the goal is taken:
light, noise and clutter.
"""

from dataclasses import dataclass, replace
from typing import Annotated

from annotated_types import Ge, Le

from sim.camera.camera import Brightness, CameraConfig, Noise
from sim.ranges import Degrees, Share
from sim.surroundings import ClutterConfig, LightConfig, Number


@dataclass(frozen=True, slots=True)
class AtGoalConfig:
    """Settings of the world in which the picture at the goal is taken; by default the run's own.

    A method that compares the camera's picture with the one at the goal meets what has changed
    since: brightness and noise of the camera's pictures, the lamp, and the clutter.
    """

    camera_brightness: Brightness | None = None
    """Replaces camera.brightness."""
    camera_noise: Noise | None = None
    """Replaces camera.noise [grey levels of 255]."""
    light_strength: Share | None = None
    """Replaces light.strength."""
    light_azimuth_deg: Degrees | None = None
    """Replaces light.azimuth_deg [deg]."""
    light_elevation_deg: Annotated[float, Ge(5), Le(90)] | None = None
    """Replaces light.elevation_deg [deg]."""
    clutter_number: Number | None = None
    """Replaces clutter.number."""
    clutter_moved: bool = False
    """Whether the clutter stood at other places, drawn by the seed of the run."""

    def camera(self, own: CameraConfig) -> CameraConfig:
        """Return a copy of the run's camera settings in which those of brightness and noise that
        are set here are replaced.
        """
        return replace(own, **_given(brightness=self.camera_brightness, noise=self.camera_noise))

    def light(self, own: LightConfig) -> LightConfig:
        """Return a copy of the run's settings of the lamp in which those of strength, azimuth and
        elevation that are set here are replaced.
        """
        changes = _given(
            strength=self.light_strength,
            azimuth_deg=self.light_azimuth_deg,
            elevation_deg=self.light_elevation_deg,
        )
        return replace(own, **changes)

    def clutter(self, own: ClutterConfig) -> ClutterConfig:
        """Return the run's settings of the clutter, with the number of objects replaced if
        `clutter_number` is set. The objects' places are not changed here.
        """
        number = self.clutter_number
        return own if number is None else replace(own, number=number)


def _given(**settings: float | None) -> dict[str, float]:
    """Return the settings that have a value."""
    return {key: value for key, value in settings.items() if value is not None}
