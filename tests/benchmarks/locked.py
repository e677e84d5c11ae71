"""How often a tracker is LOCKED beside its target, and LOST on it, in recordings:

    uv run python tests/benchmarks/locked.py [FOLDER ...] [seeds=N] [trackers=NAME,NAME:PRESET]

Without a folder, those that SERVOBENCH_SEQUENCES names are read, as OTB, VOT or TLD have them; as a
path, it may name several. The first picture, in which the region is given, does not count. A seed
is a draw of the tracker; recordings are averaged over seeds, and intervals are over recordings.
"""

import os
import sys
from pathlib import Path

import numpy as np

import tracking
from sim.types import Frame
from tracking.evaluation.track_measures import HALF, ON_TARGET, box_overlaps, seen_in
from tracking.sequences.quadrilateral import boxes
from tracking.sequences.sequence import read_all
from tracking.statistics.comparisons import mean_percent
from tracking.types import Status

TRACKERS = "annealed,annealed:video,kams,mk_pf,mk_pf:video,pf_ssd,pf_ssd:video"
RATE = 30.0


def made(name, seed):
    """Return a tracker of a name, with a preset after a colon or without one."""
    kind, _, preset = name.partition(":")
    return tracking.create(kind, seed=seed, **({"preset": preset} if preset else {}))


def followed(sequence, names, seeds):
    """Return the statuses and the corners that each tracker gives to each picture after the first
    one; all get a picture together, so that it is read once.
    """
    region = sequence.region
    trackers = {(name, seed): made(name, seed) for name in names for seed in range(seeds)}
    statuses = {key: [] for key in trackers}
    corners = {key: [] for key in trackers}
    for index, picture in enumerate(sequence.source):
        frame = Frame(picture.image, picture.time, index)
        for key, tracker in trackers.items():
            if index == 0:
                tracker.start(frame, region, sequence.start)
                continue
            found = tracker.update(frame)
            statuses[key].append(found.status)
            corners[key].append(found.outline(region))
    return {key: (np.array(statuses[key]), np.stack(corners[key])) for key in trackers}


def counted(statuses, corners, truth):
    """Return the pictures LOCKED beside the target, all LOCKED, LOST on the target, all on it.

    Beside it is an overlap of the upright boxes below `ON_TARGET`, or no target at all; on it is
    one above `HALF`.
    """
    count = min(len(truth), len(corners))
    seen = seen_in(truth[:count])
    overlaps = np.zeros(count)
    overlaps[seen] = box_overlaps(boxes(corners[:count][seen]), boxes(truth[:count][seen]))
    locked = statuses[:count] == Status.LOCKED
    lost = statuses[:count] == Status.LOST
    beside = overlaps < ON_TARGET
    on = overlaps > HALF
    return np.array([(locked & beside).sum(), locked.sum(), (lost & on).sum(), on.sum()])


def shares(counts):
    """Return two shares (..., 2) of counts (..., 4); nan where there is nothing to share."""
    with np.errstate(invalid="ignore"):
        return counts[..., ::2] / counts[..., 1::2]


def told(title, rows, names):
    """Return a table: a line a recording, the worst first; then all pictures, and the mean over
    recordings.

    Args:
        title: Its name.
        rows: For each recording its name and counts (trackers, 4), summed over seeds.
        names: The trackers.
    """
    table = shares(np.array([counts for _, counts in rows], float))
    lines = []
    for column, what in enumerate(
        ("LOCKED pictures that are wrong", "right pictures that are LOST")
    ):
        part = table[:, :, column]
        lines += [f"{title}: {what} [%]", f"{'':24}" + "".join(f"{name:>16}" for name in names)]
        for at in np.argsort(-np.nan_to_num(part).max(axis=1)):
            cells = "".join(f"{100 * share:16.0f}" for share in part[at])
            lines.append(f"{rows[at][0]:24}{cells}")
        pooled = shares(np.sum([counts for _, counts in rows], axis=0).astype(float))[:, column]
        lines.append(f"{'all pictures':24}" + "".join(f"{100 * share:16.0f}" for share in pooled))
        means = [mean_percent(of[np.isfinite(of)]) for of in part.T]
        cells = "".join(f"{f'{m.value:.0f} ({m.low:.0f} to {m.high:.0f})':>16}" for m in means)
        lines += [f"{'mean of recordings':24}{cells}", ""]
    return "\n".join(lines)


def main(*words):
    options = dict(word.split("=", 1) for word in words if "=" in word)
    folders = [word for word in words if "=" not in word]
    folders = folders or os.environ["SERVOBENCH_SEQUENCES"].split(os.pathsep)
    names = options.get("trackers", TRACKERS).split(",")
    seeds = int(options.get("seeds", "1"))
    for folder in folders:
        rows = []
        for sequence in read_all(Path(folder), RATE):
            found = followed(sequence, names, seeds)
            counts = {key: counted(*of, sequence.truth[1:]) for key, of in found.items()}
            summed = [sum(counts[name, seed] for seed in range(seeds)) for name in names]
            rows.append((sequence.name, np.array(summed)))
            sys.stderr.write(f"{sequence.name} {np.array(summed).tolist()}\n")
        sys.stdout.write(told(Path(folder).name, rows, names))


if __name__ == "__main__":
    main(*sys.argv[1:])
