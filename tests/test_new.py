"""`servobench new tracker NAME`: the package that it writes keeps the contract and runs."""

import os
import subprocess
import sys

import pytest

from servo.cli.new_command import new_tracker
from servo.mistake import Mistake
from servo.testing import check_tracker

pytestmark = pytest.mark.processes

BOTH = """
import sys, pytest
from servo.cli.main import main
_, line, package = sys.argv
sys.argv[1:] = line.split()
try:
    main()
except SystemExit as ended:
    assert not ended.code, ended
sys.exit(pytest.main([package, "-q"]))
"""
"""A bench and the package's own test, in one process."""


@pytest.fixture
def package(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path / "red_dot")
    new_tracker("red_dot", tmp_path / "red_dot")
    yield tmp_path / "red_dot"
    sys.modules.pop("red_dot", None)


def test_it_writes_a_package_with_an_entry_point_and_a_test(package):
    files = sorted(str(p.relative_to(package)) for p in package.rglob("*.*"))
    assert files == ["README.md", "pyproject.toml", "red_dot/__init__.py", "tests/test_red_dot.py"]
    text = (package / "pyproject.toml").read_text()
    assert 'name = "red-dot"' in text
    assert '[project.entry-points."servobench.trackers"]\nred_dot = "red_dot:Config"\n' in text
    assert "class RedDot:" in (package / "red_dot" / "__init__.py").read_text()
    with pytest.raises(Mistake, match="there is something of this name; choose another"):
        new_tracker("blue_dot", package)


def test_its_tracker_keeps_the_contract(package):
    check_tracker("red_dot:Config")


def test_it_installs_and_runs_as_it_is(package, pip, tmp_path):
    place = tmp_path / "site"
    pip("--no-build-isolation", "--target", str(place), str(package))
    path = os.pathsep.join([str(place), *sys.path])
    line = "bench clutter --trackers red_dot,frozen --seeds 1 --workers 1 --out out"
    ended = subprocess.run(
        [sys.executable, "-c", BOTH, line, str(package)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": path},
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert "1 passed" in ended.stdout
    assert "red_dot" in (tmp_path / "out" / "table.csv").read_text()
