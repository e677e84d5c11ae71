"""What `servobench tune` finds: against theory, and against the defaults.

python tests/benchmarks/tuning.py theory    # the best gain of an integrator with delay
python tests/benchmarks/tuning.py defaults  # six scenarios at four delays, on fresh seeds

Each search has a folder under runs/tuning, so that a stopped study goes on.
"""

import json
import sys
from pathlib import Path

import numpy as np

from servo.cli import tune_command
from servo.report.words import listed, spread
from servo.tune.search import column
from tracking.statistics.comparisons import clopper_pearson, mean_of

FOLDER = Path("runs") / "tuning"
ERROR = "servo_rms_px"
OPTIONS = {"minimise": ERROR, "workers": 1, "scheduler": None, "quiet": True}
RATE = 30.0
"""Frame rate of the scenarios [Hz]."""
LATENCIES = (1, 2, 3, 4, 6)
"""Delays of the loop in theory [frames]."""
DURATION = 3
FREE = ("robot.kind=free", "tracker.kind=truth", "estimator.kind=none", f"run.duration={DURATION}")
FREE += ("measure.after=0", "start.angle_deg=0", "start.scale=1", "vary={}", "start.x=20")
FREE += ("controller.fastest=100",)
SCENARIOS = ("line", "sine", "circle", "wander", "stop_and_go", "arm7_line")
DELAYS = (1, 6, 4, 2)
SHORT = ("run.duration=3.5", "measure.after=1.5")


def say(*cells):
    """Write a row of a table."""
    sys.stdout.write(f"| {' | '.join(map(str, cells))} |\n")
    sys.stdout.flush()


def rms(gain, latency):
    """The rms error of e' = e - gain T e(latency frames before), from 1, over the run."""
    errors = [1.0] * (latency + 1)
    for _ in range(round(DURATION * RATE) - latency - 1):
        errors.append(errors[-1] - gain / RATE * errors[-1 - latency])
    return float(np.sqrt(np.mean(np.square(errors))))


def theory():
    """Compare the gain that a search finds with the best of the recursion."""
    say("frames of delay", "theory [1/s]", "found [1/s]", "off")
    for latency in LATENCIES:
        gains = np.geomspace(0.1, RATE, 20_000)
        best = gains[np.argmin([rms(gain, latency) for gain in gains])]
        folder = FOLDER / f"theory-{latency}"
        options = OPTIONS | {"keep": (), "budget": 40, "seeds": 2, "fresh": 1}
        options |= {"settings": ("controller.gain=0.5:29:log",)}
        changes = (*FREE, f"run.latency={latency}")
        tune_command.run(scenario="still", changes=changes, out=folder, **options)
        found = json.loads((folder / "tune.json").read_text())["best"]["controller.gain"]
        say(latency, f"{best:.3g}", f"{found:.3g}", f"{100 * (found / best - 1):+.1f} %")


def defaults():
    """Compare the defaults with what a short search finds, on fresh seeds."""
    say("scenario", "frames of delay", "default", "tuned", "gain", "success", "settings")
    for latency in DELAYS:
        for scenario in SCENARIOS:
            folder = FOLDER / f"{scenario}-{latency}"
            options = {"keep": ("success_rate>=0.95",), "settings": ()}
            options |= {"budget": 36, "seeds": 4, "fresh": 10}
            changes = (*SHORT, f"run.latency={latency}")
            tune_command.run(scenario=scenario, changes=changes, out=folder, **OPTIONS, **options)
            file = json.loads((folder / "tune.json").read_text())
            before, after = (column(file[f"fresh_{name}"], ERROR) for name in ("before", "after"))
            successes = int(column(file["fresh_after"], "success_rate").sum())
            means = (mean_of(before), mean_of(after), mean_of(before - after))
            rate = clopper_pearson(successes, len(after))
            say(scenario, latency, *map(spread, (*means, rate)), listed(file["best"]))


if __name__ == "__main__":
    {"theory": theory, "defaults": defaults}[sys.argv[1]]()
