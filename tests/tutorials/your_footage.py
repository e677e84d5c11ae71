# %% [markdown]
# # Your footage
#
# `servobench track` follows a target through your video: no world, no robot. Here the video is
# filmed by our simulated camera, which stands while the car drives about and a board hides it; put
# your own file in its place and leave out the truth. Formats and truths:
# [follow a target in any pictures](../../tracking/README.md#follow-a-target-in-any-pictures).
#
# %%
import csv
import os
import subprocess
import sys
from pathlib import Path

import cv2
import matplotlib.pyplot as plt
import numpy as np

import servo

OUT = Path(os.environ.get("SERVOBENCH_TUTORIALS", "."))
FILM, TRUTH, RATE = OUT / "film.mp4", OUT / "truth.csv", 30.0

# %%
scenario = servo.load(
    "wander",
    [
        "run.duration=5",
        "controller.kind=hold",
        "disturbances=[{kind='board', start=2.5, duration=0.5}]",
    ],
)
film = cv2.VideoWriter(str(FILM), cv2.VideoWriter.fourcc(*"mp4v"), RATE, (320, 240))
with TRUTH.open("w", newline="") as file:
    rows = csv.writer(file)
    rows.writerow(["frame", *(f"{axis}{i}" for i in range(1, 5) for axis in "xy")])
    for step in servo.run(scenario):
        film.write(cv2.cvtColor(step.frame.image, cv2.COLOR_RGB2BGR))
        rows.writerow([step.frame.index, *step.truth.corners.ravel()])
        if step.frame.index == 0:
            left, top = step.truth.corners.min(axis=0)
            width, height = np.ptp(step.truth.corners, axis=0)
film.release()

# %% [markdown]
# The region is where the target is in the first picture: left, top, width, height [px]. Two
# trackers; each writes a row a picture, a report and an annotated video.
#
# %%
region = f"{left:.1f},{top:.1f},{width:.1f},{height:.1f}"
for tracker in ("pf_ssd", "camshift"):
    video = ["--video", str(OUT / f"{tracker}.mp4")]
    out = ["--out", str(OUT / tracker), "--truth", str(TRUTH), *video, "--quiet"]
    words = ["track", str(FILM), "--region", region, "--tracker", tracker, *out]
    subprocess.run([sys.executable, "-m", "servo", *words], check=True)


# %%
def track(folder: str) -> tuple[np.ndarray, np.ndarray]:
    """Places (n, 2) [px], and whether the tracker said that it sees the target (n,)."""
    with (OUT / folder / "track.csv").open() as file:
        rows = list(csv.DictReader(file))
    places = np.array([[float(row["x"]), float(row["y"])] for row in rows])
    return places, np.array([row["status"] == "LOCKED" for row in rows])


truth = np.loadtxt(TRUTH, delimiter=",", skiprows=1)[:, 1:].reshape(-1, 4, 2).mean(axis=1)
figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
for tracker in ("pf_ssd", "camshift"):
    places, seen = track(tracker)
    error = np.linalg.norm(places - truth, axis=1)
    times = np.arange(len(error)) / RATE
    (line,) = axes.plot(times, error, label=tracker)
    axes.plot(times[~seen], error[~seen], ".", color=line.get_color())
    print(
        f"{tracker}: {np.sqrt(np.mean(error[seen] ** 2)):.2f} px rms where it sees the car, "
        f"which is in {100 * seen.mean():.0f} % of the pictures"
    )
axes.set(xlabel="time [s]", ylabel="error [px]", title="dots: not LOCKED")
axes.legend()
figure.savefig(OUT / "your_footage.png", dpi=120)
