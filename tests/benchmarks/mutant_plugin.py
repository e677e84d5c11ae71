"""The pytest plugin of `mutants.py`: records which test runs which line, or runs chosen tests.

MUTANTS_CHECKOUT is the copy that is tested. With MUTANTS_TIMES each test's lines go to coverage
under the test's name, and its time to that file; a fixture that several tests share has a name
of its own, and the file says which tests use it. With MUTANTS_CHOSEN only the tests named in that
file run, in its order, and the first failure goes to MUTANTS_VERDICT.
"""

import json
import os
from pathlib import Path

import coverage
import pytest

TEST = "MUTANTS_TEST"
"""Environment variable: the coverage context of programs that a test starts."""


def pytest_configure(config):
    import servo

    checkout = Path(os.environ["MUTANTS_CHECKOUT"])
    if not Path(servo.__file__).is_relative_to(checkout):
        raise pytest.UsageError(f"the tests would import {servo.__file__}, not {checkout}")
    if os.environ.get("MUTANTS_TIMES") and (
        hasattr(config, "workerinput") or not config.getoption("numprocesses", 0)
    ):
        config.pluginmanager.register(Recorder(), "mutant-recorder")
    if os.environ.get("MUTANTS_CHOSEN"):
        config.pluginmanager.register(Chooser(), "mutant-chooser")


class Recorder:
    """Gives each test, and each fixture that tests share, a coverage context of its own."""

    def __init__(self):
        self.running = ""
        self.rows = []
        self.file = Path(os.environ["MUTANTS_TIMES"]).with_suffix(f".{os.getpid()}.jsonl").open("w")

    def switch(self, name):
        os.environ[TEST] = name
        coverage.Coverage.current().switch_context(name)

    def write(self):
        """Between two tests: some let no file grow."""
        self.file.writelines(json.dumps(row) + "\n" for row in self.rows)
        self.file.flush()
        self.rows.clear()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):
        self.running = item.nodeid
        self.switch(item.nodeid)
        used = [d for found in item._fixtureinfo.name2fixturedefs.values() for d in found]
        shared = [name(d) for d in used if d.scope != "function"]
        self.rows.append({"test": item.nodeid, "shared": shared})
        try:
            return (yield)
        finally:
            self.switch("")
            self.write()

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef):
        if fixturedef.scope == "function":
            return (yield)
        self.switch(name(fixturedef))
        try:
            return (yield)
        finally:
            self.switch(self.running)

    def pytest_runtest_logreport(self, report):
        row = {"time": report.nodeid, "when": report.when, "seconds": report.duration}
        self.rows.append(row | {"outcome": report.outcome})

    def pytest_sessionfinish(self):
        coverage.Coverage.current().save()


def name(fixturedef):
    return f"fixture {fixturedef.baseid}::{fixturedef.argname}"


class Chooser:
    """Runs the chosen tests in the order given and keeps the first failure."""

    def __init__(self):
        self.verdict = Path(os.environ["MUTANTS_VERDICT"])
        names = json.loads(Path(os.environ["MUTANTS_CHOSEN"]).read_text())
        self.order = {name: k for k, name in enumerate(names)}

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items):
        chosen = [item for item in items if item.nodeid in self.order]
        items[:] = sorted(chosen, key=lambda item: self.order[item.nodeid])

    def pytest_runtest_logreport(self, report):
        if report.failed:
            self.keep(report.nodeid, report)

    def pytest_collectreport(self, report):
        if report.failed:
            self.keep(f"import of {report.nodeid}", report)

    def keep(self, name, report):
        if not self.verdict.exists():
            crash = getattr(report.longrepr, "reprcrash", None)
            said = crash.message if crash else str(report.longrepr).strip().splitlines()[-1]
            self.verdict.write_text(json.dumps({"test": name, "said": said.split("\n")[0]}))
