"""Which tests run which lines: the map by which `mutants.py` chooses the tests of a mutant."""

import ast
import hashlib
import json
import shutil
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import coverage
import pytest
from mutant_runs import COMPILED, ROOT, Copy, listed

PACKAGES = ("sim", "tracking", "servo")
LEFT_OUT = {"tests/test_project.py": "lengths and wording of files are no behaviour"}
RAN = (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED, pytest.ExitCode.NO_TESTS_COLLECTED)
"""Exit codes after which every test has run; those that fail are in the map."""
BUDGET = 90.0
"""Tests of a mutant that are expected to take longer than this in all [s] are left out: the
slowest ones. A mutant that survives for that reason counts as not noticed."""


def digests(root: Path) -> dict[str, str]:
    """What identifies each file that decides a result; these scripts do not."""
    parts = (*PACKAGES, "scenes", "tests")
    names = [name for name in listed(root) if Path(name).parts[0] in parts]
    names = [name for name in names if not name.startswith("tests/benchmarks/")]
    return {name: hashlib.sha256((root / name).read_bytes()).hexdigest()[:12] for name in names}


@dataclass(frozen=True)
class Map:
    """Which tests run which lines, from one run of all tests under coverage."""

    seconds: dict[str, float]
    """How long each test takes, with tracing."""
    failed: list[str]
    """Tests that fail without any change: they notice nothing."""
    lines: dict[str, dict[int, list[str]]]
    """By file and line: the tests that run it outside an import."""
    importers: dict[str, list[str]]
    """By file: the files that import it."""

    @staticmethod
    def of(copy: Copy) -> "Map":
        """Read from the folder; what is missing is measured: all, or the tests that changed."""
        path, now = copy.folder / "map.json", digests(ROOT)
        kept = json.loads(path.read_text()) if path.exists() else {"digests": {}}
        before = kept.pop("digests")
        changed = {file for file in {*before, *now} if before.get(file) != now.get(file)}
        tests = {file for file in changed if file.startswith("tests/test_")}
        if any(not file.startswith(("tests/test_", "tests/data/")) for file in changed):
            kept = measure(copy, [])
        elif tests:
            kept = merged(kept, tests, measure(copy, sorted(tests & now.keys())))
        path.write_text(json.dumps(kept | {"digests": now}))
        kept["lines"] = {
            file: {int(line): names for line, names in of.items()}
            for file, of in kept["lines"].items()
        }
        return Map(**kept)

    def of_file(self, file):
        return {test for tests in self.lines.get(file, {}).values() for test in tests}

    def direct(self, file):
        """The tests in test files that import this file."""
        files = {f for f in self.importers.get(file, []) if f.startswith("tests/")}
        return {test for test in self.seconds if test.split("::")[0] in files}

    def users(self, file, seen=()):
        """The tests that run the files which import this one, through compiled files."""
        found = set()
        for user in self.importers.get(file, []):
            if user not in seen:
                found |= self.of_file(user)
                if user.startswith(COMPILED) or user.endswith("__init__.py"):
                    found |= self.users(user, (*seen, user)) | self.direct(user)
        return found

    def tests(self, site):
        """The tests that can notice a change, the likeliest and quickest first, in the budget."""
        first, last = site.lines
        lines = self.lines.get(site.file, {})
        inside = {test for n in range(first, last + 1) for test in lines.get(n, [])}
        # A function that only an import calls runs in no test, such as the text of a claim's rule.
        at_import = not inside and any(n in lines for n in range(first, last + 1))
        if site.inside and not at_import and not site.file.startswith(COMPILED):
            tiers = [inside]
        else:
            tiers = [self.direct(site.file), self.of_file(site.file), self.users(site.file)]
        chosen, spent = {}, 0.0
        for tier in tiers:
            for test in sorted(tier & self.seconds.keys(), key=self.order):
                if test not in chosen and spent + self.seconds[test] <= BUDGET:
                    spent += self.seconds[test]
                    chosen[test] = None
        return list(chosen), spent

    def order(self, test):
        """Quick tests first; those of a file together, for they share fixtures."""
        seconds = self.seconds[test]
        steps = sum(seconds > step for step in (0.1, 0.5, 2.0, 8.0, 32.0))
        return steps, test.split("::")[0], seconds


def merged(kept, files, new):
    """The fields of a map with all about these test files taken from another one."""

    def stays(test):
        return test.split("::")[0] not in files

    lines = {}
    for file in {*kept["lines"], *new["lines"]}:
        old, more = kept["lines"].get(file, {}), new["lines"].get(file, {})
        lines[file] = {
            line: [*filter(stays, old.get(line, [])), *more.get(line, [])] for line in {*old, *more}
        }
    seconds = {test: s for test, s in kept["seconds"].items() if stays(test)} | new["seconds"]
    failed = [*filter(stays, kept["failed"]), *new["failed"]]
    return {**new, "seconds": seconds, "failed": failed, "lines": lines}


def measure(copy, files):
    """These test files once, or all of them, under coverage: the fields of a Map."""
    settings, times = copy.folder / "coverage.ini", copy.folder / "times"
    for old in copy.folder.glob("times.*.jsonl"):
        old.unlink()
    settings.write_text(
        "[run]\nparallel = true\npatch = _exit\ncontext = ${MUTANTS_TEST-}\n"
        f"data_file = {copy.folder / 'lines' / 'coverage'}\n"
        f"source = {', '.join(str(copy.root / package) for package in PACKAGES)}\n"
    )
    shutil.rmtree(copy.folder / "lines", ignore_errors=True)
    (copy.folder / "lines").mkdir()
    left_out = [f"--ignore={file}" for file in LEFT_OUT]
    code = copy.pytest(
        ["-n", "2", *left_out, *files], COVERAGE_PROCESS_START=settings, MUTANTS_TIMES=times
    )
    if code not in RAN:
        raise SystemExit(
            f"no map of the tests: pytest ended early (exit code {code}): "
            f"{copy.folder / 'output.txt'} says why; mend it and run the same command again"
        )
    seconds, failed, users = defaultdict(float), set(), defaultdict(list)
    for file in copy.folder.glob("times.*.jsonl"):
        for row in map(json.loads, file.read_text().splitlines()):
            if "test" in row:
                for fixture in row["shared"]:
                    users[fixture].append(row["test"])
            else:
                seconds[row["time"]] += row["seconds"]
                if row["outcome"] != "passed":
                    failed.add(row["time"])
    tests = {t: s for t, s in seconds.items() if t not in failed}
    lines = traced(copy, tests, users)
    return {
        "seconds": tests,
        "failed": sorted(failed),
        "lines": lines,
        "importers": importers(copy.root),
    }


def traced(copy, tests, users):
    """Coverage's data: by file and line the tests, those of a shared fixture in its place."""
    whole = coverage.Coverage(str(copy.folder / "lines" / "coverage"), config_file=False)
    whole.combine([str(copy.folder / "lines")])
    data, found = whole.get_data(), {}
    for path in data.measured_files():
        file, by_line = str(Path(path).relative_to(copy.root)), {}
        for line, contexts in data.contexts_by_lineno(path).items():
            run = {t for name in contexts for t in users.get(name, [name]) if t in tests}
            by_line[str(line)] = sorted(run)
        found[file] = by_line
    return found


def importers(root):
    """By file of the project: the files that import it."""
    found = defaultdict(set)
    for path in [p for part in (*PACKAGES, "tests") for p in (root / part).rglob("*.py")]:
        user = str(path.relative_to(root))
        for node in ast.walk(ast.parse(path.read_text())):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.module:
                names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
            for name in names:
                for file in (
                    f"{name.replace('.', '/')}.py",
                    f"{name.replace('.', '/')}/__init__.py",
                ):
                    if (root / file).is_file():
                        found[file].add(user)
    return {file: sorted(users) for file, users in found.items()}
