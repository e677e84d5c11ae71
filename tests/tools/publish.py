"""Take rows into the package, and write the tables of the manuals: python tests/tools/publish.py [ROW.json ...]."""

import json
import re
import shutil
import sys
from dataclasses import replace
from pathlib import Path

from servo.bench.benchmark import NAMES, load
from servo.bench.row import Row, check_version, file_name, shipped_rows
from servo.report.benchmark_section import difficulty_of, published
from servo.report.words import Table

FIRST_PAGE = Path("README.md")
PAGES = (Path("scenes/benchmarks/README.md"), FIRST_PAGE)
FEW = 5
"""Rows of a table on the first page."""
FOLDER = Path("scenes/benchmarks")


def markdown(table: Table) -> str:
    """Return a table as Markdown."""
    lines = [table.head, ["---" if i in table.words else "---:" for i in range(len(table.head))]]
    lines += [[str(cell) for cell in row] for row in table.rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def block(name: str, most: int | None = None) -> str:
    """Return what the manuals say of a benchmark's rows; the first ones only, if there are most."""
    benchmark = load(name)
    rows = shipped_rows(benchmark)
    if not rows:
        return ""
    pictures = f", pictures `{benchmark.rendering}`" if benchmark.rendering else ""
    text = f"{name} `{benchmark.hash}`, band v1{pictures}."
    table = published(name)
    shown = replace(table, rows=table.rows[:most])
    if most is not None and len(table.rows) > most:
        text += f" The first {most} of {len(table.rows)}."
        return f"{text}\n\n{markdown(shown)}\n"
    return f"{text}\n\n{markdown(shown)}\n\n{table.note} {difficulty_of(rows)}\n"


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
    if row.rendering and not benchmark.rendering:
        frozen = FOLDER / f"{row.benchmark}.json"
        table = json.loads(frozen.read_text()) | {"rendering": row.rendering}
        frozen.write_text(json.dumps(table, indent=1, sort_keys=True) + "\n")


if __name__ == "__main__":
    for given in sys.argv[1:]:
        take(Path(given))
    for page in PAGES:
        page.write_text(with_tables(page.read_text(), FEW if page == FIRST_PAGE else None))
