"""Claims of the PFJCTH paper (a particle filter with joint histograms of colour and texture): this
filter against mean shift, and joint histograms against histograms of colour or texture alone.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import islice

import numpy as np

from servo.papers.claim import FRESH, Claim, Effort, Evidence, Rule, Verdict, every
from servo.papers.experiments import contender, generated, sequence_jobs, states_found
from servo.papers.summaries import column, completed, dots, lines, mean, ratio, words
from servo.papers.tuning import published, tuned
from servo.study.run import Job
from servo.study.sequence_run import Contender, Generated
from sim.types import Array
from tracking.settings import PLAIN
from tracking.statistics.comparisons import mean_of, mean_percent
from tracking.statistics.verdicts import greater, not_worse

SEEDS = 20
LEAST_RATIO = 2.5
"""Least ratio of the RMSEs; in the paper they are 12.9 and 4.3 px, and 9.6 and 2.8 px."""
FILTER = "texture_pf"
SHIFT = "texture_ms"
TEXTURE = generated("texture")
ALIKE = 0.9
"""Least coefficient that counts as similar, relative to that at the truth."""
MOST_FRAMES = 0.9
"""Least share of frames with a similar coefficient."""
FOUND = "at the filter's estimate"
TRUTH = "at the truth"


def _one_size(tracker: Contender) -> Contender:
    """Return a mean-shift tracker without its search for the target's size."""
    return Contender(f"{tracker.label}-one-size", replace(tracker.config, scale=False))


def _jobs(effort: Effort) -> Sequence[Job]:
    """Return the runs of the particle filter, of mean shift, and of mean shift without its search
    for the target's size, with published and tuned settings.
    """
    pairs = [(of(FILTER), of(SHIFT)) for of in (published, tuned)]
    trackers = [c for ours, shift in pairs for c in (ours, shift, _one_size(shift))]
    return sequence_jobs(trackers, [TEXTURE], effort.seeds(SEEDS), effort.pictures)


def _judge_rmse(evidence: Evidence) -> Verdict:
    """Return the verdict on the claim P2-1 that mean shift's RMSE of the target's centre is more
    than 2.5 times that of the particle filter.
    """
    runs = evidence.trackers
    rmse = {label: column(found, "rmse_px") for label, found in runs.items()}
    times = {
        shift: ratio(rmse[shift], rmse[of(FILTER).label])
        for of in (published, tuned)
        for shift in (of(SHIFT).label, _one_size(of(SHIFT)).label)
    }
    rows = [
        [
            label,
            mean(found, "rmse_px", "px"),
            words(times[label]) if label in times else "",
            f"{column(found, 'auc').mean():.2f}",
            f"{100 * column(found, 'scale_rmse').mean():.0f} %",
        ]
        for label, found in runs.items()
    ]
    judged = [times[of(SHIFT).label] for of in (published, tuned)]
    return Verdict(
        every(greater(i, LEAST_RATIO) for i in judged),
        min(judged, key=lambda i: i.low),
        "times the filter's RMSE",
        len(runs[published(FILTER).label]),
        f"mean shift's RMSE {words(judged[0])} times the filter's with published settings, "
        f"{words(judged[1])} with own best",
        [["tracker", "RMSE", "over the filter's", "success AUC", "scale error"], *rows],
        dots("error of the centre", "RMSE [px]", rmse),
    )


def _jobs_likeness(effort: Effort) -> Sequence[Job]:
    """Return the runs of the particle filter with the settings of its paper."""
    return sequence_jobs([published(FILTER)], [TEXTURE], effort.seeds(SEEDS), effort.pictures)


def _judge_likeness(evidence: Evidence) -> Verdict:
    """Compute Bhattacharyya coefficients of histograms along the particle filter's tracks, and
    return the verdict on the claim P2-2 (see `judged`).
    """
    found = [
        coefficients(published(FILTER), run.seed, states_found(evidence.folder, run))
        for run in evidence.records
    ]
    return judged({place: np.array([one[place] for one in found]) for place in found[0]})


def coefficients(tracker: Contender, seed: int, track: Array) -> dict[str, Array]:
    """Return Bhattacharyya coefficients (1: equal) between the target's histogram in the first
    picture of a painted `texture` sequence and histograms in its other pictures.

    Args:
        tracker: The tracker whose kind of histogram is used.
        seed: Seed of the sequence.
        track: States that the tracker found (frames, 4): x, y [px], theta [rad], scale.

    Returns:
        Coefficients (frames - 1,), from 0 to 1, by the place where the histogram was taken: "at the
        filter's estimate" (`track`), "at the truth", and "5 px beside the truth" (to its right),
        and so with 10 and 20 px.
    """
    sequence = TEXTURE.build(seed)
    used = islice(sequence.source, len(track))
    pictures = [p.image for p in used if p.image is not None]
    assert sequence.states is not None
    truth = _logarithmic(sequence.states[: len(track)])
    places = {FOUND: _logarithmic(track), TRUTH: truth} | {
        f"{px} px beside the truth": truth + np.array([px, 0, 0, 0]) for px in (5, 10, 20)
    }
    model = tracker.config.model(pictures[0], sequence.region, sequence.start)
    stacked = np.stack(list(places.values()), axis=1)[1:]
    distances = np.array(
        [
            model.distances(model.label(image), states)
            for image, states in zip(pictures[1:], stacked, strict=True)
        ]
    )
    return dict(zip(places, 1 - distances.T**2, strict=True))


def _logarithmic(states: Array) -> Array:
    """Return states (n, 4) of x, y [px], theta [rad], ln scale from states of x, y, theta,
    scale.
    """
    return np.column_stack([states[:, :3], np.log(states[:, 3])])


def judged(rho: dict[str, Array]) -> Verdict:
    """Return the verdict on the claim P2-2: at the particle filter's estimate the Bhattacharyya
    coefficient (0 to 1; 1: equal histograms) is at least 0.9 times that at the true state, in more
    than 90 % of the frames. It holds if the 95 % interval of the mean share over sequences is above
    90 %.

    Args:
        rho: Coefficients (sequences, frames - 1) by the place where the histogram was taken:
            `FOUND` (the filter's estimate), `TRUTH`, and others some pixels beside the truth.
    """
    shares = {
        place: mean_percent(np.mean(values >= ALIKE * rho[TRUTH], axis=1))
        for place, values in rho.items()
    }
    head = ["place", "mean coefficient", f"frames at least {ALIKE:g} of the truth's [%]"]
    rows = [
        [place, words(mean_of(values.mean(axis=1))), words(shares[place])]
        for place, values in rho.items()
    ]
    share = shares[FOUND]
    return Verdict(
        greater(share, 100 * MOST_FRAMES),
        share,
        "% of the frames",
        len(rho[FOUND]),
        f"at least {ALIKE:g} of the truth's coefficient in {words(share, '%')} of the frames",
        [head, *rows],
        lines(
            "likeness to the target, one sequence",
            "frame",
            "Bhattacharyya coefficient",
            {place: (np.arange(len(values[0])), values[0]) for place, values in rho.items()},
            top=1,
        ),
    )


SEEDS_CAMOUFLAGE = 30
LOSES = 50.0
"""Largest share of sequences that colour alone completes [%]."""
JOINT = "joint"
TEXTURE_ALONE = "texture-alone"
COLOUR_ALONE = "colour-alone"
JOINT_AND_PARTS = (
    contender("texture_pf", "paper", JOINT),
    contender("texture_pf", "paper", TEXTURE_ALONE, levels=1),
    # With the settings of the joint filter's preset: the same search, on another histogram.
    contender(
        "condensation", None, COLOUR_ALONE, **PLAIN, scale_noise=0.03, density=24, scatter=0.0
    ),
)


def _judge_camouflage(evidence: Evidence) -> Verdict:
    """Return the verdict on the claim P2-3 that colour and texture together follow a target that
    neither follows alone.
    """
    runs = evidence.trackers
    rmse = {label: column(found, "rmse_px") for label, found in runs.items()}
    times = {label: ratio(rmse[label], rmse[JOINT]) for label in (TEXTURE_ALONE, COLOUR_ALONE)}
    nearest = min(times, key=lambda label: times[label].low)
    shares = {label: completed(found) for label, found in runs.items()}
    rows = [
        [
            label,
            mean(found, "rmse_px", "px"),
            words(times[label]) if label in times else "",
            words(shares[label]),
            f"{100 * column(found, 'scale_rmse').mean():.0f} %",
        ]
        for label, found in runs.items()
    ]
    best = [greater(one, 1.0) for one in times.values()]
    return Verdict(
        every([*best, not_worse(shares[COLOUR_ALONE], LOSES)]),
        times[nearest],
        "times the joint histogram's RMSE",
        len(runs[JOINT]),
        f"colour alone completes {words(shares[COLOUR_ALONE], '%')}; the nearest is {nearest}",
        [["histogram", "RMSE", "over the joint one's", "completed [%]", "scale error"], *rows],
        dots("a target in its ground's own colours", "RMSE [px]", rmse),
    )


def _jobs_camouflage(entry: Generated, effort: Effort) -> Sequence[Job]:
    """Return the runs of the particle filter with the joint histogram of colour and texture, and
    with each of them alone.
    """
    return sequence_jobs(JOINT_AND_PARTS, [entry], effort.seeds(SEEDS_CAMOUFLAGE), effort.pictures)


def _camouflage(name: str, says: str, entry: Generated, target: str) -> Claim:
    """Return the claim P2-3 about sequences with a camouflaged target; `says` is the claim, and
    `target` describes the target.
    """
    return Claim(
        name,
        f"colour and texture together follow what neither follows alone: {says}",
        Rule(
            "RMSE of the centre with colour alone, and with texture alone, over that with both; "
            "sequences completed by colour alone",
            "the paper's preset; the same filter with one histogram or the other",
            f"{SEEDS_CAMOUFLAGE} painted `camouflage` sequences, {target}, seeds from {FRESH} on",
            f"1; {LOSES:g} %",
            "95 % interval of the geometric mean ratio, and of the share",
            f"both ratios above 1, and colour completes less than {LOSES:g} %",
        ),
        _judge_camouflage,
        partial(_jobs_camouflage, entry),
    )


UNITS = f"{SEEDS} painted `texture` sequences, seeds from {FRESH} on"
CLAIMS = (
    Claim(
        "P2-1",
        "on targets that change size and speed the filter's RMSE is three times smaller "
        "than mean shift's",
        Rule(
            "RMSE of the centre of mean shift over the filter's",
            "mean shift searches for the size; published, and own best (tuning.json)",
            UNITS,
            f"{LEAST_RATIO:g}",
            "95 % interval of the geometric mean ratio",
            f"above {LEAST_RATIO:g} with both settings",
        ),
        _judge_rmse,
        _jobs,
    ),
    Claim(
        "P2-2",
        "the coefficient of the filter's estimate stays sufficiently high in most of the "
        "frames (figure 4)",
        Rule(
            "share of frames in which the Bhattacharyya coefficient at the estimate is at least "
            f"{ALIKE:g} of that at the truth",
            "published",
            UNITS,
            f"{100 * MOST_FRAMES:g} %",
            "95 % interval of the mean",
            f"above {100 * MOST_FRAMES:g} %",
        ),
        _judge_likeness,
        _jobs_likeness,
    ),
    _camouflage(
        "P2-3",
        "a target in a spread of its ground's colours",
        generated("camouflage", colours="spread", gravel=15),
        "whose target has a spread of its ground's own colours",
    ),
    _camouflage(
        "P2-3b",
        "a target in one colour with its ground",
        generated("camouflage"),
        "whose target and ground have shades of one colour bin",
    ),
)
