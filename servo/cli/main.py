"""The command line `servobench`: the name, the help and the options of each command, whose work is
the function `run` of the module `servo.cli.NAME_command`.
"""

from pathlib import Path

import click

from servo.bench.names import NAMES
from servo.cli import options as opt
from servo.cli.guard import guarded
from sim.ranges import LONGEST

PARTS = ("tracker", "law", "features", "estimator", "motion", "robot", "scenarios")
"""What `servobench new` can write: a package with a component of this sort, or ("scenarios") a
repository of scenarios."""


@click.group(
    cls=opt.Commands, no_args_is_help=True, context_settings={"help_option_names": ["-h", "--help"]}
)
@click.version_option(package_name="servobench", message="servobench %(version)s")
def app() -> None:
    """A testbed for visual servoing: simulate, track, control, and compare with the truth."""


@app.command()
@click.argument("scenario", type=opt.SCENARIO, help="A shipped scenario, or a .toml file.")
@click.option(
    "--tracker",
    help="Its tracker: kind, kind:preset, module:Class, 'program:COMMAND', 'trax:COMMAND' or "
    "onnx:FILE[,FILE[,FILE]] (default: the scenario's).",
)
@click.option(
    "--controller",
    help="Its control law: kind, kind:preset, module:Class, 'program:COMMAND' or onnx:FILE "
    "(default: the scenario's).",
)
@opt.changes_option
@opt.exact_option
@click.option(
    "--seed", type=opt.NATURAL, help="Seed of every random stream (default: the scenario's)."
)
@opt.out_option("runs/NAME-SEED")
@opt.quiet_option
@click.option("--all", "all_measures", is_flag=True, help="Print every measure.")
@click.option("--no-rerun", is_flag=True, help="Write no Rerun recording.")
@click.option(
    "--ros2",
    is_flag=True,
    help="Let a controller in ROS 2 move the camera, in real time (needs the extra ros2).",
)
@opt.output_options
def run() -> None:
    """Run a scenario; write recording, table, report and plots."""


@app.command()
@click.argument(
    "scenarios",
    nargs=-1,
    type=opt.SCENARIO,
    help="Shipped scenarios or .toml files (default: all shipped ones with bounds).",
)
@opt.changes_option
@opt.exact_option
@click.option(
    "--seeds",
    type=opt.COUNT,
    default=1,
    show_default=True,
    help="Number of seeds for each scenario, from --seed on.",
)
@click.option("--seed", type=opt.NATURAL, default=0, show_default=True, help="The first seed.")
@opt.workers_option
@click.option("--junit", type=opt.PATH, metavar="FILE", help="Also write JUnit's XML.")
@click.option("--json", type=opt.PATH, metavar="FILE", help="Also write all measures.")
@opt.dry_run_option
@opt.quiet_option
def check() -> None:
    """Test the bounds of scenarios; exit 1 if one is missed."""


@app.command()
@click.argument(
    "source",
    type=opt.SOURCE,
    help="A folder of images (also OTB, VOT, GOT-10k, LaSOT, TLD), a video, a bag (MCAP, ROS 1, "
    "ROS 2), camera:0, or an address (rtsp, http, tcp, udp).",
)
@click.option(
    "--region",
    metavar="X,Y,W,H[,DEG]",
    help="The target in the first picture: top left corner and size [px] before a clockwise "
    "rotation about its centre [deg] (default: the truth's first line).",
)
@click.option("--topic", help="The image topic of a bag that has several.")
@click.option(
    "--select", is_flag=True, help="Draw the region with the mouse, on a page in your browser."
)
@click.option(
    "--tracker",
    default="annealed:video",
    show_default=True,
    help="The tracker (servobench list tracker): kind, kind:preset, module:Class, "
    "'program:COMMAND', 'trax:COMMAND' or onnx:FILE[,FILE[,FILE]].",
)
@opt.changes_of("a setting of the tracker")
@click.option(
    "--seed",
    type=opt.NATURAL,
    default=0,
    show_default=True,
    help="Seed of the tracker's random numbers.",
)
@click.option(
    "--truth",
    type=opt.PATH,
    help="Truth to compare with: OTB, VOT, GOT-10k, TLD, CSV (default: the folder's own).",
)
@click.option(
    "--truth-format",
    default="auto",
    show_default=True,
    help="otb (x,y,w,h from 1), vot (x,y,w,h or 4 corners from 0), tld (x1,y1,x2,y2), csv.",
)
@opt.out_option("runs/SOURCE-TRACKER-SEED")
@click.option("--rerun", is_flag=True, help="Also write a Rerun recording.")
@opt.output_options
@click.option(
    "--rate",
    type=opt.FiniteRange(0.01, 10_000.0),
    default=30.0,
    show_default=True,
    help="Pictures a second of a folder [Hz].",
)
@click.option(
    "--frames", type=opt.WholeNumber(1, 1_000_000_000), help="Largest number of pictures to track."
)
@opt.quiet_option
def track() -> None:
    """Follow a target through any pictures; write its track."""


@app.command()
@click.argument(
    "suite",
    type=opt.SOURCE,
    help="clutter, hard_clutter, similarity, texture, camouflage, closed_loop, a folder of "
    "sequences (OTB, VOT, GOT-10k, LaSOT, TLD), or a .toml file.",
)
@click.option(
    "--trackers",
    help="Trackers, such as kams,kams:paper,mine=program:COMMAND (default: all, or the file's).",
)
@click.option(
    "--seeds", type=opt.COUNT, default=3, show_default=True, help="Number of seeds: 0, 1, 2, ..."
)
@opt.workers_option
@opt.out_option("runs/evaluate-SUITE, also to continue")
@opt.dry_run_option
@opt.quiet_option
def evaluate() -> None:
    """Compare trackers on sequences, or in the closed loop.

    The same command continues a stopped evaluation.
    """


@app.command()
@click.argument(
    "name",
    type=click.Choice(NAMES),
    help="The benchmark.",
)
@click.option(
    "--contestant",
    "--tracker",
    "--law",
    "given",
    multiple=True,
    metavar="NAME[=WHAT]",
    help="A contestant: a shipped one, mine=module:Class, mine='program:COMMAND', "
    "mine='trax:COMMAND' or mine=onnx:FILE[,FILE[,FILE]] (default: all shipped ones).",
)
@click.option(
    "--band",
    type=click.Choice(["dev", "v1"]),
    help="Worlds to tune on (default), or those of the published table.",
)
@click.option(
    "--sealed",
    metavar="VALUE",
    help="Worlds drawn from a public value of a later date.",
)
@opt.changes_of("a setting of a contestant, [tracker], [features] or [controller]")
@click.option("--quick", is_flag=True, help="Run only two worlds of each condition.")
@click.option(
    "--submit",
    type=opt.PATH,
    metavar="FILE.json",
    help="Write the contestant's row, to be published.",
)
@click.option(
    "--verify",
    type=opt.PATH,
    metavar="FILE.json",
    help="Repeat a tenth of a row's worlds; exit 1 if one differs.",
)
@opt.workers_option
@opt.out_option("runs/benchmark-NAME, also to continue")
@opt.dry_run_option
@opt.quiet_option
def benchmark() -> None:
    """Run trackers or control laws in a public benchmark.

    The same command continues a stopped benchmark.
    """


@app.command(
    cls=click.Command,
    hidden=True,
    add_help_option=False,
    context_settings={"ignore_unknown_options": True},
)
@click.argument("words", nargs=-1, type=click.UNPROCESSED)
def bench(**_: object) -> None:
    """Print that `evaluate` and `benchmark` took the place of `bench`, and exit with 2."""
    raise click.UsageError(
        "bench is now two commands: `servobench evaluate SUITE` compares trackers on sequences, "
        "`servobench benchmark loop-v1` (or servo-v2, goal-v1) runs a public benchmark"
    )


@app.command()
@click.argument("study", type=opt.STUDY, help="A shipped study, or a .toml file of axes.")
@opt.changes_option
@opt.exact_option
@click.option(
    "--seeds", type=opt.COUNT, help="Number of seeds: 0, 1, 2, ... (default: the study's)."
)
@opt.workers_option
@opt.scheduler_option
@opt.out_option("runs/sweep-STUDY, also to continue")
@click.option(
    "--measures",
    help="Columns of the table, such as servo_rms_px,age_ms (default: what differs most).",
)
@opt.dry_run_option
@opt.quiet_option
def sweep() -> None:
    """Run a study: scenarios over axes of settings and seeds.

    The same command continues a stopped study.
    """


@app.command()
@click.argument(
    "scenarios",
    nargs=-1,
    required=True,
    type=opt.SCENARIO,
    metavar="SCENARIO...",
    help="Shipped scenarios or .toml files to compare in.",
)
@click.option(
    "--tracker",
    multiple=True,
    metavar="NAME=WHAT",
    help="A tracker: kind, kind:preset, module:Class, 'program:COMMAND', 'trax:COMMAND' or "
    "onnx:FILE[,FILE[,FILE]]; may be repeated, as all of these options.",
)
@click.option("--controller", multiple=True, metavar="NAME=WHAT", help="A control law, likewise.")
@click.option("--estimator", multiple=True, metavar="NAME=WHAT", help="An estimator, likewise.")
@click.option(
    "--set-of",
    multiple=True,
    metavar="NAME=KEY=VALUE,...",
    help="Settings, such as slow=controller.gain=0.5,run.latency=3.",
)
@click.option(
    "--measured", is_flag=True, help="Delay the loop by the time that the tracker takes here."
)
@opt.changes_option
@opt.exact_option
@click.option(
    "--seeds", type=opt.COUNT, default=3, show_default=True, help="Number of seeds: 0, 1, 2, ..."
)
@opt.workers_option
@opt.scheduler_option
@opt.out_option("runs/compare, also to continue")
@click.option(
    "--measures", help="Columns of the tables, such as servo_rms_px,age_ms (default: a few)."
)
@opt.dry_run_option
@opt.quiet_option
def compare() -> None:
    """Compare trackers, laws or settings in scenarios.

    Writes an HTML page, a LaTeX table and PDF figures. A Dask worker imports a variant that is
    given as module:Class by this name: the module must be installed there as well.
    """


@app.command()
@click.argument("scenario", type=opt.SCENARIO, help="A shipped scenario, or a .toml file.")
@click.option(
    "--settings",
    metavar="KEY=LOW:HIGH[:log]",
    multiple=True,
    help="A setting to search, or KEY=A,B,C; may be repeated (default: the gain, the estimator's "
    "noise and, where commands are late, its prediction).",
)
@click.option(
    "--minimise",
    metavar="MEASURE",
    default="servo_rms_px",
    show_default=True,
    help="The measure to minimise.",
)
@click.option(
    "--keep",
    metavar="CONDITION",
    multiple=True,
    default=["success_rate>=0.95"],
    show_default=True,
    help="A bound on the mean of a measure, such as 'effort_rms_mm_s<=40'; may be repeated. "
    "One that is given replaces the default.",
)
@opt.changes_option
@opt.exact_option
@click.option(
    "--budget",
    type=opt.COUNT,
    default=300,
    show_default=True,
    help="Runs of the search, at most; at least 5 times --seeds.",
)
@click.option(
    "--seeds",
    type=opt.WholeNumber(1, 1000),
    default=8,
    show_default=True,
    help="Seeds of a candidate that is not stopped: 1, 2, ...",
)
@click.option(
    "--fresh",
    type=opt.COUNT,
    default=20,
    show_default=True,
    help="Fresh seeds for the result: 1001, 1002, ...",
)
@opt.workers_option
@opt.scheduler_option
@opt.out_option("runs/tune-SCENARIO, also to continue")
@opt.quiet_option
def tune() -> None:
    """Find the settings that minimise a measure under conditions.

    Candidates are run with the same seeds, and one that is clearly worse is stopped early. Runs
    with fresh seeds compare the best settings with those of the scenario. The same command
    continues a stopped search. Needs the extra tune.
    """


@app.command()
@click.argument("scenario", type=opt.SCENARIO, help="A shipped scenario, or a .toml file.")
@click.option(
    "--magnitude",
    metavar="SOURCE=NUMBER",
    multiple=True,
    help="How wrong a source is, such as focal_length=0.5; may be repeated (default: the "
    "scenario's own value, or else a usual one).",
)
@opt.changes_option
@opt.exact_option
@click.option(
    "--seeds", type=opt.COUNT, default=8, show_default=True, help="Number of seeds: 1, 2, ..."
)
@opt.workers_option
@opt.scheduler_option
@opt.out_option("runs/budget-SCENARIO, also to continue")
@opt.quiet_option
def budget() -> None:
    """Show what each source of error contributes to the final error.

    Runs the scenario with each source alone, and with all together: tracker, noise, resolution,
    delay, lag, play, encoder_step, focal_length, principal_point, mount_rotation,
    mount_translation, depth and target_size. The same command continues a stopped budget.
    """


@app.command()
@click.argument("claims", nargs=-1, help="Claims, such as P1-2 (default: all).")
@click.option("--quick", is_flag=True, help="One seed of each, to check that all works.")
@click.option(
    "--sequences",
    type=opt.PATH,
    help="A folder of real sequences to add to those of P0-1a, P0-1b, P0-5 and P0-6.",
)
@click.option(
    "--first-seed",
    type=opt.COUNT,
    help="Test on other seeds, from this one on (default: those that the rules name).",
)
@opt.workers_option
@opt.out_option("runs/papers or runs/papers-SEED, also to continue")
@opt.dry_run_option
@opt.quiet_option
def papers() -> None:
    """Test the papers' claims again; exit 1 if a verdict changes."""


@app.command()
@click.argument("folders", nargs=-1, required=True, type=opt.PATH, metavar="DIR...")
@click.option("--out", type=opt.PATH, help="File to write (default: report.html in the first DIR).")
@click.option("--latex", type=opt.PATH, metavar="FILE.tex", help="Also write the tables as LaTeX.")
@click.option(
    "--figures",
    type=click.Choice(["pdf", "svg", "pgf"]),
    help="Also write each figure as a file, into the folder figures beside the page.",
)
@click.option(
    "--figure-width",
    type=opt.FiniteRange(2.0, 20.0),
    metavar="INCHES",
    help="Width of these figures, such as 3.5 for a column (default: 4.9).",
)
@click.option(
    "--measures", help="Columns of a study's tables, such as servo_rms_px,age_ms (default: a few)."
)
def report() -> None:
    """Write an HTML page about folders of results.

    A folder is one that run, evaluate, benchmark, papers, sweep or compare wrote; the name of a
    benchmark, such as loop-v2, stands for its published results.
    """


@app.command("list")
@click.argument(
    "what",
    required=False,
    help="A part of a scenario (tracker): its kinds. A section (camera) or a kind (kams): its "
    "settings.",
)
def list_() -> None:
    """List scenarios, studies and kinds, or the settings of one.

    Kinds are those of trackers, robots, control laws and other parts; settings have units and
    defaults.
    """


@app.command()
def schema() -> None:
    """Print the JSON Schema of the scenario format, for editors."""


@app.command()
@click.argument("recording", type=opt.PATH, help="A run's folder, or an .rrd file.")
@click.option("--web", is_flag=True, help="In a browser instead of Rerun's own window.")
@click.option(
    "--port", type=opt.PORTS, help=f"With --web: TCP port of the data (default: {opt.PORT})."
)
@click.option(
    "--png", type=opt.PATH, help="Draw the viewer into this PNG instead; no display needed."
)
@click.option(
    "--at",
    type=opt.FiniteRange(0.0, LONGEST),
    default=4.0,
    show_default=True,
    help="Simulated time to show in the PNG [s].",
)
@click.option(
    "--panel", help="Draw one panel only, by its entity: world/eye/image, world, plots/error."
)
def view() -> None:
    """Open a recording in the Rerun viewer, or draw a PNG."""


@app.command()
@click.argument("runs", nargs=-1, metavar="RUN RUN")
@click.option(
    "--out", type=opt.PATH, default=Path("film.mp4"), show_default=True, help="File to write."
)
@opt.quiet_option
def film() -> None:
    """Film two runs beside each other.

    Each RUN is the folder of an earlier run, which is run again, or the words after `servobench
    run`, in quotes: film reversal 'reversal --set estimator.kind=none'.
    """


@app.command()
@click.argument("part", type=click.Choice(PARTS))
@click.argument("name")
@click.option(
    "--door",
    type=click.Choice(["class", "program", "trax"]),
    help="A tracker that knows nothing of servobench, and how it is connected: a class with init "
    "and update, a program that speaks lines of JSON, or a server of TraX.",
)
@opt.out_option("NAME")
def new() -> None:
    """Write a small package with a part of your own.

    The part is a tracker, law, feature set, ...; "scenarios" writes a repository of scenarios
    instead. For example: new tracker my_tracker.
    """


@app.command()
def doctor() -> None:
    """Report renderer, versions and speed of this machine."""


@app.command()
@opt.out_option("runs/docs")
@click.option("--no-open", is_flag=True, help="Only build the pages.")
@click.option("--still", is_flag=True, help="Draw a gallery that does not move, which is faster.")
@click.option(
    "--run", is_flag=True, help="Run the tutorials too, whose notebooks then have outputs: 15 min."
)
def docs() -> None:
    """Build the documentation, and open it in a browser."""


@app.command()
@click.argument("model", type=opt.SOURCE, help="The robot's MJCF or URDF, or a shipped one's name.")
@click.option("--flange", default="", help="The body or site that carries the camera.")
@click.option(
    "--mount",
    type=opt.Numbers(6),
    metavar="X,Y,Z,R,P,Y",
    help="The camera in the flange [m, deg] (default: it looks along the flange's z).",
)
@click.option("--camera", default="", help="A camera of the model, in place of flange and mount.")
@click.option(
    "--base",
    type=opt.Numbers(4),
    metavar="X,Y,Z,YAW",
    help="The robot's base in the room [m, deg] (default: proposed from its reach).",
)
@click.option(
    "--out", type=opt.PATH, help="Picture to write (default: robot.png, or robot-2.png, ...)."
)
def robot() -> None:
    """Print a robot's joints and reach, and draw it in the room.

    Also prints the flanges that can carry the camera, and the [robot] table of a scenario.
    """


@app.command()
@click.argument("log", type=opt.PATH, help="A file .csv, .parquet (steps.parquet too) or .mcap.")
@click.option(
    "--scenario",
    type=opt.SCENARIO,
    default="line",
    show_default=True,
    help="The scenario whose robot gets the settings; the lag of its drives' own servo is "
    "subtracted.",
)
@opt.out_option("runs/identify-LOG")
def identify() -> None:
    """Estimate a robot's delay, lag, play and noise from a log.

    Writes the settings with which the simulated robot responds in the same way.
    """


@app.command()
@click.argument("log", required=False, type=opt.PATH, help=opt.TWIN_LOG)
@click.argument("video", required=False, type=opt.SOURCE, help=opt.TWIN_VIDEO)
@click.option(
    "--wiggle",
    type=opt.PATH,
    metavar="FILE.csv",
    help="Write the motion to play and record, in place of a comparison; with --scenario as rates "
    "of its robot's joints.",
)
@opt.twin_options
@opt.out_option("runs/preflight-LOG")
def preflight() -> None:
    """Compare a robot's log with its camera's film.

    Prints the clock offset, the camera's mount, and each mistake with what to change. Exits with 1
    if something is wrong or too uncertain to be stated.
    """


@app.command()
@click.argument("log", type=opt.PATH, help=opt.TWIN_LOG)
@click.argument("video", required=False, type=opt.SOURCE, help=opt.TWIN_VIDEO)
@click.option(
    "--on",
    "base",
    type=opt.SCENARIO,
    help="The scenario to begin with (default: --scenario, or line).",
)
@click.option(
    "--tracker",
    multiple=True,
    metavar="NAME[=WHAT]",
    help="Another tracker to run on the recorded pictures: would it have held? kind, kind:preset, "
    "mine=module:Class, mine='program:COMMAND' ...; may be repeated. Needs --region, and "
    "estimated_x_px, estimated_y_px in LOG or --on with the recorded run's tracker.",
)
@click.option(
    "--region",
    metavar="X,Y,W,H[,DEG]",
    help="With --tracker: the target in the film's first picture [px, deg].",
)
@click.option(
    "--no-replay",
    is_flag=True,
    help="Leave out the film of the recording beside its simulation, which takes longest.",
)
@opt.twin_options
@opt.out_option("runs/twin-LOG")
def twin() -> None:
    """Turn a robot's log and its camera's film into a scenario.

    Compares log and film as preflight does, estimates delay, lag and play, and renders each picture
    of the film again in simulation.
    """


@app.command()
@click.argument("pictures", nargs=-1, type=opt.PATH, help="Photographs of a plane with the sheet.")
@click.option(
    "--out", type=opt.PATH, default=Path("ground.png"), show_default=True, help="PNG to write."
)
@click.option(
    "--sheet",
    type=opt.PATH,
    metavar="FILE",
    help="Draw the sheet of tags to print, as .pdf, .svg or .png, in place of photographs.",
)
@click.option(
    "--paper",
    type=click.Choice(["a4", "letter"]),
    default="a4",
    show_default=True,
    help="With --sheet: its paper.",
)
@click.option(
    "--side",
    type=opt.FiniteRange(5.0, 2000.0),
    default=60.0,
    show_default=True,
    help="Width of a printed tag's black square, where the printer did not keep it [mm].",
)
@click.option(
    "--calibration", type=opt.PATH, help="The camera's calibration file, of ROS or OpenCV."
)
@click.option(
    "--covered",
    type=click.Choice(["fill", "crop", "keep"]),
    default="fill",
    show_default=True,
    help="Fill the sheet's place with the plane beside it, crop it, or keep the sheet.",
)
def photo() -> None:
    """Straighten photographs of a plane into a picture for scenarios.

    A sheet of tags lies on the plane: print it with --sheet sheet.pdf. Of several photographs the
    one that shows most of the plane is taken. Prints the picture's size, and the lines of a
    scenario that show the picture as ground or target.
    """


def main() -> None:
    """Run the command line `servobench`; print a failure as one sentence and exit with its code."""
    guarded(app)
