# %% [markdown]
# # A study for a paper
#
# A question with numbers: how far does a camera lag behind a target of some speed, and what does an
# estimate of its motion gain? A study is a file of axes, draws and seeds; `servobench sweep` runs
# it, and goes on where it was stopped. Its files: [what a study
# writes](../../servo/README.md#what-a-study-writes); its format:
# [studies](../../scenes/README.md#studies).
#
# %%
import csv
import os
import subprocess
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

OUT = Path(os.environ.get("SERVOBENCH_TUTORIALS", "."))
SERVOBENCH = [sys.executable, "-m", "servo"]

# %% [markdown]
# Each cell has five runs, whose starts are drawn: intervals are over draws. `compare` names the
# axis whose values are tested in pairs.
#
# %%
(OUT / "lag.toml").write_text("""\
# servobench sweep lag.toml
# How far does the camera lag, and what does an estimate of the target's motion gain?
scenario = "line"
seeds = 5
compare = "estimator.kind"

[set]
run.duration = 3.0
controller.gain = 2.0
tracker.kind = "mean_shift"

[axes]
estimator.kind = ["none", "kalman_cv"]
motion.speed = [0.04, 0.08, 0.12]
start.x = { uniform = [-10.0, 10.0] }
start.y = { uniform = [-10.0, 10.0] }
""")
sweep = ["sweep", str(OUT / "lag.toml"), "--out", str(OUT / "lag"), "--quiet"]
subprocess.run([*SERVOBENCH, *sweep], check=True)
with (OUT / "lag" / "cells.csv").open() as file:
    cells = list(csv.DictReader(file))

# %% [markdown]
# The table of the paper, in LaTeX: means over five drawn starts with 95 % intervals.
#
# %%
MEASURE = "servo_rms_px"
KINDS, SPEEDS = ("none", "kalman_cv"), (0.04, 0.08, 0.12)


def cell(kind: str, speed: float) -> np.ndarray:
    """Mean, and both ends of its interval [px]."""
    row = next(
        c for c in cells if c["estimator.kind"] == kind and float(c["motion.speed"]) == speed
    )
    return np.array([float(row[MEASURE + end]) for end in ("", "_low", "_high")])


rows = [" & ".join(["estimator", *(f"{speed} m/s" for speed in SPEEDS)]) + r" \\ \midrule"]
for kind in KINDS:
    found = (r"{:.2f} \small[{:.2f}, {:.2f}]".format(*cell(kind, speed)) for speed in SPEEDS)
    rows.append(" & ".join([kind.replace("_", r"\_"), *found]) + r" \\")
(OUT / "lag.tex").write_text("\n".join(rows) + "\n")
print("\n".join(rows))

# %% [markdown]
# The figure. Theory says of the first estimator: f v / (Z gain).
#
# %%
figure, axes = plt.subplots(figsize=(5, 3.2), layout="constrained")
for kind in KINDS:
    mean, low, high = np.array([cell(kind, speed) for speed in SPEEDS]).T
    axes.errorbar(SPEEDS, mean, (mean - low, high - mean), marker="o", capsize=3, label=kind)
theory = 289.7 * np.array(SPEEDS) / (1.0 * 2.0)
axes.plot(SPEEDS, theory, "k:", label="f v / (Z gain)")
axes.set(xlabel="target's speed [m/s]", ylabel="servo error, rms [px]")
axes.legend()
figure.savefig(OUT / "a_study_for_a_paper.png", dpi=120)
figure.savefig(OUT / "lag.pdf")

# %% [markdown]
# A page with all of it, to give to the reviewers with the study's folder: `study.json` in it has
# the command, the settings and the versions that the numbers were made with.
#
# %%
subprocess.run([*SERVOBENCH, "report", str(OUT / "lag")], check=True)
lag = cell("none", 0.08)[0]
print(
    f"without an estimate it lags by {lag:.2f} px at 0.08 m/s, theory {theory[1]:.2f} px; "
    f"with one by {cell('kalman_cv', 0.08)[0]:.2f} px"
)
