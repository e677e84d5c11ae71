"""The section of an HTML report about an accuracy budget (what each source of error, such as a
wrong focal length, contributes to the error at the end of a run): a sentence, the table, and the
plot.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from servo.budget.plan import Part
from servo.report import page
from servo.report.charts import stacked
from servo.report.page import Block, Fact, Figure, Section
from servo.report.words import Badge, Table, Tone, shown
from servo.study.store import StudyFile
from sim.types import Array

UNITS = ("mm", "deg", "px")
MOST_NAMED = 3
"""Most sources that the sentence names."""
LEAST_NAMED = 0.2
"""The sentence names contributions that are above this share of the whole error."""
ALONE = (
    "A contribution is sqrt(mean square error with this source alone - that with nothing wrong; "
    "for noise and resolution - that of the tracker). Errors of a calibration have a sign or a "
    "direction that each seed draws. Errors in the picture are in px of the scenario's "
    "own resolution, rms over the last second."
)
DIVIDED = "Each bar is the error with all of them, divided as the squares of the contributions."


def section(
    parts: Sequence[Part], left_out: Mapping[str, str], made: StudyFile, folder: Path
) -> Section:
    """Return the section of an HTML report about an accuracy budget.

    Args:
        parts: Errors with nothing wrong, with each source of error alone, and with all together, in
            this order.
        left_out: Reasons by the names of the sources that the scenario cannot have.
        made: Description of the runs: the scenario, the command and its versions.
        folder: The folder of the runs.
    """
    reasons = [f"{name}: {reason}" for name, reason in left_out.items()]
    blocks = [
        Block("Alone and together", figures=[picture(parts)], tables=[table(parts)]),
        Block("Left out", points=reasons or ["nothing"]),
        page.again(made),
    ]
    errors = zip(UNITS, parts[-1].error.tolist(), strict=True)
    facts = [Fact(unit, shown(error), "together") for unit, error in errors]
    badge = Badge(f"{len(parts) - 2} sources", Tone.PLAIN)
    title = f"{', '.join(made.scenarios)}, accuracy budget"
    return Section("budget", title, sentence(parts), badge, facts, blocks, str(folder))


def summed(parts: Sequence[Part]) -> Array:
    """Return the root of the sum of squares of the errors (3,) [mm, deg, px] of all parts of a
    budget but the last, which is that of all sources together.
    """
    return np.linalg.norm([part.error for part in parts[:-1]], axis=0)


def sentence(parts: Sequence[Part]) -> str:
    """Return an accuracy budget in a sentence, such as "At the end 0.8 mm, of which the mount
    rotation is 0.6; ...". In each of the units mm, deg and px it names up to three sources whose
    contribution is above a fifth of the whole error. Contributions are scaled down by one factor
    if the root of their sum of squares would exceed the whole error.

    Args:
        parts: Errors with nothing wrong, with each source of error alone, and with all together, in
            this order.
    """
    found = list[str]()
    whole = parts[-1].error
    # Parts that are larger than the whole, by chance or as signs cancel, are made smaller.
    factors = np.minimum(1.0, whole / np.maximum(summed(parts), 1e-300))
    for i, unit in enumerate(UNITS):
        each = {part.name: float(factors[i] * part.error[i]) for part in parts[1:-1]}
        largest = sorted(each, key=lambda name: -each[name])[:MOST_NAMED]
        named = [
            f"the {name.replace('_', ' ')} is {shown(each[name])}"
            for name in largest
            if each[name] > LEAST_NAMED * whole[i]
        ]
        of = f", of which {' and '.join(named)}" if named else ""
        floor = float(parts[0].error[i])
        said = f" ({shown(floor)} with nothing wrong)" if floor > LEAST_NAMED * whole[i] else ""
        found.append(f"{shown(float(whole[i]))} {unit}{said}{of}")
    return f"At the end {'; '.join(found)}."


def table(parts: Sequence[Part]) -> Table:
    """Return the table of an accuracy budget: a row for each part with its magnitude, its errors
    [mm, deg, px], the error by linear theory [mm], and how many of the runs succeeded; before the
    last row, the root of the sum of squares.

    Args:
        parts: Errors with nothing wrong, with each source of error alone, and with all together, in
            this order.
    """
    rows = [
        [p.name, p.magnitude, *map(shown, p.error.tolist()), shown(p.theory), p.success]
        for p in parts
    ]
    rows.insert(-1, ["root of the sum of squares", "", *map(shown, summed(parts).tolist()), "", ""])
    head = ("source", "magnitude", *UNITS, "theory, mm", "success")
    return Table(head, rows, words=range(2), note=ALONE)


def picture(parts: Sequence[Part]) -> Figure:
    """Return the plot of an accuracy budget: a bar for each of the units mm, deg and px, divided in
    proportion to the squares of the parts' errors.

    Args:
        parts: Errors with nothing wrong, with each source of error alone, and with all together, in
            this order; the last labels the bars.
    """
    squares = np.square([part.error for part in parts[:-1]])
    shares = squares / np.maximum(squares.sum(axis=0), 1e-300)
    errors = zip(parts[-1].error.tolist(), UNITS, strict=True)
    labels = [f"{shown(error)} {unit}" for error, unit in errors]
    title = "Share of each source in the error at the end"
    return stacked(title, labels, [part.name for part in parts[:-1]], shares, note=DIVIDED)
