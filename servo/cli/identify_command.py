"""`servobench identify`: from the log of a robot to the settings that simulate it."""

from pathlib import Path

from rich.console import Console

from servo.cli.terminal import plain
from servo.identify.fit import Identified, identify
from servo.identify.lines import lines, picture
from servo.identify.log import Channel, Log, read
from servo.loop.episode import Episode
from servo.mistake import writing
from servo.output.run_folder import prepare
from servo.scenario.load import load
from servo.types import DOF
from sim.types import Array
from sim.world import World
from tracking.drawing.figures import save
from tracking.files import atomic

LINES = "robot.toml"
PICTURE = "response.png"
SHOWN = 6
"""Most unused columns that are named."""


def run(path: Path, scenario: str, out: Path | None) -> int:
    """Identify the robot of a log; write its settings for a scenario's robot, and a picture.

    Raises:
        Mistake: The log or the scenario cannot be used, or the folder not be written.
    """
    log = read(path)
    found, text = estimated(log, scenario)
    folder = prepare(out, f"identify-{path.stem}")
    with writing(folder):
        files = [atomic.write(folder, LINES, text), save(picture(log, found), folder, PICTURE)]
    console = Console()
    for each in (text, *files):
        plain(console, str(each))
    if log.unused:
        more = f" and {len(log.unused) - SHOWN} more" if len(log.unused) > SHOWN else ""
        names = ", ".join(log.unused[:SHOWN])
        plain(console, f"columns without a meaning here, or without numbers: {names}{more}")
    return 0


def estimated(log: Log, scenario: str) -> tuple[Identified, str]:
    """Return what a log shows, and the lines that make a scenario's robot like that one."""
    with Episode(load(scenario), seen=False) as episode:
        world = episode.world
        servos = [_servo(world, channel) for channel in log.channels]
        tick = float(world.ticks[1]) if len(world.ticks) > 1 else world.period
        joints = world.robot.names
    found = identify(log, servos)
    return found, lines(found, joints, tick)


def _servo(world: World, channel: Channel) -> float:
    """Time constant of the simulated drive's own servo [s]; of a part of the twist that of the
    joints that move it.
    """
    each = world.robot.servos()
    if channel.name in world.robot.names:
        return float(each[world.robot.names.index(channel.name)])
    if channel.name in DOF:
        weights: Array = world.posture().jacobian[DOF.index(channel.name)] ** 2
        return float(weights @ each / weights.sum())
    return float(each.mean())
