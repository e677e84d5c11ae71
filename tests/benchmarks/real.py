"""Trackers in the loop and open loop on real recordings:

    uv run python tests/benchmarks/real.py run ROWS.jsonl [FOLDER ...] [trackers=NAME,...] [seeds=N]
    uv run python tests/benchmarks/real.py table ROWS.jsonl
    uv run python tests/benchmarks/real.py sheets ROWS.jsonl OUT [trackers=NAME,...]

`run` adds a line to ROWS.jsonl for each tracker, recording, mode and seed that is not there yet, so
that it can be stopped; `table` prints the tables of tracking/RESULTS.md; `sheets` writes a page
with a picture of where each tracker loses its target in each recording, in the loop.

In the loop, the camera of a pan-tilt head turns inside the recording ([recording] of a scenario,
`run.latency` of one picture); open loop, the tracker gets the recorded pictures. Without a folder,
the recordings are those in the folders that SERVOBENCH_SEQUENCES names.

The rule, written before the first run: a score is the mean overlap (IoU) of estimated and true
outline over the pictures that show the target, without the first; held: the overlap is above 0 in
half of the last ten of these pictures; rms: distance of the centres over the target's size, of at
most 10; lost: share of pictures without overlap; recovered: how often the overlap exceeds .2 after
ten or more pictures without any. Kendall's tau-b is that of the trackers' mean scores; its
interval is over recordings, by a bootstrap.
"""

import json
import os
import sys
from itertools import groupby
from pathlib import Path

import cv2
import numpy as np
from scipy.stats import kendalltau

from servo.bench import benchmark
from servo.bench.row import shipped_rows
from servo.bench.score import standings
from servo.loop.episode import Episode
from servo.loop.settings import stream
from servo.scenario.load import load
from servo.scenario.part_names import changes_of
from servo.scenario.recording import recorded_of
from sim.files.picture_file import rgb
from sim.outline import area
from sim.types import Frame
from tracking.drawing.contact_sheet import page, tile
from tracking.evaluation.track_measures import turned_overlaps
from tracking.sequences.quadrilateral import placement
from tracking.sequences.sources import Picture
from tracking.statistics.comparisons import mean_of

OWN = [
    "annealed",
    "hybrid",
    "kams",
    "pf_ssd",
    "mk_ssd",
    "texture_pf",
    "condensation",
    "mean_shift",
    "camshift",
    "cv_mean_shift",
    "kernel_pf",
    "mk_pf",
    "sok",
    "texture_ms",
    "homography",
    "frozen",
]
CONTRIBUTED = {"mil": "MIL", "csrt": "CSRT", "kcf": "KCF"}
"""OpenCV's trackers, by the names of their rows in `loop-v1`; most need opencv-contrib-python."""
DRAW = ["annealed", "hybrid", "kams", "pf_ssd", "texture_pf", "condensation", "kernel_pf", "mk_pf"]
"""The trackers that draw random numbers: the others have one seed."""
RATE = 30.0
FARTHEST = 10.0
AGAIN = 0.2
GONE = 10
LAST = 10
DRAWS = 2000


def settings_of(name):
    """Return the settings that name a tracker of this study."""
    if name in CONTRIBUTED:
        return ["tracker.kind=opencv", f"tracker.name={CONTRIBUTED[name]}"]
    if name.startswith("onnx:"):
        return changes_of(name, None)
    kind, _, preset = name.partition(":")
    return [f"tracker.kind={kind}", *([f"tracker.preset={preset}"] if preset else [])]


def scenario_of(recording, name, seed):
    """Return the scenario in which a tracker follows the target of a recording."""
    truth = sorted(recording.glob("groundtruth*"))
    given = [f"recording.pictures={recording}", "goal.depth=1.0", "run.latency=1"]
    if len(truth) > 1:
        given.append(f"recording.truth={truth[0]}")
    return load("recording", [*given, "vary={}", *settings_of(name)], seed=seed)


def in_the_loop(recording, name, seed):
    """Return the estimated and the true corners (n, 4, 2) of each picture of a run after the first,
    whether it shows the target (n,), and the pictures.
    """
    found, true, shown, pictures = [], [], [], []
    with Episode(scenario_of(recording, name, seed)) as episode:
        region = episode.shown[1]
        for step in episode:
            found.append(step.estimate.outline(region))
            true.append(step.truth_estimated.corners)
            shown.append(step.truth_estimated.visible == 1)
            pictures.append(cv2.imencode(".jpg", step.frame.image[..., ::-1])[1])
    return np.stack(found)[1:], np.stack(true)[1:], np.array(shown)[1:], pictures[1:]


def open_loop(recording, name, seed):
    """Return the same of a tracker that gets the recorded pictures."""
    scenario = scenario_of(recording, name, seed)
    recorded = recorded_of(scenario.recording)
    tracker = scenario.tracker.build(stream(seed, "tracker"))
    region, start = placement(recorded.corners[0])
    found = []
    for index, (time, image) in enumerate(recorded.pictures()):
        frame = Frame(image, time, index)
        if index == 0:
            tracker.start(frame, region, start)
        else:
            found.append(tracker.update(frame).outline(region))
    true = recorded.corners[1 : len(found) + 1]
    return np.stack(found), true, np.isfinite(true).all(axis=(1, 2)), []


def judged(found, true, shown):
    """Return the entries of a row, by the rule above."""
    found, true = found[shown], true[shown]
    overlaps = turned_overlaps(found, true)
    sizes = np.sqrt([max(area(corners), 1.0) for corners in true])
    off = np.linalg.norm(found.mean(axis=1) - true.mean(axis=1), axis=1) / sizes
    gone = recovered = 0
    for overlap in overlaps:
        recovered += gone >= GONE and overlap > AGAIN
        gone = gone + 1 if overlap == 0 else 0 if overlap > AGAIN else gone
    return {
        "score": float(overlaps.mean()),
        "held": bool((overlaps[-LAST:] > 0).mean() >= 0.5),
        "rms": float(np.sqrt(np.mean(np.minimum(off, FARTHEST) ** 2))),
        "lost": float((overlaps == 0).mean()),
        "recovered": int(recovered),
        "n": len(overlaps),
    }


MODES = {"loop": in_the_loop, "open": open_loop}


def run(file, folders, names, seeds):
    """Add the missing rows to a file."""
    done = {tuple(row["key"]) for row in rows_in(file)} if file.exists() else set()
    recordings = sorted(each for folder in folders for each in Path(folder).iterdir())
    keys = [
        (name, recording, mode, seed)
        for name in names
        for seed in range(seeds if name.partition(":")[0] in DRAW else 1)
        for recording in recordings
        for mode in MODES
    ]
    with file.open("a") as rows:
        for name, recording, mode, seed in keys:
            key = (name, recording.name, mode, seed)
            if key in done:
                continue
            try:
                row = judged(*MODES[mode](recording, name, seed)[:3])
            except Exception as error:
                row = {"score": 0.0, "held": False, "error": f"{type(error).__name__}: {error}"}
            rows.write(json.dumps({"key": key} | row) + "\n")
            rows.flush()
            sys.stdout.write(f"{' '.join(map(str, key))}: {row['score']:.3f}\n")


def rows_in(file):
    """Return the rows of a file."""
    return [json.loads(line) for line in file.read_text().splitlines()]


def means(rows, entry):
    """Return an entry's mean over seeds, for each tracker, mode and recording: {tracker: {mode:
    {recording: mean}}}.
    """
    found = {}
    for (name, recording, mode), group in groupby(
        sorted(rows, key=lambda row: row["key"][:3]), key=lambda row: tuple(row["key"][:3])
    ):
        values = [float(row.get(entry, FARTHEST if entry == "rms" else 0.0)) for row in group]
        found.setdefault(name, {}).setdefault(mode, {})[recording] = float(np.mean(values))
    return found


def table(file):
    """Print the tables."""
    rows = rows_in(file)
    scores = means(rows, "score")
    names = sorted(scores, key=lambda name: -np.mean([*scores[name]["loop"].values()]))
    entries = {entry: means(rows, entry) for entry in ("score", "held", "rms", "lost", "recovered")}
    sys.stdout.write("| tracker | IoU, 95 % | IoU, open loop | held | rms | lost | recovered |\n")
    sys.stdout.write("|---|---|---|---|---|---|---|\n")
    for name in names:
        cells = {
            entry: [np.array([*by_mode[name][mode].values()]) for mode in MODES]
            for entry, by_mode in entries.items()
        }
        both = [
            ", ".join(f"{each.mean():.2f}" for each in cells[entry])
            for entry in ("held", "rms", "lost", "recovered")
        ]
        score = mean_of(cells["score"][0], 0.0, 1.0)
        words = f"{score.value:.2f}, {score.low:.2f} to {score.high:.2f}"
        opened = f"{cells['score'][1].mean():.2f}"
        sys.stdout.write(f"| `{name}` | {' | '.join([words, opened, *both])} |\n")
    recordings = sorted(scores[names[0]]["loop"])
    columns = {
        mode: np.array([[scores[name][mode][each] for each in recordings] for name in names])
        for mode in MODES
    }
    rendered = loop_v1(names)
    sys.stdout.write("\n| Kendall's tau-b | value | 95 % |\n|---|---|---|\n")
    pairs = {
        "in the loop and open loop": (columns["loop"], columns["open"]),
        "in the loop and `loop-v1`": (columns["loop"], rendered),
        "open loop and `loop-v1`": (columns["open"], rendered),
    }
    for words, pair in pairs.items():
        value, low, high = tau(*pair)
        sys.stdout.write(f"| {words} | {value:.2f} | {low:.2f} to {high:.2f} |\n")


def loop_v1(names):
    """Return each tracker's published score in `loop-v1` (n, 1), nan where it has none."""
    table = standings(shipped_rows(benchmark.load("loop-v1")))
    scores = {standing.name: standing.score.value for standing in table}
    return np.array([[scores.get(name, np.nan)] for name in names])


def tau(a, b):
    """Return Kendall's tau-b of the rows' means in two tables (trackers, recordings), and the ends
    of its interval over recordings; a table with one column is kept in each draw.
    """
    known = np.isfinite(a).all(axis=1) & np.isfinite(b).all(axis=1)
    a, b = a[known], b[known]
    rng = np.random.default_rng(0)
    count = max(a.shape[1], b.shape[1])
    drawn = []
    for _ in range(DRAWS):
        which = rng.integers(count, size=count)
        means = [(each[:, which] if each.shape[1] > 1 else each).mean(axis=1) for each in (a, b)]
        drawn.append(kendalltau(*means).statistic)
    value = kendalltau(a.mean(axis=1), b.mean(axis=1)).statistic
    return value, *np.nanquantile(drawn, (0.025, 0.975))


def sheets(file, out, names):
    """Write a page with a contact sheet for each tracker: of each recording the first of ten or
    more pictures without overlap, or else the last picture.
    """
    out.mkdir(parents=True, exist_ok=True)
    folders = {each.name: each for folder in folders_given([]) for each in Path(folder).iterdir()}
    parts = []
    for name in names:
        scores = {r["key"][1]: r["score"] for r in rows_in(file) if r["key"][0] == name}
        tiles = []
        for recording in sorted(scores):
            found, true, shown, pictures = in_the_loop(folders[recording], name, 0)
            overlaps = np.ones(len(found))
            overlaps[shown] = turned_overlaps(found[shown], true[shown])
            at = lost_at(overlaps)
            image = rgb(cv2.imdecode(pictures[at], cv2.IMREAD_COLOR))
            seen = Picture(f"{recording} {at + 1}", at / RATE, image)
            tiles.append(tile(seen, true[at], found[at]))
        cv2.imwrite(str(out / f"{name}.jpg"), page(tiles)[..., ::-1])
        parts.append(f'<h2>{name}</h2><img src="{name}.jpg">')
        sys.stdout.write(f"{out / name}.jpg\n")
    (out / "index.html").write_text("<title>Real recordings</title>" + "\n".join(parts))


def lost_at(overlaps):
    """Return the index of the first of `GONE` pictures without overlap; else that of the last."""
    gone = np.convolve(overlaps == 0, np.ones(GONE), "valid") == GONE
    return int(np.argmax(gone)) if gone.any() else len(overlaps) - 1


def folders_given(words):
    """Return the folders of recordings among the arguments, or those of the environment."""
    given = [word for word in words if "=" not in word]
    given = given or os.environ.get("SERVOBENCH_SEQUENCES", "").split(os.pathsep)
    if not all(map(os.path.isdir, given)):
        sys.exit("name folders of recordings, or set SERVOBENCH_SEQUENCES to them")
    return given


def main():
    """Do what the first argument says."""
    action, file, *words = sys.argv[1:]
    options = dict(word.split("=", 1) for word in words if "=" in word)
    names = options.get("trackers", ",".join([*OWN, *CONTRIBUTED])).split(",")
    if action == "run":
        run(Path(file), folders_given(words), names, int(options.get("seeds", 3)))
    elif action == "sheets":
        sheets(Path(file), Path(words[0]), names)
    else:
        table(Path(file))


if __name__ == "__main__":
    main()
