"""The command line. Heavy imports happen inside the commands."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(
    name="servobench",
    help="A visual-servoing testbed: rendered frames in, gantry motion out, the truth beside it.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

SCENARIO = Annotated[
    str, typer.Argument(help="A shipped scenario (servobench list) or a .toml file.")
]
SET = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change any setting; repeat at will."),
]
SEED = Annotated[
    int | None, typer.Option(min=0, help="Seed of every random stream (default: the scenario's).")
]
REGION = Annotated[
    str | None,
    typer.Option(
        metavar="X,Y,W,H[,DEG]",
        help="The target in the first picture: top left corner, size [px], rotation about its "
        "centre (default: the truth's first line).",
    ),
]
WORKERS = Annotated[int, typer.Option(min=1, help="Processes side by side.")]
QUIET = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but mistakes.")]


@app.command()
def run(
    scenario: SCENARIO,
    changes: SET = None,
    seed: SEED = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder to write (default: runs/NAME-SEED).")
    ] = None,
    quiet: QUIET = False,
    no_rerun: Annotated[bool, typer.Option("--no-rerun", help="Write no Rerun recording.")] = False,
) -> None:
    """Run a scenario; write recording, table, report and plots."""
    from servo.commands import run_scenario

    raise typer.Exit(
        run_scenario(scenario, changes or [], seed, out, quiet=quiet, rerun=not no_rerun)
    )


@app.command()
def check(
    scenarios: Annotated[
        list[str] | None, typer.Argument(help="Which (default: all that have bounds).")
    ] = None,
    changes: SET = None,
    seeds: Annotated[
        int, typer.Option(min=1, help="Run each with seeds 0, 1, ... up to this many.")
    ] = 1,
    seed: Annotated[int, typer.Option(min=0, help="The first seed.")] = 0,
    quiet: QUIET = False,
) -> None:
    """Test the bounds of scenarios; exit 1 if one is missed."""
    from servo.commands import check_scenarios

    raise typer.Exit(
        check_scenarios(scenarios or [], changes or [], range(seed, seed + seeds), quiet=quiet)
    )


@app.command()
def track(
    source: Annotated[
        str, typer.Argument(help="A folder of images (also OTB, VOT), a video, or camera:0.")
    ],
    region: REGION = None,
    tracker: Annotated[str, typer.Option(help="Which (servobench list).")] = "annealed",
    changes: SET = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the tracker's draws.")] = 0,
    truth: Annotated[
        Path | None,
        typer.Option(help="Truth to compare with: OTB, VOT, CSV (default: what lies beside it)."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder to write (default: runs/SOURCE-TRACKER-SEED).")
    ] = None,
    video: Annotated[bool, typer.Option("--video", help="Also write an annotated MP4.")] = False,
    rerun: Annotated[bool, typer.Option("--rerun", help="Also write a Rerun recording.")] = False,
    rate: Annotated[float, typer.Option(min=0.001, help="Pictures a second of a folder.")] = 30.0,
    frames: Annotated[int | None, typer.Option(min=1, help="Stop after this many.")] = None,
    quiet: QUIET = False,
) -> None:
    """Follow a target through any pictures; write its track."""
    from servo.track import Request
    from servo.track import run as run_track

    options = (video, rerun, rate, frames, quiet)
    request = Request(source, region, tracker, changes or [], seed, truth, out, *options)
    raise typer.Exit(run_track(request))


@app.command()
def bench(
    suite: Annotated[
        str,
        typer.Argument(
            help="clutter, similarity, texture, closed_loop, a folder of sequences (OTB, VOT), or "
            "a .toml file."
        ),
    ],
    trackers: Annotated[
        str | None,
        typer.Option(help="Which, such as kams,sok,kams:paper (default: all, or the file's)."),
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Seeds 0, 1, ... up to this many.")] = 3,
    workers: WORKERS = 2,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder to write or to go on in (default: runs/bench-SUITE)."),
    ] = None,
    quiet: QUIET = False,
) -> None:
    """Compare trackers; a stopped bench goes on where it was."""
    from servo.bench import run as run_bench

    raise typer.Exit(run_bench(suite, trackers, seeds, workers, out, quiet=quiet))


@app.command()
def papers(
    claims: Annotated[
        list[str] | None, typer.Argument(help="Which, such as P1-2 (default: all).")
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="One seed of each, to see that all works.")
    ] = False,
    sequences: Annotated[
        Path | None, typer.Option(help="A folder of real sequences that join P0-1.")
    ] = None,
    workers: WORKERS = 2,
    out: Annotated[
        Path | None, typer.Option(help="Folder to write or to go on in (default: runs/papers).")
    ] = None,
    quiet: QUIET = False,
) -> None:
    """Test the papers' claims again; exit 1 if one does not hold."""
    from servo.papers.claim import Effort
    from servo.papers.command import run as run_papers

    effort = Effort(quick, sequences)
    raise typer.Exit(run_papers(claims or [], effort, workers, out, quiet=quiet))


@app.command("list")
def list_(
    what: Annotated[
        str | None, typer.Argument(help="A kind: show its settings, their units and defaults.")
    ] = None,
) -> None:
    """List scenarios and kinds, or the settings of one kind."""
    from servo.listing import show_all, show_kind

    show_all() if what is None else show_kind(what)


@app.command()
def view(
    recording: Annotated[Path, typer.Argument(help="A run's folder, or an .rrd file.")],
    web: Annotated[
        bool, typer.Option("--web", help="In a browser instead of Rerun's own window.")
    ] = False,
    png: Annotated[
        Path | None, typer.Option(help="Draw the viewer into this PNG instead; no display needed.")
    ] = None,
    at: Annotated[float, typer.Option(min=0, help="Simulated time to show in the PNG [s].")] = 4.0,
    panel: Annotated[
        str | None,
        typer.Option(
            help="Draw one panel only, by its entity: world/eye/image, world, plots/error."
        ),
    ] = None,
) -> None:
    """Open a recording in the Rerun viewer, or draw a PNG."""
    from servo.recording import view as viewer

    path = viewer.recording_in(recording) if recording.is_dir() else recording
    viewer.check(path)
    if png is not None:
        viewer.picture(path, png, at, panel)
        typer.echo(png)
        return
    raise typer.Exit(viewer.show(path, web=web))


@app.command()
def doctor(
    bench: Annotated[
        bool, typer.Option("--bench", help="Also time rendering, loop, recording and trackers.")
    ] = False,
) -> None:
    """Tell renderer, versions and speed of this machine."""
    from servo.doctor import examine

    raise typer.Exit(examine(bench=bench))


def main() -> None:
    """The entry point: a user's mistake is one sentence on stderr and exit code 2."""
    from servo.mistake import Mistake
    from sim.gl import NoRenderer

    try:
        app()
    except (Mistake, NoRenderer) as error:
        print(f"servobench: {error}", file=sys.stderr)
        sys.exit(2)
