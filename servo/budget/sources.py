"""The sources of error in an accuracy budget: the settings of each, its usual magnitude, and the
error that linear theory expects of it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from servo.loop.settings import stream
from servo.mistake import Mistake, check_known
from servo.scenario.draws import flat
from servo.scenario.load import Scenario
from servo.scenario.toml import Table
from sim.kinds import kind_of
from sim.types import Array

TRACKER = "tracker"
RESOLUTION = "resolution"
DELAY = "delay"
SIZES = ("camera.width", "camera.height")
PIXELS = (
    *(f"{section}.{axis}" for section in ("start", "goal", "region") for axis in "xy"),
    *("camera.fx", "camera.fy", "camera.cx", "camera.cy", "believed.cx_shift", "believed.cy_shift"),
)
"""Settings in pixels, which a coarser picture divides."""
NOWHERE = (0.0, 0.0, 0.0)
AT_REST = (DELAY, "lag", "play", "mount_translation", "depth")
"""Sources that change only the camera's path to a target at rest, and not where the path ends."""


@dataclass(frozen=True, slots=True)
class Source:
    """A source of error in an accuracy budget, such as a wrong focal length: its settings with
    their ideal values ("resolution" has none), and the unit and usual value of its magnitude, which
    is `scale` times the settings' deviation from ideal. If `signed`, each seed draws its sign or
    direction; if `seen`, it acts through the tracker only.
    """

    name: str
    unit: str
    usual: float
    """Usual magnitude, in the unit."""
    ideal: Mapping[str, float | str | tuple[float, ...]] = field(default_factory=dict)
    """Values without the error, by setting."""
    scale: float = 1.0
    """Magnitude over the deviation of the settings."""
    signed: bool = False
    """Whether each seed draws a sign, or a direction where there are several numbers."""
    seen: bool = False
    """Whether it acts through the tracker only."""

    def settings(self, magnitude: float, seed: int) -> Table:
        """Return the settings, by dotted key, with which the source has a magnitude; none for the
        tracker and the resolution. For a `signed` source, the seed draws the sign, or the direction
        of several numbers.

        Args:
            magnitude: The magnitude, in the source's unit; 0: the ideal settings.
            seed: Seed of the run.
        """
        size = sum(np.size(value) for value in self.ideal.values())
        drawn = stream(seed, f"budget {self.name}").normal(size=size)
        direction = drawn / np.linalg.norm(drawn) if self.signed else np.ones(size)
        off = iter(direction * magnitude / self.scale)
        return {
            key: [v + next(off) for v in value] if isinstance(value, tuple) else value + next(off)
            for key, value in self.ideal.items()
            if not isinstance(value, str)
        }

    def own(self, scenario: Scenario) -> float:
        """Return the magnitude, without sign, that this source has in a scenario as it is, in the
        source's unit; 0 if the scenario is ideal, and for the tracker and the resolution.
        """
        if self.name == DELAY:
            run = scenario.run
            period = 1e3 / scenario.camera.rate
            tracking = 0.0 if isinstance(run.tracker_ms, str) else run.tracker_ms
            return period * run.frames_late(period / 1e3) + tracking
        settings: dict[str, Any] = flat(scenario.settings(), scenario.name)
        off: list[Array] = [
            np.ravel(settings.get(key, ideal)) - np.ravel(ideal)
            for key, ideal in self.ideal.items()
            if not isinstance(ideal, str)
        ]
        order = None if self.signed else np.inf
        return self.scale * float(np.linalg.norm(np.concatenate([*off, [0.0]]), order))


SOURCES = (
    Source(TRACKER, "", 1.0, {"tracker.kind": "truth"}),
    Source("noise", "grey levels", 3.0, {"camera.noise": 0.0}, seen=True),
    Source(RESOLUTION, "times coarser", 2.0, seen=True),
    Source(DELAY, "ms", 33.0, {"run.latency_ms": 0.0}),
    Source("lag", "ms", 30.0, {"robot.lag_ms": 0.0}),
    Source("play", "mm, mrad", 1.0, {"robot.backlash": 0.0}, 1e3),
    Source("encoder_step", "mm, mrad", 0.1, {"robot.encoder_step": 0.0}, 1e3),
    Source("focal_length", "%", 1.0, {"believed.fx_factor": 1.0}, 100.0, signed=True),
    Source(
        "principal_point",
        "px",
        3.0,
        {"believed.cx_shift": 0.0, "believed.cy_shift": 0.0},
        signed=True,
    ),
    Source("mount_rotation", "deg", 0.5, {"believed.hand_eye_rotation_deg": NOWHERE}, signed=True),
    Source("mount_translation", "mm", 3.0, {"believed.hand_eye_mm": NOWHERE}, signed=True),
    Source("depth", "%", 10.0, {"believed.depth_factor": 1.0}, 100.0, signed=True),
    Source("target_size", "%", 1.0, {"believed.size_factor": 1.0}, 100.0, signed=True),
)
"""All sources; the usual magnitudes are those of a careful calibration of an industrial robot."""


def magnitudes_of(texts: Sequence[str]) -> dict[str, float]:
    """Return the magnitudes, by name of the source, in texts such as "focal_length=0.5".

    Raises:
        Mistake: A text has another form, there is no such source, the source is the tracker, or a
            magnitude is below 0 (below 1 for the resolution) or not finite.
    """
    found = dict[str, float]()
    names = [source.name for source in SOURCES if source.name != TRACKER]
    for text in texts:
        name, _, number = text.partition("=")
        check_known([name], names, f"--magnitude {text}", "source of error")
        try:
            found[name] = float(number)
        except ValueError:
            found[name] = np.nan
        least = 1.0 if name == RESOLUTION else 0.0
        if not least <= found[name] < np.inf:
            unit = next(source.unit for source in SOURCES if source.name == name)
            raise Mistake(
                f"--magnitude {text}: write {name}=NUMBER, with a number of at least {least:g} "
                f"[{unit}]"
            )
    return found


def coarser(scenario: Scenario, factor: float) -> Table:
    """Return the changed settings, by dotted key, with which the camera's picture has fewer pixels
    for the same view: width and height are rounded, and settings in pixels are divided.

    Args:
        scenario: The scenario with the drawn settings of its seed.
        factor: Width over the new width.
    """
    settings: dict[str, Any] = flat(scenario.settings(), scenario.name)
    found: Table = {key: settings[key] / factor for key in PIXELS if settings[key]}
    return found | {key: max(1, round(settings[key] / factor)) for key in SIZES}


def theory(source: Source, magnitude: float, scenario: Scenario, focal: float) -> float | None:
    """Return the error of the position at the end that linear theory expects of a source [mm]. None
    for sources without a theory, and for scenarios with a leader (a second tag).

    At the distance Z of the goal it is Z dc for a focal length or a target size that is wrong by
    the share dc, and Z d / f for a principal point that is off by d px. It is 0 where the source
    has no influence: for both if a depth picture gives the distance, for a focal length if the true
    camera has seen the goal (believed.goal = "shown"), for a principal point unless the
    goal is a pose (believed.goal = "pose"), and for what only bends the path (delay, lag, play,
    depth, mount_translation) to a target at rest.

    Args:
        source: The source.
        magnitude: Its magnitude, in its unit.
        scenario: The scenario.
        focal: Focal length of the camera, f [px].
    """
    goal = scenario.goal
    away = 1e3 * magnitude * (goal.depth if goal.depth_to is None else goal.depth_to)
    known = scenario.believed.goal
    is_still = kind_of(scenario.motion) == "still"
    found: dict[str, float] = {name: 0.0 for name in AT_REST if is_still}
    is_measured = scenario.sight.depth == "picture"
    found["focal_length"] = 0.0 if known == "shown" or is_measured else away / 100
    found["target_size"] = 0.0 if is_measured else away / 100
    found["principal_point"] = away / focal if known == "pose" else 0.0
    return found.get(source.name) if scenario.leader.id is None else None
