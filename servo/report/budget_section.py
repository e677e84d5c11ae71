"""The section of an HTML report about an accuracy budget: a sentence, the table, and the plot."""

from pathlib import Path

import numpy as np

from servo.budget.parts import NOTHING, TOGETHER, UNITS, BudgetFile
from servo.report import page
from servo.report.charts import stacked
from servo.report.page import Block, Fact, Figure, Section
from servo.report.words import NOTHING as DASH
from servo.report.words import Badge, Table, Tone, shown

MOST_NAMED = 3
"""Most sources that the sentence names."""
LEAST_NAMED = 0.2
"""Least contribution that it names, over the whole error."""
ALONE = (
    "A contribution is the root of the mean square error with this source alone, less that with "
    "nothing wrong (noise and resolution: less that of the tracker). Errors of a calibration have "
    "a sign or a direction that each seed draws. Errors in the picture are in px of the scenario's "
    "own resolution, rms over the last second."
)


def section(folder: Path) -> Section:
    """Return the section about a folder that `servobench budget` wrote.

    Raises:
        Mistake: The file budget.json is missing or damaged.
    """
    file = BudgetFile.read(folder / BudgetFile.FILE)
    reasons = [f"{name}: {reason}" for name, reason in file.left_out.items()]
    blocks = [
        Block("Alone and together", figures=[picture(file)], tables=[table(file)]),
        *([Block("Left out", points=reasons)] if reasons else []),
        page.again(file),
    ]
    facts = [Fact(unit, shown(file.together[i]), TOGETHER) for i, unit in enumerate(UNITS)]
    badge = Badge(f"{file.seeds} seeds", Tone.PLAIN)
    title = f"{file.scenario}, accuracy budget"
    return Section("budget", title, sentence(file), badge, facts, blocks, str(folder))


def sentence(file: BudgetFile) -> str:
    """Return the result in a sentence, such as "0.8 mm, of which the mount's rotation is 0.6"."""
    found = list[str]()
    for i, unit in enumerate(UNITS):
        whole = file.together[i]
        # Parts that are larger than the whole, by chance or as signs cancel, are made smaller.
        factor = min(1.0, whole / max(file.summed[i], 1e-300))
        parts = {part.words: factor * part.alone[i] for part in file.parts}
        largest = sorted(parts, key=lambda name: -parts[name])[:MOST_NAMED]
        named = [
            f"{name} is {shown(parts[name])}"
            for name in largest
            if parts[name] > LEAST_NAMED * whole
        ]
        of = f", of which {' and '.join(named)}" if named else ""
        found.append(f"{shown(whole)} {unit}{of}")
    return f"At the end {'; '.join(found)}."


def table(file: BudgetFile) -> Table:
    """Return the table of contributions, alone and together."""
    count = f"of {file.seeds}"
    rows = [
        [
            part.name,
            part.magnitude,
            *map(shown, part.alone),
            shown(part.theory),
            f"{part.success} {count}",
        ]
        for part in file.parts
    ]
    rows.append([NOTHING, "", *map(shown, file.floor), DASH, ""])
    rows.append(["root of the sum of squares", "", *map(shown, file.summed), DASH, ""])
    together = f"{file.together_success} {count}"
    rows.append([TOGETHER, "simulated", *map(shown, file.together), DASH, together])
    head = ("source", "magnitude", *UNITS, "theory, mm", "success")
    return Table(head, rows, words=range(2), note=ALONE)


def picture(file: BudgetFile) -> Figure:
    """Return the stacked plot: for each unit a bar as long as the whole error, which is divided as
    the squares of the contributions are.
    """
    squares = np.square([file.floor, *(part.alone for part in file.parts)])
    shares = squares / np.maximum(squares.sum(axis=0), 1e-300)
    names = [NOTHING, *(part.name for part in file.parts)]
    labels = [f"{shown(whole)} {unit}" for whole, unit in zip(file.together, UNITS, strict=True)]
    note = (
        "A bar is the error with everything wrong; its parts are as the squares of contributions."
    )
    return stacked("Share of each source in the error at the end", labels, names, shares, note=note)
