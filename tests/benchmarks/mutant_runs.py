"""The copy of the project that `mutants.py` changes, and one run of tests in it."""

import contextlib
import importlib
import json
import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numba
import pytest
from mutant_sites import mutated

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
BUSY = {"tests/test_ctrl_c.py", "tests/test_study_kills.py"}
"""They send signals in time, which a busy machine can spoil."""
HEAVY = (
    "cv2",
    "jinja2",
    "matplotlib.backends.backend_agg",
    "mujoco",
    "pydantic",
    "pyarrow.parquet",
    "rich.progress",
    "rich.table",
    "scipy.stats",
)
"""Imported once: the imports take longer than most tests."""
OPTIONS = ("-q", "-p", "mutant_plugin", "-m", "not processes")
"""Options of each run of pytest."""
COMPILED = ("tracking/loops/", "sim/camera/exact/raster.py", "sim/camera/exact/shadows.py")
"""numba compiles these: coverage does not see their lines, and each change compiles anew."""


def listed(root):
    command = ["git", "ls-files", "-co", "--exclude-standard"]
    names = subprocess.run(command, cwd=root, capture_output=True, text=True, check=True).stdout
    return [name for name in names.splitlines() if (root / name).is_file()]


class Copy:
    """A copy of the project in which the tests run."""

    def __init__(self, folder: Path):
        self.folder, self.root = folder, folder / "copy" / "project"
        for name in HEAVY:
            importlib.import_module(name)

    def make(self):
        """Copies all files; an earlier run may have been killed before it restored one."""
        names = listed(ROOT)
        for old in {str(p.relative_to(self.root)) for p in self.root.rglob("*.py")} - {*names}:
            (self.root / old).unlink()
        for name in names:
            (self.root / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, self.root / name)
        data = self.root.parent / "shared"
        if (ROOT.parent / "shared").is_dir() and not data.exists():
            data.symlink_to(ROOT.parent / "shared")

    @contextlib.contextmanager
    def mutated(self, site, new):
        """Changes one place of a file while this lasts."""
        path = self.root / site.file
        before, time = path.read_text(), path.stat().st_mtime_ns
        try:
            path.write_text(mutated(before, site, new))
            later = time + 10**10  # no byte code in the copy has this time
            os.utime(path, ns=(later, later))
            yield
        finally:
            path.write_text(before)
            os.utime(path, ns=(time, time))

    def environment(self, **more):
        numba = more.pop("numba", self.folder / "numba")
        path = os.pathsep.join([str(self.root), str(HERE)])
        fixed = {
            "PYTHONPATH": path,
            "NUMBA_CACHE_DIR": str(numba),
            "LP_NUM_THREADS": "0",
            "MUTANTS_CHECKOUT": str(self.root),
        }
        return {**os.environ, **fixed, **{k: str(v) for k, v in more.items()}}

    def pytest(self, words, limit=None, **environment):
        """The exit code of pytest in the copy; None where it was still running at the limit [s]."""
        command = [sys.executable, "-m", "pytest", *OPTIONS, *words]
        with (self.folder / "output.txt").open("w") as output:
            process = subprocess.Popen(
                command,
                cwd=self.root,
                env=self.environment(**environment),
                stdout=output,
                stderr=output,
                start_new_session=True,
            )
            try:
                return process.wait(limit)
            except subprocess.TimeoutExpired:
                return None
            finally:
                if process.poll() is None:
                    os.killpg(process.pid, signal.SIGKILL)
                    process.wait()

    def forked(self, words, limit, **environment):
        """As `pytest`, in a fork of this process: what all tests need is imported already."""
        process = multiprocessing.get_context("fork").Process(
            target=inside, args=(self, words, self.environment(**environment))
        )
        process.start()
        process.join(limit)
        if process.exitcode is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.join()
            return None
        return process.exitcode

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
        code = self.forked(
            ["-x", "-n", "0", "-p", "no:cacheprovider", *files],
            limit,
            MUTANTS_CHOSEN=chosen,
            MUTANTS_VERDICT=verdict,
            **extra,
        )
        if code is None:
            return f"time: still running after {limit:.0f} s"
        if code == 0:
            return None
        if verdict.exists():
            found = json.loads(verdict.read_text())
            return f"{found['test']}: {found['said']}"[:300]
        return f"pytest's exit code {code}: {(self.folder / 'output.txt').read_text()[-200:]!r}"


def inside(copy, words, environment):
    """What the fork does: becomes a process like any other that runs pytest in the copy."""
    os.setsid()
    os.environ.update(environment)
    os.chdir(copy.root)
    output = os.open(copy.folder / "output.txt", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(output, 1)
    os.dup2(output, 2)
    sys.path[:0] = [str(copy.root), str(HERE)]
    sys.dont_write_bytecode = True
    numba.config.CACHE_DIR = environment["NUMBA_CACHE_DIR"]
    sys.exit(int(pytest.main([*OPTIONS, *words])))
