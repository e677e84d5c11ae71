"""The command `servobench identify`: estimate, from the log of a real robot, the settings that make
the simulated robot respond alike.
"""

import tomllib
from pathlib import Path

from rich.console import Console

from servo.cli.terminal import plain, waiting
from servo.identify.doubts import doubts
from servo.identify.fit import Identified, identify
from servo.identify.lines import lines, picture
from servo.identify.log import Log, LogChannel, listed, read
from servo.loop.episode import Episode
from servo.mistake import Mistake, check_known, writing
from servo.output.run_folder import prepare
from servo.scenario.load import load
from servo.types import DOF
from sim.types import Array
from sim.world import World
from tracking.drawing.figures import save
from tracking.files import atomic


def run(log: Path, scenario: str, out: Path | None) -> None:
    """Estimate delay, jitter, lag, play (backlash) and encoder noise of the robot that recorded a
    log; print and write them as settings (robot.toml), and draw the robot's response
    (response.png).

    Args:
        log: The log: a file .csv, .parquet or .mcap.
        scenario: The scenario whose robot the settings are for.
        out: The folder to write; None: the next free runs/identify-LOG.

    Raises:
        Mistake: The log or the scenario cannot be used, or the folder cannot be written.
    """
    logged = read(log)
    with waiting(Console(stderr=True), "estimating delay, lag, play and noise"):
        found, text = estimated(logged, scenario)
    folder = prepare(out, f"identify-{log.stem}")
    with writing(folder):
        settings = atomic.write(folder, "robot.toml", text)
        drawn = save(picture(logged, found), folder, "response.png")
    unused = f"unused columns (unknown names, or no numbers): {listed(logged.unused, most=6)}"
    plain(Console(), text, str(settings), str(drawn), unused * bool(logged.unused))


def estimated(log: Log, scenario: str) -> tuple[Identified, str]:
    """Return the estimates of delay, lag, play and noise from a robot's log, and the TOML lines
    that set them for a scenario's robot.

    Args:
        log: The log.
        scenario: A shipped scenario or a TOML file.

    Raises:
        Mistake: The scenario's robot lacks a joint of the log or moves it in another unit, the log
            contradicts itself, or the scenario refuses a setting.
    """
    with Episode(load(scenario), seen=False) as episode:
        world = episode.world
        _check_names(log, world, scenario)
        servos = [_servo(world, channel) for channel in log.channels]
        tick = float(world.ticks[1]) if len(world.ticks) > 1 else world.period
        joints = world.robot.names
        fastest = dict(zip(joints, world.robot.fastest.tolist(), strict=True))
    found = identify(log, servos)
    text = lines(found, joints, tick, doubts(log, found, fastest))
    parts = tomllib.loads(text).items()
    load(scenario, [f"{part}.{key}={keys[key]}" for part, keys in parts for key in keys])
    return found, text


def _check_names(log: Log, world: World, scenario: str) -> None:
    units = dict(
        zip((*world.robot.names, *DOF), (*world.robot.units, *"mmm", *3 * ["rad"]), strict=True)
    )
    place = f"the robot of '{scenario}'"
    check_known((name for name, _ in log.asked), units, place, "joint or component of the twist")
    for name, unit in log.asked:
        if unit != units[name]:
            raise Mistake(
                f"the robot of '{scenario}' moves '{name}' in {units[name]}, not in {unit}: "
                "correct the unit in the column's name"
            )


def _servo(world: World, channel: LogChannel) -> float:
    """Return the time constant [s] with which a simulated drive follows its command, for the joint
    of a channel of the log. For a component of the camera's twist, return a mean over the joints,
    weighted by the square of what each contributes to the component.
    """
    each = world.robot.servos()
    if channel.name in world.robot.names:
        return float(each[world.robot.names.index(channel.name)])
    weights: Array = world.posture().jacobian[DOF.index(channel.name)] ** 2
    return float(weights @ each / weights.sum()) if weights.any() else float(each.mean())
