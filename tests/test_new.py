"""`servobench new PART NAME`: what it writes keeps the contract of its kind, and runs."""

import os
import subprocess
import sys

import pytest
import yaml
from measured import measured_run

import servo
from servo import testing
from servo.cli.main import PARTS
from servo.cli.new_command import SECTIONS, new
from servo.loop.run_measures import Outcome
from servo.mistake import Mistake
from servo.result import simulate
from servo.scenario.load import load
from servo.study.bounds import missed_bounds
from servo.testing import check_tracker

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
    new("tracker", "red_dot", tmp_path / "red_dot")
    yield tmp_path / "red_dot"
    sys.modules.pop("red_dot", None)


def test_it_writes_a_package_with_an_entry_point_and_a_test(package):
    files = sorted(str(p.relative_to(package)) for p in package.rglob("*.*"))
    assert files == ["README.md", "pyproject.toml", "red_dot/__init__.py", "tests/test_red_dot.py"]
    text = (package / "pyproject.toml").read_text()
    assert 'name = "red-dot"' in text
    assert '[project.entry-points."servobench.trackers"]\nred_dot = "red_dot:Config"\n' in text
    assert "class RedDot:" in (package / "red_dot" / "__init__.py").read_text()
    with pytest.raises(Mistake, match="something is there already; choose another folder"):
        new("tracker", "blue_dot", package)


def test_its_tracker_keeps_the_contract(package):
    check_tracker("red_dot:Config")


@pytest.mark.processes
def test_it_installs_and_runs_as_it_is(package, pip, tmp_path):
    place = tmp_path / "site"
    pip("--no-build-isolation", "--target", str(place), str(package))
    path = os.pathsep.join([str(place), *sys.path])
    (tmp_path / "few.toml").write_text(
        '[[sequences]]\nkind = "clutter"\nlevel = "a"\nframes = 20\n'
    )
    line = "evaluate few.toml --trackers red_dot,frozen --seeds 1 --workers 1 --out out"
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


@pytest.mark.wide
@pytest.mark.parametrize(
    ("part", "section", "scenario"),
    [
        ("law", "controller", "still"),
        ("features", "features", "line"),
        ("estimator", "estimator", "line"),
        ("motion", "motion", "circle"),
        ("robot", "robot", "line"),
    ],
)
def test_each_part_keeps_its_contract_and_holds_the_target(
    part, section, scenario, tmp_path, monkeypatch
):
    name = f"my_own_{part}"
    monkeypatch.syspath_prepend(tmp_path / name)
    files = new(part, name, tmp_path / name)
    text = (tmp_path / name / "pyproject.toml").read_text()
    group = section if section == "features" else f"{section}s"
    assert f'[project.entry-points."servobench.{group}"]\n{name} = "{name}:Config"\n' in text
    test = (tmp_path / name / "tests" / f"test_{name}.py").read_text()
    assert f"    check_{section}(Config)\n" in test
    getattr(testing, f"check_{section}")(f"{name}:Config")
    found = simulate(scenario, [f"{section}.kind={name}:Config", "run.duration=4.0"])
    assert found.outcome == Outcome.CONVERGED
    assert all("{{" not in path.read_text() for path in files)


@pytest.mark.wide
def test_a_repository_of_scenarios_has_a_workflow_that_keeps_the_compiled_loops(tmp_path):
    files = new("scenarios", "my_scenes", tmp_path / "mine")
    names = sorted(str(path.relative_to(tmp_path / "mine")) for path in files)
    assert names == [
        ".github/workflows/scenes.yml",
        ".gitignore",
        "README.md",
        "requirements.txt",
        "scenarios/my_scenes.toml",  # a folder "scenes" would hide the package of a checkout
    ]
    workflow = yaml.safe_load((tmp_path / "mine" / names[0]).read_text())
    steps = workflow["jobs"]["scenes"]["steps"]
    assert workflow["jobs"]["scenes"]["env"] == {"NUMBA_CACHE_DIR": ".numba"}
    assert steps[2]["with"] == {
        "path": ".numba",
        "key": "numba-3.12-${{ runner.os }}-${{ hashFiles('requirements.txt') }}",
    }
    assert "servobench check scenarios/*.toml" in steps[5]["run"]
    found = simulate(tmp_path / "mine" / "scenarios" / "my_scenes.toml")
    assert found.outcome == Outcome.CONVERGED
    assert not found.missed
    mine = simulate(tmp_path / "mine" / "scenarios" / "my_scenes.toml", ["tracker.kind=frozen"])
    assert any(missed.startswith("outcome is ") for missed in map(str, mine.missed))
    pinned = (tmp_path / "mine" / "requirements.txt").read_text().splitlines()[1]
    assert pinned == f"servobench=={servo.__version__}"


def test_the_command_names_each_part():
    assert set(PARTS) == {*SECTIONS, "scenarios"}


@pytest.mark.wide
def test_the_bounds_of_a_new_scenario_notice_half_the_gain(tmp_path):
    new("scenarios", "ci", tmp_path / "repository")
    place = str(tmp_path / "repository" / "scenarios" / "ci.toml")
    missed = []
    for change in ("controller.gain=2.0", "controller.gain=1.0"):
        scenario = load(place, [change])
        _, summary = measured_run(scenario)
        missed.append(missed_bounds(summary.outcome.name, summary.measures, scenario.expect))
    assert [bool(some) for some in missed] == [False, True]
