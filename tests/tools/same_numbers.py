"""Says whether a command gives the same numbers at an old commit and in this checkout:

    python tests/tools/same_numbers.py 21dffded run line --seed 3
    python tests/tools/same_numbers.py 21dffded sweep schemes --seeds 1

The command, which must take `--out`, is run in both. The tables (Parquet) that it writes are
compared, column by column, where both have the column; times of computing are left out. A line
gives each column that differs, and by how much at most. The exit code is 1 if any differs.
"""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

ROOT = Path(__file__).parents[2]
TIMED = ("time_", "seconds", "milliseconds", "step_ms", "version_", "repeats", "remarks")
"""Beginnings of the names of columns that may differ: times, versions, and what is only told."""
CLOSE = 1e-9
"""Largest share by which equal numbers differ: another order of sums."""


def tables(checkout: Path, words: list[str], out: Path) -> dict[str, pa.Table]:
    """Run a command of servobench in a checkout, and return the tables that it writes by path."""
    command = [sys.executable, "-m", "servo", *words, "--out", str(out)]
    alone = os.environ | {"PYTHONPATH": str(checkout)}
    code = subprocess.run(command, cwd=checkout, env=alone, check=False).returncode
    found = sorted(out.rglob("*.parquet"))
    if not found:
        sys.exit(f"{checkout}: the command wrote no table (exit code {code})")
    return {str(path.relative_to(out)): pq.read_table(path) for path in found}


def differences(old: pa.Table, new: pa.Table) -> Iterator[tuple[str, float]]:
    """Yield (name, largest difference relative to the column's largest value) for each column of
    both tables that differs; the difference is infinite for texts and for missing values.
    """
    for name in old.column_names:
        if name not in new.column_names or name.startswith(TIMED):
            continue
        before, after = old[name].to_pylist(), new[name].to_pylist()
        if repr(before) == repr(after):
            continue
        try:
            a, b = np.array(before, float), np.array(after, float)
            unequal = np.isnan(a) != np.isnan(b)
            scale = max(np.nanmax(np.abs(a), initial=0.0), sys.float_info.min)
            most = np.inf if unequal.any() else np.nanmax(np.abs(a - b), initial=0.0) / scale
        except (TypeError, ValueError):
            most = np.inf
        if most > CLOSE:
            yield name, float(most)


def report(old: dict[str, pa.Table], new: dict[str, pa.Table]) -> Iterator[tuple[str, bool]]:
    """Yield a line for each table of the old checkout, and for each column that differs; and
    whether the line tells a difference.
    """
    for path, before in old.items():
        after = new.get(path)
        if after is None or len(before) != len(after):
            rows = "no table" if after is None else f"{len(after)} rows"
            yield f"{path}: {len(before)} rows before, {rows} now", True
            continue
        found = list(differences(before, after))
        both = set(before.column_names) & set(after.column_names)
        yield f"{path}: {len(before)} rows, {len(found)} of {len(both)} columns differ", bool(found)
        for name, most in found:
            yield f"  {name}: by {most:.2g} of its largest value", True


def main(commit: str, words: list[str]) -> int:
    """Compare the tables of a command at a commit with those of this checkout; return the exit
    code.
    """
    git = ["git", "-C", str(ROOT), "worktree"]
    with TemporaryDirectory() as place:
        checkout = Path(place) / "old"
        subprocess.run([*git, "add", "--quiet", "--detach", checkout, commit], check=True)
        try:
            old = tables(checkout, words, Path(place) / "before")
            new = tables(ROOT, words, Path(place) / "after")
        finally:
            subprocess.run([*git, "remove", "--force", checkout], check=True)
    code = 0
    for line, differs in report(old, new):
        sys.stdout.write(f"{line}\n")
        code |= differs
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2:]))
