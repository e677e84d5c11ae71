"""The wheel, built, installed into a folder of its own, and used from there."""

import os
import subprocess
import sys
import tomllib
import zipfile

import pytest
import yaml
from commands import one_by_one

pytestmark = pytest.mark.processes

PACKAGES = {"servo", "tracking", "sim", "scenes"}


def test_the_wheel_has_our_packages_with_their_data_and_nothing_else(wheel, root):
    names = zipfile.ZipFile(wheel).namelist()
    ours = {name for name in names if ".dist-info/" not in name}
    assert {name.split("/")[0] for name in ours} == PACKAGES
    listed = subprocess.run(
        ["git", "ls-files", *PACKAGES], cwd=root, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    assert set(listed) <= ours  # models, scenarios, studies and the page's template too
    assert {f"{package}/py.typed" for package in PACKAGES} | {"scenes/scenario.schema.json"} <= ours


def test_a_run_with_the_installed_wheel(installed, tmp_path):
    changes = ["run.duration=0.2", "tracker.kind=frozen", "estimator.kind=none", "expect={}"]
    options = " ".join(f"--set {change}" for change in changes)
    lines = [f"run still --out out --quiet {options}", "report out"]
    files, ran, page = one_by_one(lines, tmp_path, installed)
    assert files == [str(installed / p / "__init__.py") for p in ("servo", "scenes")]
    assert ran == [0, "", ""]
    assert (tmp_path / "out" / "steps.parquet").exists()
    assert page == [0, "out/report.html\n", ""]


@pytest.mark.parametrize(("name", "code"), [("sim.py", 2), ("scenes.py", 2), ("notes.py", 0)])
def test_a_file_that_hides_an_installed_package_is_named(installed, tmp_path, name, code):
    (tmp_path / name).write_text("")
    (tmp_path / "tracking").mkdir()  # a folder without Python files hides no installed package
    ended = subprocess.run(
        [sys.executable, "-m", "servo", "--version"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": str(installed)},
    )
    place = tmp_path / name
    said = f"servobench: {place} hides servobench's package '{place.stem}': rename this file\n"
    assert (ended.returncode, ended.stderr) == (code, said if code else "")


def test_an_editable_install_offers_no_package_of_tests(tmp_path):
    code = "import importlib.util as u; print(u.find_spec('servo') is None, u.find_spec('tests'))"
    ended = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert ended.stdout == "False None\n"


def test_the_authors_are_those_of_the_citation(root):
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    citation = yaml.safe_load((root / "CITATION.cff").read_text())
    assert project["authors"] == citation["authors"]
    assert project["version"] == citation["version"]
