# %% [markdown]
# # Your tracker
#
# A class with `init` and `update`, as in `median_flow.py`, is a tracker. Three questions: does it
# keep the contract that all trackers keep, how well does it follow beside others, and does it hold
# a robot on its target? [Use your own tracker](../../tracking/README.md#use-your-own-tracker) has
# more.
#
# %%
import csv
import os
import subprocess
import sys
from pathlib import Path

import matplotlib.pyplot as plt

HERE = Path(__file__).parent if "__file__" in globals() else Path()
OUT = Path(os.environ.get("SERVOBENCH_TUTORIALS", "."))
sys.path.insert(0, str(HERE))  # where median_flow.py is

import numpy as np
from median_flow import MedianFlow

import servo
from servo.testing import BrokenContract, check_tracker

# %% [markdown]
# The contract: pictures from 1 x 1 to 4K, any region, finite numbers, a reused buffer. Of the first
# version it said "a tiny picture of 9 x 7 px made update raise error: OpenCV ... in function
# 'calc'; return the last state as LOST instead": a picture may have another size than the last.
#
# %%
try:
    check_tracker("median_flow:MedianFlow")
    print("contract: kept")
except BrokenContract as error:
    print(f"contract: {error}")

# %% [markdown]
# Beside another, on a painted sequence with exact truth: the target moves, turns, grows and is
# hidden. More sequences, your own among them, and more seeds make it a comparison with intervals:
# [compare trackers](../../tracking/README.md#compare-trackers).
#
# %%
suite = OUT / "suite.toml"
suite.write_text('[[sequences]]\nkind = "similarity"\nframes = 120\n')
bench = [sys.executable, "-m", "servo", "bench", str(suite), "--seeds", "1", "--workers", "1"]
trackers = ["--trackers", "median_flow:MedianFlow,pf_ssd", "--out", str(OUT / "bench"), "--quiet"]
subprocess.run([*bench, *trackers], check=True, env=os.environ | {"PYTHONPATH": str(HERE)})
with (OUT / "bench" / "table.csv").open() as file:
    table = list(csv.DictReader(file))
for row in table:
    print(f"{row['tracker']}: success AUC {float(row['auc']):.2f}")

# %% [markdown]
# In the closed loop: the car drives on at 0.1 m/s. Only the tracker differs.
#
# %%
figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
errors = {}
for name, part in (("median flow", {"tracker": MedianFlow}), ("pf_ssd", {})):
    scenario = servo.load("line", ["run.duration=4.0"], **part)
    steps = [(step.frame.time, step.servo_error) for step in servo.run(scenario)]
    times, errors[name] = np.array(steps).T
    axes.plot(times, errors[name], label=name)
axes.set(xlabel="time [s]", ylabel="true error [px]", ylim=(0, None))
axes.legend()
figure.savefig(OUT / "your_tracker.png", dpi=120)
rms = {name: np.sqrt(np.mean(error[60:] ** 2)) for name, error in errors.items()}
print(f"median flow holds the car within {rms['median flow']:.2f} px, pf_ssd {rms['pf_ssd']:.2f}")
