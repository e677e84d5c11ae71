"""The copy of the project that `mutants.py` changes, its map from lines to tests, and one run."""

import ast
import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import coverage

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
PACKAGES = ("sim", "tracking", "servo")
LEFT_OUT = {"tests/test_project.py": "lengths and wording of files are no behaviour"}
BUSY = {"tests/test_ctrl_c.py", "tests/test_study_kills.py"}
"""They send signals in time, which a busy machine can spoil."""
BUDGET = 90.0
"""Tests of a mutant that are expected to take longer than this in all [s] are left out: the
slowest ones. A mutant that survives for that reason counts as not noticed."""
COMPILED = "tracking/hot/"
"""numba compiles these: coverage does not see their lines, and each change compiles anew."""


def digests(root: Path) -> dict[str, str]:
    """What identifies each file that decides a result; these scripts do not."""
    names = [name for name in listed(root) if not name.startswith("tests/benchmarks/")]
    return {name: hashlib.sha256((root / name).read_bytes()).hexdigest()[:12] for name in names}


def listed(root):
    command = ["git", "ls-files", "-co", "--exclude-standard"]
    names = subprocess.run(command, cwd=root, capture_output=True, text=True, check=True).stdout
    return [name for name in names.splitlines() if (root / name).is_file()]


class Copy:
    """A copy of the project in which the tests run."""

    def __init__(self, folder: Path):
        self.folder, self.root = folder, folder / "copy" / "project"

    def make(self):
        """Copies all files; an earlier run may have been killed before it restored one."""
        for name in listed(ROOT):
            (self.root / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, self.root / name)
        data = self.root.parent / "shared"
        if (ROOT.parent / "shared").is_dir() and not data.exists():
            data.symlink_to(ROOT.parent / "shared")

    def write(self, file, text):
        """Changes a file; its new time is one that no byte code in the copy has."""
        later = (self.root / file).stat().st_mtime + 10
        (self.root / file).write_text(text)
        os.utime(self.root / file, (later, later))

    def restore(self, file):
        shutil.copy2(ROOT / file, self.root / file)

    def environment(self, **more):
        numba = more.pop("numba", self.folder / "numba")
        path = os.pathsep.join([str(self.root), str(HERE)])
        fixed = {"PYTHONPATH": path, "NUMBA_CACHE_DIR": str(numba), "LP_NUM_THREADS": "0",
                 "MUTANTS_CHECKOUT": str(self.root)}  # fmt: skip
        return {**os.environ, **fixed, **{k: str(v) for k, v in more.items()}}

    def pytest(self, words, limit=None, **environment):
        """The exit code of pytest in the copy; None where it was still running at the limit [s]."""
        command = [sys.executable, "-m", "pytest", "-q", "-p", "mutant_plugin", *words]
        with (self.folder / "output.txt").open("w") as output:
            process = subprocess.Popen(
                command, cwd=self.root, env=self.environment(**environment),
                stdout=output, stderr=output, start_new_session=True,
            )  # fmt: skip
            try:
                return process.wait(limit)
            except subprocess.TimeoutExpired:
                return None
            finally:
                if process.poll() is None:
                    os.killpg(process.pid, signal.SIGKILL)
                    process.wait()

    def noticed(self, tests, expected, *, compiled):
        """As `chosen`, but a test that a busy machine can make fail has to fail twice."""
        while verdict := self.chosen(tests, expected, compiled=compiled):
            test = verdict.split(": ")[0]
            if test.split("::")[0] not in BUSY or self.chosen([test], expected, compiled=compiled):
                return verdict
            tests = [other for other in tests if other != test]
        return None

    def chosen(self, tests, expected, *, compiled):
        """Runs these tests up to the first failure: what it was; None where all pass.

        expected: seconds; the run is given four times as long, and a minute.
        compiled: nothing that was compiled before holds.
        """
        chosen, verdict = self.folder / "chosen.json", self.folder / "verdict.json"
        chosen.write_text(json.dumps(tests))
        verdict.unlink(missing_ok=True)
        extra = {"PYTHONDONTWRITEBYTECODE": 1}
        if compiled:
            extra["numba"] = self.folder / "numba-mutant"
            shutil.rmtree(extra["numba"], ignore_errors=True)
        files = sorted({test.split("::")[0] for test in tests})
        limit = 60 + 4 * expected + 120 * compiled
        code = self.pytest(["-x", "-n", "0", "-p", "no:cacheprovider", *files], limit,
                           MUTANTS_CHOSEN=chosen, MUTANTS_VERDICT=verdict, **extra)  # fmt: skip
        if code is None:
            return f"time: still running after {limit:.0f} s"
        if code == 0:
            return None
        if verdict.exists():
            found = json.loads(verdict.read_text())
            return f"{found['test']}: {found['said']}"[:300]
        return f"pytest's exit code {code}: {(self.folder / 'output.txt').read_text()[-200:]!r}"


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
        path, now = copy.folder / "map.json", digests(copy.root)
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
        if site.inside and not site.file.startswith(COMPILED):
            first, last = site.lines
            lines = self.lines.get(site.file, {})
            tiers = [{t for n in range(first, last + 1) for t in lines.get(n, [])}]
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
    copy.pytest(
        ["-n", "2", *left_out, *files], COVERAGE_PROCESS_START=settings, MUTANTS_TIMES=times
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
    return {"seconds": tests, "failed": sorted(failed), "lines": lines,
            "importers": importers(copy.root)}  # fmt: skip


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
