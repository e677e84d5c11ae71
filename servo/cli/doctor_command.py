"""What `servobench doctor` does: report renderer, versions and speed of this machine."""

from __future__ import annotations

import platform
import tempfile
from pathlib import Path

import cv2
from rich.console import Console

from servo.cli import speed
from servo.cli.terminal import complain, plain, print_table
from servo.loop.episode import Episode
from servo.output.run_folder import RECORDING, RunFolder
from servo.output.versions import clash, versions
from servo.report.words import Table
from servo.scenario import load as scenarios
from sim.camera import gl

LENGTH = 60.0
"""The car's length in the films that trackers are timed on [px]."""
TIMED = (
    "camshift",
    "cv_mean_shift",
    "mean_shift",
    "mk_ssd",
    "pf_ssd",
    "condensation",
    "annealed",
    "mk_pf",
    "kams",
    "cv_mil",
)
FINE = "All is well. To begin with: servobench run reversal"
UNIT = "camshift"
"""Tracker times are given as multiples of OpenCV's."""


def examine(*, bench: bool) -> int:
    """Print back end, renderer, versions and speed of this machine, and what to do next; bench: how
    long parts take. The exit code.
    """
    console = Console()
    backend = gl.backend()
    scenario = scenarios.load("still")
    with Episode(scenario) as episode:
        loop = speed.times_of(episode)
    rows = {
        "OpenGL back end": backend,
        "renderer": gl.describe(),
        "frames a second": f"{1e3 / loop.render:.0f} at {scenario.camera.width} x "
        f"{scenario.camera.height}",
        "Python": platform.python_version(),
        **versions(),
    }
    print_table(console, Table(("what", "found"), list(rows.items()), words=range(2)))
    if bench:
        _bench(console)
    if sentence := clash():
        complain(sentence)
        return 1
    plain(console, FINE)
    return 0


def _bench(console: Console) -> None:
    with console.status("timing, half a minute"):
        loop = speed.loop_times()
        recorded, size = _recorded()
        law = speed.law_ms()
        threads = cv2.getNumThreads()
        cv2.setNumThreads(1)
        film = speed.film(LENGTH)
        times = {kind: speed.tracker_ms(kind, film) for kind in TIMED}
        cv2.setNumThreads(threads)
    ratio = loop.step / loop.render
    rows = [
        ["render", f"{loop.render:.2f}"],
        ["step of the loop (line, pf_ssd)", f"{loop.step:.2f}", "render", f"{ratio:.2f}"],
        [
            "step with a recording",
            f"{recorded.step:.2f}",
            "without",
            f"{recorded.step / loop.step:.2f}",
        ],
        ["features, control law, Kalman filter", f"{law:.3f}"],
        *(
            [f"{kind}, car of 60 x 30 px", f"{ms:.2f}", UNIT, f"{ms / times[UNIT]:.1f}"]
            for kind, ms in times.items()
        ),
    ]
    plain(console, "Medians in ms, 320 x 240")
    print_table(console, Table(("what", "ms", "against", "times"), rows, words=(0, 2)))
    plain(console, f"a recording has {size / 1e3:.1f} kB a frame")


def _recorded() -> tuple[speed.LoopTimes, float]:
    """Times of a loop that writes everything, and the size of its recording a frame [bytes]."""
    with tempfile.TemporaryDirectory() as folder:
        with Episode(scenarios.load("line")) as episode:
            output = RunFolder(Path(folder), episode, rerun=True)
            times = speed.times_of(episode, output.add)
            output.close()
        return times, (Path(folder) / RECORDING).stat().st_size / episode.frames
