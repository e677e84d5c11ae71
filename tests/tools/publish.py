"""Take rows into the package, and write the tables of the manuals: python tests/tools/publish.py [ROW.json ...]."""

import json
import re
import shutil
import sys
from pathlib import Path

import cv2
import matplotlib as mpl
import numpy as np

from servo.bench.audit import errors_file
from servo.bench.benchmark import NAMES, Band, load
from servo.bench.row import Row, check_version, file_name, shipped_rows
from servo.bench.score import FEWEST_WORLDS, standings
from servo.report.benchmark_section import (
    by_pictures,
    difficulty_of,
    discrimination_of,
    published_section,
    standings_table,
)
from servo.report.charts import saved
from servo.report.words import Table

FIRST_PAGE = Path("README.md")
PAGES = (Path("scenes/benchmarks/README.md"), FIRST_PAGE)
LIMITED = " †"
"""Marks a guest, whose row shows its interface as well."""
FEW = 8
"""Rows of a table on the first page, all guests among them."""
FOLDER = Path("scenes/benchmarks")
PICTURES = Path("scenes/pictures")
TALLEST = 4.5
"""Height of a figure of curves [inch]."""


def markdown(table: Table) -> str:
    """Return a table as Markdown."""
    lines = [table.head, ["---" if i in table.words else "---:" for i in range(len(table.head))]]
    lines += [[str(cell) for cell in row] for row in table.rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def block(name: str, most: int | None = None) -> str:
    """Return what the manuals say of a benchmark's rows: each kind of pictures has a table of its own.

    The first page has a few rows of the first table only, and three columns.
    """
    benchmark = load(name)
    groups = by_pictures(benchmark, shipped_rows(benchmark))
    return "\n".join(_block(name, r, of, most) for r, of in list(groups.items())[: most and 1])


def _block(name: str, rendering: str, rows: list[Row], most: int | None) -> str:
    table = standings_table(load(name), rows)
    if most is None:
        pictures = f", pictures `{rendering}`" if rendering else ""
        text = f"{name} `{load(name).hash}`, band v1{pictures}."
        note = f"{table.note} {difficulty_of(rows)} {discrimination_of(rows)}"
        whole = f"{text}\n\n{markdown(table)}\n\n{note}\n"
        return whole + (by_target(name, rows) if load(name).score == "held" else "")
    guests = [i for i in range(len(table.rows)) if table.faint and i not in table.faint]
    first = [i for i in range(len(table.rows)) if i not in guests][: most - len(guests)]
    shown = sorted([*first, *guests])
    columns = [0, *range(2, 4)]  # without the division
    head = [table.head[c] for c in columns]
    few = [[table.rows[i][c] for c in columns] for i in shown]
    are = "is" if len(guests) == 1 else "are"
    which = (
        f"; {len(guests)} of these {len(shown)} {are} not shipped with servobench" if guests else ""
    )
    text = f"{name}: {len(shown)} of {len(table.rows)} contestants{which}."
    return f"{text}\n\n{markdown(Table(head, few, range(1)))}\n"


def by_target(name: str, rows: list[Row]) -> str:
    """Return the table of points, and of shares of worlds held, by target; "" if one has few worlds."""
    worlds = load(name).every_world(Band(rows[0].band, rows[0].value, rows[0].digest))
    keys: dict[str, list[str]] = {}
    for world in worlds:
        keys.setdefault(world.levels["target"], []).append(world.key)
    if min(map(len, keys.values())) < FEWEST_WORLDS:
        return ""
    lines = []
    for one in standings(rows):
        cells = [f"{one.name}{LIMITED if one.row.division == 'CLOSED' else ''}"]
        for target in sorted(keys):
            points = np.mean([one.points[key] for key in keys[target]])
            held = np.mean([one.row.worlds[key].held for key in keys[target]])
            cells.append(f"{points:.0f}, {100 * held:.0f} %")
        lines.append(cells)
    head = ("contestant", *(f"{target} ({len(keys[target])})" for target in sorted(keys)))
    table = markdown(Table(head, lines, range(1)))
    return f"\nPoints, and worlds held, by target (with the number of its worlds):\n\n{table}\n"


def picture(name: str) -> None:
    """Draw the two figures of a benchmark's page side by side."""
    shown = published_section(name).blocks[0].figures
    height = max(f.drawing.get_figheight() for f in shown)
    for each in shown:
        each.drawing.set_figheight(min(height, TALLEST if each.keys else height))
        each.drawing.axes[0].set_title(each.title, fontweight="bold", loc="left")
    with mpl.rc_context({"savefig.dpi": 110}):
        drawn = [cv2.imdecode(np.frombuffer(saved(f, "png"), np.uint8), -1) for f in shown]
    height = max(len(one) for one in drawn)
    beside = [np.pad(one, ((0, height - len(one)), (10, 10), (0, 0))) for one in drawn]
    whole = np.hstack(beside).astype(float)
    share = whole[..., 3:] / 255
    flat = (whole[..., :3] * share + 255 * (1 - share)).round().astype(np.uint8)
    cv2.imwrite(str(PICTURES / f"{name}.png"), flat)


def with_tables(text: str, most: int | None = None) -> str:
    """Return a page with the present tables between its marks."""
    for name in NAMES:
        mark = re.compile(rf"(<!-- table of {name} -->\n).*?(<!-- end -->)", re.DOTALL)
        text = mark.sub(lambda found, of=name: f"{found[1]}{block(of, most)}{found[2]}", text)
    return text


def take(path: Path) -> None:
    """Copy a row into the package; its pictures are the frozen ones, where none were before."""
    row = Row.read(path)
    benchmark = load(row.benchmark)
    check_version(benchmark, row)
    folder = FOLDER / "rows" / row.benchmark
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(path, folder / file_name(row.contestant))
    if errors_file(path).exists():
        shutil.copy(errors_file(path), errors_file(folder / file_name(row.contestant)))
    if row.rendering and not benchmark.rendering:
        frozen = FOLDER / f"{row.benchmark}.json"
        table = json.loads(frozen.read_text()) | {"rendering": row.rendering}
        frozen.write_text(json.dumps(table, indent=1, sort_keys=True) + "\n")


if __name__ == "__main__":
    for given in sys.argv[1:]:
        take(Path(given))
    for page in PAGES:
        page.write_text(with_tables(page.read_text(), FEW if page == FIRST_PAGE else None))
    for one in NAMES:
        if f"{one}.png" in PAGES[0].read_text():
            picture(one)
