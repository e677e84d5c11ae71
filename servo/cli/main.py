"""The command line. Heavy imports happen inside the commands."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from servo.cli.options import (
    COUNT,
    FRAME_RATE,
    FRAMES,
    MOMENT,
    NATURAL,
    PATH,
    SOURCE,
    Commands,
    changes_option,
    out_option,
    quiet_option,
    truth_options,
    workers_option,
)
from servo.cli.robot_arguments import robot


@click.group(
    cls=Commands, no_args_is_help=True, context_settings={"help_option_names": ["-h", "--help"]}
)
@click.version_option(package_name="servobench", message="servobench %(version)s")
def app() -> None:
    """A testbed for visual servoing: simulate, track, control, and compare with the truth."""


@app.command()
@click.argument("scenario", help="A shipped scenario (servobench list) or a .toml file.")
@changes_option
@click.option("--seed", type=NATURAL, help="Seed of every random stream (default: the scenario's).")
@out_option("runs/NAME-SEED")
@quiet_option
@click.option("--no-rerun", is_flag=True, help="Write no Rerun recording.")
def run(
    scenario: str, changes: tuple[str, ...], seed: int | None, out: Path | None, quiet: bool,
    no_rerun: bool,
) -> None:  # fmt: skip
    """Run a scenario; write recording, table, report and plots."""
    from servo.cli.run_command import run_scenario

    sys.exit(run_scenario(scenario, changes, seed, out, quiet=quiet, rerun=not no_rerun))


@app.command()
@click.argument("scenarios", nargs=-1, help="Which (default: all that have bounds).")
@changes_option
@click.option(
    "--seeds", type=COUNT, default=1, show_default=True,
    help="Number of seeds for each scenario, from --seed on.",
)  # fmt: skip
@click.option("--seed", type=NATURAL, default=0, show_default=True, help="The first seed.")
@workers_option
@quiet_option
def check(
    scenarios: tuple[str, ...], changes: tuple[str, ...], seeds: int, seed: int, workers: int,
    quiet: bool,
) -> None:  # fmt: skip
    """Test the bounds of scenarios; exit 1 if one is missed."""
    from servo.cli.check_command import check_scenarios

    sys.exit(check_scenarios(scenarios, changes, seed, seeds, workers, quiet=quiet))


@app.command()
@click.argument(
    "source", type=SOURCE, help="A folder of images (also OTB, VOT), a video, or camera:0."
)
@click.option(
    "--region", metavar="X,Y,W,H[,DEG]",
    help="The target in the first picture: top left corner, size [px], rotation about its centre "
    "(default: the truth's first line).",
)  # fmt: skip
@click.option("--tracker", default="annealed", show_default=True, help="Which (servobench list).")
@changes_option
@click.option(
    "--seed", type=NATURAL, default=0, show_default=True, help="Seed of the tracker's draws."
)
@truth_options
@out_option("runs/SOURCE-TRACKER-SEED")
@click.option("--video", is_flag=True, help="Also write an annotated MP4.")
@click.option("--rerun", is_flag=True, help="Also write a Rerun recording.")
@click.option(
    "--rate", type=FRAME_RATE, default=30.0, show_default=True,
    help="Pictures a second of a folder.",
)  # fmt: skip
@click.option("--frames", type=FRAMES, help="Stop after this many.")
@quiet_option
def track(**options: Any) -> None:
    """Follow a target through any pictures; write its track."""
    from servo.cli.track_command import TrackRequest
    from servo.cli.track_command import run as run_track

    sys.exit(run_track(TrackRequest(**options)))


@app.command()
@click.argument(
    "suite", type=SOURCE,
    help="clutter, similarity, texture, closed_loop, a folder of sequences (OTB, VOT), or a .toml "
    "file.",
)  # fmt: skip
@click.option(
    "--trackers", help="Which, such as kams,sok,kams:paper (default: all, or the file's)."
)
@click.option(
    "--seeds", type=COUNT, default=3, show_default=True, help="Number of seeds from 0 on."
)
@workers_option
@out_option("runs/bench-SUITE, also to continue")
@quiet_option
def bench(
    suite: str, trackers: str | None, seeds: int, workers: int, out: Path | None, quiet: bool
) -> None:
    """Compare trackers; the same command continues a stopped bench."""
    from servo.cli.bench_command import run as run_bench

    sys.exit(run_bench(suite, trackers, seeds, workers, out, quiet=quiet))


@app.command()
@click.argument("study", help="A shipped study (servobench list), or a .toml file of axes.")
@changes_option
@click.option("--seeds", type=COUNT, help="Number of seeds from 0 on (default: the study's).")
@workers_option
@click.option(
    "--scheduler", metavar="ADDRESS",
    help="A Dask scheduler to work on, such as tls://10.0.0.1:8786; it must be one you trust.",
)  # fmt: skip
@out_option("runs/sweep-STUDY, also to continue")
@quiet_option
def sweep(**options: Any) -> None:
    """Run a scenario over axes, draws and seeds; the same command continues a stopped study."""
    from servo.cli.sweep_command import SweepRequest
    from servo.cli.sweep_command import run as run_study

    sys.exit(run_study(SweepRequest(**options)))


@app.command()
@click.argument("claims", nargs=-1, help="Which, such as P1-2 (default: all).")
@click.option("--quick", is_flag=True, help="One seed of each, to check that all works.")
@click.option("--sequences", type=PATH, help="A folder of real sequences to add to P0-1.")
@workers_option
@out_option("runs/papers, also to continue")
@quiet_option
def papers(
    claims: tuple[str, ...], quick: bool, sequences: Path | None, workers: int, out: Path | None,
    quiet: bool,
) -> None:  # fmt: skip
    """Test the papers' claims again; exit 1 if one does not hold."""
    from servo.cli.papers_command import run as run_papers
    from servo.papers.claim import Effort

    sys.exit(run_papers(claims, Effort(quick, sequences), workers, out, quiet=quiet))


@app.command()
@click.argument("folders", nargs=-1, required=True, type=PATH, metavar="DIR...")
@click.option("--out", type=PATH, help="File to write (default: report.html in the first DIR).")
def report(folders: tuple[Path, ...], out: Path | None) -> None:
    """Write a page about folders of run, bench, papers and sweep."""
    from servo.cli.report_command import write

    click.echo(write(folders, out))


@app.command("list")
@click.argument(
    "what", required=False,
    help="A part of a scenario (tracker): its kinds. A section (camera) or a kind (kams): its "
    "settings.",
)  # fmt: skip
def list_(what: str | None) -> None:
    """List scenarios and kinds, or settings with their units and defaults."""
    from servo.cli.list_command import show, show_all

    show_all() if what is None else show(what)


@app.command()
def schema() -> None:
    """Print the JSON Schema of the scenario format, for editors."""
    from servo.cli.schema_command import text

    click.echo(text())


@app.command()
@click.argument("recording", type=PATH, help="A run's folder, or an .rrd file.")
@click.option("--web", is_flag=True, help="In a browser instead of Rerun's own window.")
@click.option("--png", type=PATH, help="Draw the viewer into this PNG instead; no display needed.")
@click.option(
    "--at", type=MOMENT, default=4.0, show_default=True,
    help="Simulated time to show in the PNG [s].",
)  # fmt: skip
@click.option(
    "--panel", help="Draw one panel only, by its entity: world/eye/image, world, plots/error."
)
def view(recording: Path, web: bool, png: Path | None, at: float, panel: str | None) -> None:
    """Open a recording in the Rerun viewer, or draw a PNG."""
    from servo.output.recording import view as viewer

    path = viewer.recording_in(recording) if recording.is_dir() else recording
    viewer.check(path)
    if png is None:
        sys.exit(viewer.show(path, web=web))
    viewer.picture(path, png, at, panel)
    click.echo(png)


@app.command()
@click.argument("part", type=click.Choice(["tracker"]), expose_value=False)
@click.argument("name")
@out_option("NAME")
def new(name: str, out: Path | None) -> None:
    """Write a small package with a part of your own, to begin with: new tracker my_tracker."""
    from servo.cli.new_command import new_tracker

    for path in new_tracker(name, out):
        click.echo(path)


@app.command()
@click.option("--bench", is_flag=True, help="Also time rendering, loop, recording and trackers.")
def doctor(bench: bool) -> None:
    """Report renderer, versions and speed of this machine."""
    from servo.cli.doctor_command import examine

    sys.exit(examine(bench=bench))


app.add_command(robot)


def main() -> None:
    """The entry point."""
    from servo.cli.guard import guarded

    guarded(app)
