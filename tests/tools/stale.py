"""Says which sections of the results pages are older than the code that they measure: python
tests/tools/stale.py.

A section is as old as the newest line of its tables in git's history (of its text, where it has no
table). It may be out of date if a file that its numbers depend on has changed since, in more than
comments and docstrings. Whether a change moves a number, only a new measurement can tell.
"""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

from statements import is_docstring

TRACKERS = ("tracking/trackers", "tracking/appearance", "tracking/search", "tracking/loops")
LAWS = ("servo/loop", "servo/sight", "servo/features", "servo/controllers", "servo/estimators")
LOOP = ("sim", *TRACKERS, *LAWS)
SEQUENCES = (*TRACKERS, "tracking/evaluation", "tracking/sequences")
BENCH = (*LOOP, "servo/bench", "servo/goals")
REST = ""
"""Key of the paths on which all those sections of a page depend that the table does not name."""
MEASURED = {
    "scenes/RESULTS.md": {
        REST: (*LOOP, "scenes/*.toml", "scenes/studies"),
        "What a rolling shutter costs": ("sim",),
        "Arms from drawn bases": ("sim", "servo/controllers"),
        "A wrong calibration, in theory": ("servo/features", "servo/controllers", "sim/camera"),
    },
    "tracking/RESULTS.md": {
        REST: SEQUENCES,
        "In the loop on real recordings": LOOP,
        "Stated standard deviations": LOOP,
        "Corners of a tag": ("tracking/trackers/tag.py", "tracking/trackers/_plane.py"),
        "Corners of a plate": ("tracking/trackers/homography.py", "tracking/trackers/_plane.py"),
        "A size that cannot be": BENCH,
    },
    "servo/RESULTS.md": {
        REST: LOOP,
        "Flipped poses": ("servo/sight",),
        "Tuned settings": (*LOOP, "servo/tune", "servo/budget"),
        "The environment": ("sim", "servo/gym.py"),
        "Intervals": ("servo/study", "tracking/statistics"),
        "Pre-flight": ("servo/identify", "servo/twin"),
    },
    "servo/papers/RESULTS.md": {REST: (*LOOP, "servo/papers")},
    "scenes/benchmarks/README.md": {
        "goal-v1, condition by condition": (
            *BENCH,
            "servo/photo",
            "scenes/benchmarks/goal-v1.toml",
        ),
        "Does it predict anything?": (*SEQUENCES, *BENCH, "scenes/benchmarks/loop-v1.toml"),
        "loop-v1": (*BENCH, "scenes/benchmarks/loop-v1.toml"),
        "loop-v2": (*BENCH, "scenes/benchmarks/loop-v2.toml"),
        "Real pictures beside it": (*SEQUENCES, *BENCH, "scenes/benchmarks/loop-v2.toml"),
        "servo-v1": (*BENCH, "scenes/benchmarks/servo-v1.toml"),
        "servo-v2": (*BENCH, "scenes/benchmarks/servo-v2.toml"),
    },
    "tests/benchmarks/README.md": {
        REST: (*LOOP, "servo/output"),
        "Scale": ("servo/study",),
        "Mutants": ("tests/benchmarks",),
    },
}
"""For each results page: the files and folders on which the numbers of its sections depend. The
pilots are not among them: they record what was measured before a benchmark was frozen."""
HEADING = re.compile(r"^##+ (.*)")
LINE = re.compile(r"^(\w{40}) .*?^committer-time (\d+)$.*?^\t(.*?)$", re.MULTILINE | re.DOTALL)
SHOWN = 3
"""Number of changed files that are named."""


@cache
def git(root: Path, *words: str) -> str:
    """Return what git prints in a checkout."""
    command = ["git", "-C", str(root), *words]
    done = subprocess.run(command, capture_output=True, check=True)
    return done.stdout.decode(errors="replace")  # a picture has other bytes than UTF-8's


@cache
def code(root: Path, commit: str, path: str) -> str:
    """Return a file at a commit; a Python file as its syntax tree, without docstrings."""
    text = git(root, "show", f"{commit}:{path}")
    if not path.endswith(".py"):
        return text
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise):
            node.exc = node.cause = None
        for field, value in ast.iter_fields(node):
            if field == "body" and isinstance(value, list):
                value[:] = [line for line in value if not is_docstring(line)]
    return ast.dump(tree)


def sections(root: Path, page: str) -> Iterator[tuple[str, int, str]]:
    """Yield (heading, time of the newest commit [s since 1970], commit) for each section of a page,
    from its tables' lines or, where it has none, from all of its lines.
    """
    lines = LINE.findall(git(root, "blame", "-C", "--line-porcelain", "HEAD", "--", page))
    starts = [number for number, line in enumerate(lines) if HEADING.match(line[2])]
    for start, end in zip(starts, [*starts[1:], len(lines)], strict=True):
        rows = [line for line in lines[start:end] if line[2].startswith("|")] or lines[start:end]
        commit, time, _ = max(rows, key=lambda line: int(line[1]))
        yield lines[start][2].lstrip("# "), int(time), commit


def changed(root: Path, commit: str, paths: tuple[str, ...]) -> list[str]:
    """Return the files in some paths whose code is not that of a commit; new files do not count."""
    words = ("diff", "--name-status", "--find-renames", "--diff-filter=MR", commit, "HEAD", "--")
    found = [line.split("\t")[1:] for line in git(root, *words, *paths).splitlines()]
    return [n[-1] for n in found if code(root, commit, n[0]) != code(root, "HEAD", n[-1])]


def report(root: Path, measured: dict[str, dict[str, tuple[str, ...]]]) -> Iterator[str]:
    """Yield each page's name, and a line for each of its sections whose code has changed since."""
    for page, depends in measured.items():
        yield page
        for heading, time, commit in sections(root, page):
            paths = depends.get(heading, depends.get(REST))
            files = changed(root, commit, paths) if paths else []
            if files:
                day = datetime.fromtimestamp(time, UTC).date()
                all_files = git(root, "ls-files", "--", *paths).splitlines()
                count = f"{len(files)} of {len(all_files)} files"
                names = ", ".join(files[:SHOWN]) + ", ..." * (len(files) > SHOWN)
                yield f"  {heading} ({day}, {commit[:8]}): {count} have changed: {names}"


if __name__ == "__main__":
    for text in report(Path(__file__).parents[2], MEASURED):
        sys.stdout.write(f"{text}\n")
