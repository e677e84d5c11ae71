"""Types and options of the command line that several commands share, and the click group of all
commands.
"""

import math
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import click
from click.shell_completion import CompletionItem

from servo.cli.guard import StopSignal, ending_signals, stop
from servo.mistake import Refused
from servo.scenario import catalogue

Function = TypeVar("Function", bound=Callable[..., object])
PORT = 9090
"""TCP port of a viewer's data, by default."""


class WholeNumber(click.IntRange):
    """A whole number within limits, which messages and the help call an integer, not an "integer
    range" as click does.
    """

    name = "integer"


class FiniteRange(click.FloatRange):
    """Type of an option of the command line: a number in a range. Nan, which click's own type
    accepts, is refused.
    """

    def convert(
        self, value: float, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Return the number, or fail with a usage error of click if it is nan or out of range."""
        number = super().convert(value, param, ctx)
        if math.isnan(number):
            self.fail(f"{value!r} is not in the range {self._describe_range()}.", param, ctx)
        return number


class Numbers(click.ParamType[list[float]]):
    """Type of an option of the command line: a list of `count` finite numbers with commas between
    them, such as 0,0.5,0.6,-90.
    """

    name = "numbers"

    def __init__(self, count: int) -> None:
        self._count = count

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> list[float]:
        """Return the list of numbers in a text, or fail with a usage error of click if their count
        is wrong or one is not finite.
        """
        try:
            numbers = [float(part) for part in str(value).split(",")]
        except ValueError:
            numbers = []
        if len(numbers) != self._count or not all(map(math.isfinite, numbers)):
            self.fail(
                f"{value!r} is not {self._count} numbers with commas between them.", param, ctx
            )
        return numbers


class Named(click.Path):
    """Type of an argument of the command line: a path or another name of a source, such as
    camera:0. Empty texts and NUL characters are refused.

    A script whose variable is not set passes an empty text, which would be the current folder.
    """

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path, or fail with a usage error of click if no file can have this name."""
        if not str(value) or "\0" in str(value):
            self.fail("no file can have this name." if value else "the name is empty.", param, ctx)
        return super().convert(value, param, ctx)


class Shipped(click.ParamType[str]):
    """Type of an argument of the command line: the name of a shipped scenario or study, or the path
    of a user's file; the shell can complete both. `names` returns the shipped names.
    """

    name = "text"

    def __init__(self, names: Callable[[], list[str]]) -> None:
        self._names = names

    def shell_complete(
        self,
        ctx: click.Context,
        param: click.Parameter,
        incomplete: str,
    ) -> list[CompletionItem]:
        """Return completions for the shell: the shipped names that begin with `incomplete`, the
        letters typed so far. If no name begins so, return one completion that makes the shell
        complete names of files.
        """
        found = [CompletionItem(name) for name in self._names() if name.startswith(incomplete)]
        return found or [CompletionItem(incomplete, type="file")]


SCENARIO = Shipped(catalogue.shipped)
STUDY = Shipped(catalogue.studies)
PATH = Named(path_type=Path)
SOURCE = Named(path_type=str)
COUNT = WholeNumber(min=1)
PORTS = WholeNumber(1024, 65_534)
NATURAL = WholeNumber(min=0)

quiet_option = click.option("--quiet", "-q", is_flag=True, help="Print nothing but mistakes.")


def changes_of(what: str) -> Callable[[Function], Function]:
    """Return a decorator that adds the option --set to a command; `what` names in its help which
    settings can be changed.
    """
    return click.option(
        "--set",
        "changes",
        metavar="KEY=VALUE",
        multiple=True,
        help=f"Change {what}; may be repeated: the last value of a key counts. A value is TOML, "
        "or else a text.",
    )


changes_option = changes_of("any setting")
exact_option = click.option(
    "--exact",
    is_flag=True,
    help="Render without OpenGL, with the same pictures on every machine.",
)
workers_option = click.option(
    "--workers", type=COUNT, default=2, show_default=True, help="Processes at the same time."
)
scheduler_option = click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="A Dask scheduler to work on, such as tls://10.0.0.1:8786; it must be one you trust.",
)
dry_run_option = click.option(
    "--dry-run",
    is_flag=True,
    help="Print how many runs there are and, after trying a few, how long they take; keep nothing.",
)


def out_option(default: str) -> Callable[[Function], Function]:
    """Return a decorator that adds the option --out, which names the folder to write, to a click
    command.

    Args:
        default: The default folder, as the help text names it.
    """
    return click.option("--out", type=PATH, help=f"Folder to write (default: {default}).")


OUTPUTS = (
    click.option("--video", metavar="FILE.mp4", type=PATH, help="Also write a film."),
    click.option(
        "--mcap",
        metavar="FILE.mcap",
        type=PATH,
        help="Also write a log for Foxglove; needs servobench[mcap].",
    ),
    click.option("--live", is_flag=True, help="Watch in Rerun's window, in real time."),
    click.option("--web", is_flag=True, help="Watch in a browser instead; with --live."),
    click.option(
        "--light/--no-light",
        default=None,
        help="With --web: a light page, or Rerun's (default: Rerun's where there is a GPU).",
    ),
    click.option(
        "--speed",
        type=FiniteRange(0.01, 1000.0),
        help="With --live: speed as a multiple of real time (default: 1).",
    ),
    click.option(
        "--port",
        type=PORTS,
        help=f"With --live: TCP port of the data; Rerun's page has the next (default: {PORT}).",
    ),
)
"""The options for films, logs and viewers."""


def output_options(command: Function) -> Function:
    """Add the options for films, logs and viewers (--video, --mcap, --live, ...) to a click
    command, and return the command.
    """
    for option in reversed(OUTPUTS):
        command = option(command)
    return command


TWIN_LOG = (
    "The hand's poses, twists or joints and the commands over time: .csv, .parquet, .mcap, the "
    "folder of a run, or a bag of ROS."
)
TWIN_VIDEO = (
    "What its camera saw meanwhile: a video, a folder of pictures, or a bag (default: LOG, if that "
    "is a bag)."
)
TWIN = (
    click.option(
        "--eye-to-hand",
        is_flag=True,
        help="The camera stands still and films what the hand carries: find the camera in the "
        "base.",
    ),
    click.option(
        "--scenario", type=SCENARIO, help="The scenario whose robot has the log's joints."
    ),
    click.option("--calibration", type=PATH, help="Calibration of the camera (ROS or OpenCV)."),
    click.option(
        "--fov",
        type=FiniteRange(1.0, 170.0),
        help="Its horizontal field of view [deg], if that is known (default: 60, not trusted).",
    ),
    click.option(
        "--along",
        type=FiniteRange(-10.0, 10.0),
        help="Distance of the camera from the hand's origin along its optical axis, if that is "
        "known and the focal length is not [m].",
    ),
    click.option(
        "--mount",
        type=Numbers(6),
        metavar="X,Y,Z,ROLL,PITCH,YAW",
        help="Where the camera should be in the hand (with --eye-to-hand: in the base), to be "
        "checked [m, deg].",
    ),
    click.option(
        "--tag-mm",
        type=FiniteRange(1.0, 10_000.0),
        help="Side of the black square of an AprilTag 36h11 that stands still in the film: shows "
        "focal length and mount together [mm].",
    ),
    click.option(
        "--exposure-ms",
        type=FiniteRange(0.0, 1000.0),
        help="Exposure of each row, if it is known, and the stamps are of its end [ms].",
    ),
    click.option(
        "--readout-ms",
        type=FiniteRange(0.0, 1000.0),
        help="Delay from the first to the last row (rolling shutter), likewise [ms].",
    ),
    click.option(
        "--rate",
        type=FiniteRange(0.01, 10_000.0),
        default=30.0,
        show_default=True,
        help="Pictures a second of a folder [Hz].",
    ),
    click.option("--topic", help="The image topic of a bag that has several."),
    click.option("--motion", help="The topic of a bag with the hand's motion, if several have it."),
    click.option("--commands", help="The topic of a bag with the commanded twists, likewise."),
    click.option("--stamps", type=PATH, help="CSV with the stamp time_s of each picture [s]."),
    click.option(
        "--begins",
        type=FiniteRange(-1e10, 1e10),
        help="Time of the first picture on the log's clock, to a second [s].",
    ),
)
"""The options for a log and its film."""


def twin_options(command: Function) -> Function:
    """Add the options about a robot's log and the film of its camera (--calibration, --mount, ...)
    to a click command, and return the command.
    """
    for option in reversed(TWIN):
        command = option(command)
    return command


TO_TRY = """
To begin with:
  servobench doctor                    # does this machine render, and how fast?
  servobench run reversal              # a run: its measures, and the folder runs/reversal-0
  servobench view runs/reversal-0      # look at it; without a display: --png FILE
  servobench report runs/reversal-0    # the same as a page
  servobench list tracker              # what may take the place of a part
"""


GROUPS = {
    "Run": ("run", "track", "view", "film", "report"),
    "Compare": ("compare", "sweep", "evaluate"),
    "Measure": ("check", "tune", "budget", "robot", "photo", "doctor"),
    "Real robots": ("preflight", "twin", "identify"),
    "Publish": ("benchmark", "papers", "docs"),
    "Connect your own parts": ("new", "list", "schema"),
}
"""The commands by what they are for, in the order of the help."""


EXACT = "camera.renderer=exact"
FINE = "camera.textures=fine"


def exactly(changes: Sequence[str]) -> tuple[str, ...]:
    """Return changes of settings as the option --exact extends them: the exact renderer draws the
    pictures, and textures are fine unless one of the changes sets them.
    """
    return (FINE, *changes, EXACT)


class Command(click.Command):
    """A command whose work is the function `run` of the module `servo.cli.NAME_command`. The module
    is imported only when the command runs, since most modules take a while to import.
    """

    def invoke(self, ctx: click.Context) -> NoReturn:
        """Call the function `run` of the module `servo.cli.NAME_command` with the options as
        arguments (--exact becomes changes of settings), and exit with the code that it returns; 0
        if it returns None.

        Raises:
            StopSignal: A signal came while the module was imported.
            SystemExit: The function has returned.
        """
        module = import_module(f"servo.cli.{self.name}_command")
        signals: list[StopSignal] = ctx.obj
        if signals:  # MuJoCo's C++ code drops an exception that comes while it imports
            raise signals[0]
        given = dict(ctx.params)
        if given.pop("exact", False):
            given["changes"] = exactly(given["changes"])
        sys.exit(module.run(**given) or 0)


class Commands(click.Group):
    """The command `servobench`, a group (of click) of all commands. Its help lists them by purpose,
    and the signals SIGINT (Ctrl-C), SIGTERM and SIGHUP end each command in the same way: with one
    sentence and the exit code 128 + the signal's number.
    """

    command_class = Command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write a section of the help for each group of commands, such as "Run" or "Compare"."""
        for title, names in GROUPS.items():
            limit = formatter.width - max(map(len, self.commands)) - 6
            rows = [(name, self.commands[name].get_short_help_str(limit)) for name in names]
            with formatter.section(title):
                formatter.write_dl(rows)

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write examples below the help: five commands to begin with."""
        formatter.write(TO_TRY)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command that the arguments name. A signal that ends it (SIGINT, SIGTERM or
        SIGHUP) prints one sentence, and the program exits with 128 + the signal's number.
        """
        with ending_signals() as raised:
            ctx.obj = raised
            try:
                return super().invoke(ctx)
            except (Refused, OSError):
                raise
            except (KeyboardInterrupt, Exception) as error:
                cause = raised[0] if raised else error
                if isinstance(cause, KeyboardInterrupt):
                    stop(cause)
                raise
