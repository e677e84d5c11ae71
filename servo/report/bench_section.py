"""The section of an HTML report about `servobench evaluate`: trackers compared on sequences."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from servo.mistake import Mistake
from servo.report import page
from servo.report.charts import Curve, Scale, colour, curves
from servo.report.page import LIGHT, Block, Fact, Figure, PageImage, Section, again
from servo.report.study_data import missing
from servo.report.words import Badge, Table, Tone, basis, cut, shown, spread
from servo.study import ranking
from servo.study.ranking import Rank
from servo.study.run import Record
from servo.study.sequence_run import PRECISION_CURVE, SUCCESS_CURVE, TRACKER
from servo.study.store import Store, StudyFile
from sim.types import Array
from tracking.evaluation.track_measures import OVERLAPS, PIXELS
from tracking.statistics.comparisons import Interval

CURVES = {
    "Success": (SUCCESS_CURVE, OVERLAPS, "overlap threshold", "share of frames above"),
    "Precision": (PRECISION_CURVE, PIXELS, "error threshold [px]", "share of frames within"),
}
"""By title of the figure: the series of the runs that it shows, the thresholds of this series, and
the titles of the two axes."""
SHEETS = "sheets"
MOST_SHEETS = 24
SURE = 0.05
"""A smaller p value counts as a difference between two trackers."""


def section(folder: Path, study: StudyFile) -> Section:
    """Return the section of an HTML report about a folder that `servobench evaluate` wrote: ranking
    of the trackers, curves, contact sheets and runs.

    Args:
        folder: The folder.
        study: Content of its study.json.

    Raises:
        Mistake: A file is missing or damaged, or there are no finished runs.
        Refused: The database of the runs cannot be read.
    """
    store = Store(folder)
    store.find()
    records = list(store.read(sorted(store.done), long=True))
    if not records:
        raise Mistake(
            f"{folder}: this folder has no finished runs; repeat the command that wrote it"
        )
    ranks = ranking.ranked(records)
    best = ranks[0]
    families = families_table(ranks)
    blocks = [
        Block(
            "Trackers",
            missing(study, store),
            points=against_best(ranks),
            tables=[trackers_table(ranks)],
            figures=_curves(records, [rank.tracker for rank in ranks]),
        ),
        *([Block("Success by sequence", tables=[families])] if families else []),
        *_sheets(folder, best.tracker),
        _runs(records),
        again(study),
    ]
    score = best.means.get(ranking.RANKS)
    facts = [
        Fact("best tracker", best.tracker),
        Fact(
            "its success AUC",
            shown(score.value if score else None),
            basis(score, ranking.UNIT) if score else "",
        ),
        Fact("trackers", str(len(ranks))),
        Fact("sequences", str(best.units or len({r.subject for r in records}))),
        Fact("runs", str(len(records))),
    ]
    whole = len(records) == study.runs
    verdict = f"best: {best.tracker}" if whole else f"{len(records)} of {study.runs} runs"
    return Section(
        "evaluate",
        folder.resolve().name,
        study.title,
        Badge(verdict, Tone.PLAIN),
        facts,
        blocks,
        str(folder),
    )


def against_best(trackers: Sequence[Rank]) -> list[str]:
    """Return sentences that say which trackers are worse than the best one by McNemar's test, which
    are better, and which are not distinguished from it.

    Args:
        trackers: The trackers, the best one first.
    """
    best = trackers[0].tracker
    # The test is that of each tracker against the best, which may be worse by the test.
    surely = [(t.tracker, t.against_best) for t in trackers[1:] if t.p < SURE]
    better = [name for name, test in surely if test and test.wins > test.losses]
    worse = [name for name, test in surely if test and test.wins < test.losses]
    alike = [t.tracker for t in trackers[1:] if t.p >= SURE]
    sentences = {
        f"{best} tracks for longer than {', '.join(worse)} (McNemar, p < {SURE:g}).": worse,
        f"{', '.join(better)} tracks for longer than {best} (McNemar, p < {SURE:g}).": better,
        f"Not distinguished from {best} by these runs: {', '.join(alike)}.": alike,
    }
    return [sentence for sentence, others in sentences.items() if others]


def trackers_table(trackers: Sequence[Rank]) -> Table:
    """Return the table of trackers in the given order: means of their measures over the sequences,
    and McNemar's test (z and p) against the best tracker, blank for the best one itself.

    Args:
        trackers: The trackers with their means, the best one first.
    """
    rows: list[list[str]] = []
    for t in trackers:
        means = {title: t.means.get(name) for title, name in ranking.SHOWN.items()}
        cells = {title: _mean(mean, t.units) for title, mean in means.items()}
        cells[ranking.INTERVAL] = spread(means[ranking.INTERVAL])
        end = [shown(t.against_best.z), f"{t.p:.3g}"] if t.against_best else ["", ""]
        rows.append([t.tracker, str(t.units), *cells.values(), *end])
    return Table(
        ("tracker", "n", *ranking.SHOWN, "z", "p"), rows, note=" ".join(ranking.LEGEND.split())
    )


def _curves(records: Sequence[Record], trackers: Sequence[str]) -> list[Figure]:
    """Return the success and precision curves of the trackers (Wu, Lim and Yang, 2013), each a mean
    over the tracker's runs.
    """
    return [
        curves(
            title,
            Scale(x),
            Scale(y, low=0.0, high=1.02),
            [
                Curve(
                    tracker,
                    thresholds,
                    _mean_curve(records, name, tracker),
                    colour=colour(i),
                    dashed=bool(i // len(LIGHT) % 2),  # the colours begin again
                )
                for i, tracker in enumerate(trackers)
            ],
        )
        for title, (name, thresholds, x, y) in CURVES.items()
    ]


def _mean_curve(records: Sequence[Record], name: str, tracker: str) -> Array:
    """Return the mean of a series over the runs of a tracker."""
    return np.mean([r.series[name] for r in records if r.settings[TRACKER] == tracker], axis=0)


def _mean(mean: Interval | None, units: int) -> str:
    """Return a mean over sequences as text; if it is over fewer sequences than `units`, with their
    number: "0.61 (3 of 5)".
    """
    if mean is None:
        return shown(None)
    return shown(mean.value) + f" ({mean.units} of {units})" * (0 < mean.units < units)


def families_table(trackers: Sequence[Rank]) -> Table | None:
    """Return a table of each tracker's mean area under the success curve (AUC) on each sequence
    (over its seeds), or None if there is only one sequence. Each tracker has a column and each
    sequence a row, or the other way round if there are fewer sequences than trackers.

    Args:
        trackers: The trackers with their means, the best one first.
    """
    names = list(trackers[0].families)
    if len(names) < 2:
        return None
    head: list[str] = ["sequence", *(t.tracker for t in trackers)]
    rows = [[name, *(shown(t.families.get(name)) for t in trackers)] for name in names]
    if len(names) < len(trackers):
        head, *rows = map(list, zip(["tracker", *head[1:]], *rows, strict=True))
    return Table(head, rows, note="Mean success AUC.")


def _sheets(folder: Path, best: str) -> list[Block]:
    paths = sorted((folder / SHEETS).glob("*.png"))
    if not paths:
        return []
    text = [
        f"The first seed of each sequence: truth white, {best} green.",
        *filter(None, [cut("sheets", paths, MOST_SHEETS)]),
    ]
    return [
        Block(
            "Contact sheets",
            text,
            pictures=[PageImage.read(path, path.stem, sheet=True) for path in paths[:MOST_SHEETS]],
        )
    ]


def _runs(runs: Sequence[Record]) -> Block:
    names = list(runs[0].measures)
    rows = (
        [r.settings[TRACKER], r.subject, str(r.seed), *(shown(r.row[n]) for n in names)]
        for r in runs
    )
    return page.rows_of("runs", ("tracker", "sequence", "seed", *names), rows, len(runs), range(2))
