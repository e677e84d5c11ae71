"""The sources of error in an accuracy budget: the settings of each, and its usual magnitude."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from servo.loop.settings import stream
from servo.mistake import Mistake, check_known
from servo.scenario.load import Scenario
from servo.scenario.toml import Table, drop, is_number, is_table
from servo.study.scenario_run import StudiedScenario
from sim.types import Array

TRACKER = "tracker"
RESOLUTION = "resolution"
DELAY = "delay"
PIXELS = (
    *(f"{section}.{axis}" for section in ("start", "goal", "region") for axis in "xy"),
    *(f"camera.{name}" for name in ("fx", "fy", "cx", "cy", "width", "height")),
)
"""Settings in pixels, which a coarser picture divides."""
EARLIER = 1e-6
"""The delay of whole frames is made shorter by this, so that it is not rounded up [ms]."""


@dataclass(frozen=True, slots=True)
class Source:
    """A source of error: settings whose deviation from their ideal values is its magnitude."""

    name: str
    words: str
    """Name in a sentence."""
    unit: str
    usual: float
    """Usual magnitude, in the unit."""
    ideal: Mapping[str, float | tuple[float, ...]] = field(default_factory=dict)
    """Values without the error, by setting; the first of them carry it."""
    scale: float = 1.0
    """Magnitude over the deviation of the settings."""
    signed: bool = False
    """Whether each seed draws a sign, or a direction if there are several numbers."""
    seen: bool = False
    """Whether it acts through the tracker only."""

    def settings(self, magnitude: float, seed: int) -> Table:
        """Return the settings of the source at a magnitude; the same seed draws the same sign."""
        ideal = {key: np.atleast_1d(value) for key, value in self.ideal.items()}
        size = sum(map(len, ideal.values()))
        direction: Array = np.ones(size)
        if self.signed:
            direction = stream(seed, f"budget {self.name}").normal(size=size)
            direction /= np.linalg.norm(direction)
        moved = np.split(direction * magnitude / self.scale, np.cumsum([*map(len, ideal.values())]))
        found = dict(zip(ideal, moved, strict=False))
        return {
            key: (ideal[key] + found[key]).tolist()
            if is_many(value)
            else float(value + found[key][0])
            for key, value in self.ideal.items()
        }

    def own(self, scenario: Scenario) -> float:
        """Return the magnitude that a scenario has by itself, in the unit; 0 if it is ideal."""
        if self.name == DELAY:
            run = scenario.run
            computing = 0.0 if isinstance(run.tracker_ms, str) else run.tracker_ms
            return (
                1e3 * run.frames_late(1 / scenario.camera.rate) / scenario.camera.rate + computing
            )
        settings = scenario.settings()
        found = [value_of(settings, key) - np.asarray(ideal) for key, ideal in self.ideal.items()]
        off = np.concatenate([np.ravel(each) for each in found] or [np.zeros(1)])
        size = np.linalg.norm(off) if self.signed else np.abs(off).max()
        return float(self.scale * size)


def is_many(value: object) -> bool:
    """Return whether a value is a tuple of numbers."""
    return isinstance(value, tuple)


NOWHERE = (0.0, 0.0, 0.0)
SOURCES = (
    Source(TRACKER, "the tracker", "", 1.0),
    Source("noise", "the pixels' noise", "grey levels", 3.0, {"camera.noise": 0.0}, seen=True),
    Source(RESOLUTION, "the resolution", "times coarser", 2.0, seen=True),
    Source(DELAY, "the delay", "ms", 33.0, {"run.latency_ms": 0.0}),
    Source("lag", "the drives' lag", "ms", 30.0, {"robot.lag_ms": 0.0}),
    Source("play", "the play", "mm, mrad", 1.0, {"robot.backlash": 0.0}, 1e3),
    Source("encoder", "the encoders' steps", "mm, mrad", 0.1, {"robot.encoder_step": 0.0}, 1e3),
    Source("focal", "the focal length", "%", 1.0, {"believed.fx_factor": 1.0}, 100.0, signed=True),
    Source(
        "principal",
        "the principal point",
        "px",
        3.0,
        {"believed.cx_shift": 0.0, "believed.cy_shift": 0.0},
        signed=True,
    ),
    Source(
        "mount_rotation",
        "the mount's rotation",
        "deg",
        0.5,
        {"believed.hand_eye_rotation_deg": NOWHERE},
        signed=True,
    ),
    Source(
        "mount_translation",
        "the mount's translation",
        "mm",
        3.0,
        {"believed.hand_eye_mm": NOWHERE},
        signed=True,
    ),
    Source("depth", "the depth", "%", 10.0, {"believed.depth_factor": 1.0}, 100.0, signed=True),
    Source(
        "size", "the target's size", "%", 1.0, {"believed.size_factor": 1.0}, 100.0, signed=True
    ),
)
"""All sources; the usual magnitudes are those of a careful calibration of an industrial robot."""


def magnitudes_of(texts: Sequence[str]) -> dict[str, float]:
    """Return the magnitudes in texts such as "focal=0.5", by source.

    Raises:
        Mistake: A text has another form, there is no such source, or a magnitude is below 0.
    """
    found = dict[str, float]()
    names = [source.name for source in SOURCES if source.name != TRACKER]
    for text in texts:
        at = f"--magnitude {text}"
        name, _, number = text.partition("=")
        check_known([name], names, at, "source of error")
        try:
            value = float(number)
        except ValueError:
            value = np.nan
        least = 1.0 if name == RESOLUTION else 0.0
        if not is_number(value) or value < least or name in found:
            raise Mistake(f"{at}: write each source once, with a number of at least {least:g}")
        found[name] = value
    return found


def value_of(settings: Table, key: str) -> np.ndarray:
    """Return the numbers of a setting of a scenario; zeros where it is not set."""
    section, _, name = key.partition(".")
    part = settings[section]
    value = part.get(name) if is_table(part) else None
    return np.asarray(0.0 if value is None else value, dtype=float)


def in_ms(base: StudiedScenario, scenario: Scenario) -> StudiedScenario:
    """Return a scenario whose delay is a time, if its file or its changes give it in frames."""
    run = base.table.get("run")
    key = "run.latency"
    if key not in base.changes and not (is_table(run) and "latency" in run):
        return base
    late = max(0.0, 1e3 * scenario.run.latency / scenario.camera.rate - EARLIER)
    changes = {name: value for name, value in base.changes.items() if name != key}
    table = {name: dict(part) if is_table(part) else part for name, part in base.table.items()}
    drop(table, key)
    return replace(base, table=table, changes=changes | {"run.latency_ms": late})


def coarser(scenario: Scenario, factor: float) -> Table:
    """Return the settings with which the picture of a scenario has fewer pixels for the same view.

    Args:
        scenario: The scenario with the drawn settings of its seed.
        factor: Width over the new width.
    """
    settings = scenario.settings()
    found: Table = {}
    for key in PIXELS:
        value = float(value_of(settings, key))
        if value:
            whole = key in ("camera.width", "camera.height")
            found[key] = max(1, round(value / factor)) if whole else value / factor
    return found
