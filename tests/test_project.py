"""Promises the project makes about itself."""

import ast
import re
import subprocess
import tomllib

import pytest
import yaml

TOP = {
    "pyproject.toml",
    "sim",
    "tracking",
    "servo",
    "scenes",
    "tests",
    "README.md",
    ".ci",
    ".github",
    ".gitignore",
    "LICENSE",
    "CHANGELOG.md",
    "CITATION.cff",
    "CONTRIBUTING.md",
}
MOST_README = 130
INSTALL = "python3 -m venv .uv && .uv/bin/pip install uv && "
MOST_LAYERS = 9
CONDA_NAMES = {
    "matplotlib-base": "matplotlib",
    "mujoco-python": "mujoco",
    "py-opencv": "opencv-python-headless",
}


@pytest.fixture(scope="module")
def files(root):
    listed = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard"],
        cwd=root,
        capture_output=True,
        text=True,
        check=False,
    )
    if listed.returncode:
        pytest.skip("this is not a git checkout")
    return [root / name for name in listed.stdout.splitlines() if (root / name).is_file()]


def test_the_top_level_is_as_agreed(root, files):
    assert {f.relative_to(root).parts[0] for f in files} <= TOP


def test_a_room_has_few_layers_below_it(root):
    settings = tomllib.loads((root / "pyproject.toml").read_text())
    layers = [c.get("layers", []) for c in settings["tool"]["importlinter"]["contracts"]]
    assert max(map(len, layers)) <= MOST_LAYERS


def test_every_module_opens_with_a_sentence(root, files):
    for path in (f for f in files if f.suffix == ".py" and "tests" not in f.parts):
        assert ast.get_docstring(ast.parse(path.read_text())), path


def test_nothing_names_a_package_index_or_a_home(files):
    pattern = re.compile(r"index[-_]url|https?://(pypi|files\.pythonhosted)|/home/|/root/")
    for path in (f for f in files if f.suffix in {".py", ".toml", ".md", ".xml", ".cff"}):
        if path.name != "test_project.py":
            assert not pattern.search(path.read_text()), path


def test_the_readme_stays_short(root):
    assert (root / "README.md").read_text().count("\n") <= MOST_README


def test_ci_runs_the_readmes_two_commands(root):
    readme, ci = (root / "README.md").read_text(), (root / ".ci" / "run").read_text()
    shown = [line for line in readme.splitlines() if line.startswith(INSTALL)]
    job, tests = (line.removeprefix(INSTALL).removeprefix(".uv/bin/") for line in shown)
    assert (job, tests) == ("uv run servobench run reversal", "uv run --extra test pytest")
    assert job in ci
    assert tests in ci


def test_the_citation_is_of_this_version(root):
    cited = yaml.safe_load((root / "CITATION.cff").read_text())
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    assert [cited["version"], cited["title"]] == [project["version"], project["name"]]
    assert cited["authors"] == [{"name": "The servobench developers"}]
    first = [reference["authors"][0]["family-names"] for reference in cited["references"]]
    assert first == ["Naeem", "Teuliere", "Nagy"]


def test_the_draft_of_the_paper_is_what_joss_takes(root):
    folder = root / ".ci" / "paper"
    text = (folder / "paper.md").read_text()
    sources = re.findall(r"^@\w+\{(\w+),", (folder / "paper.bib").read_text(), re.MULTILINE)
    assert len(text.split()) <= 1000
    assert {"# Summary", "# Statement of need", "# State of the field"} <= set(text.splitlines())
    assert set(re.findall(r"@(\w+)", text)) == set(sources)


def test_the_conda_recipe_needs_what_the_package_needs(root):
    recipe = yaml.safe_load((root / ".ci" / "conda" / "recipe.yaml").read_text())
    python, *needed = recipe["requirements"]["run"]
    text = "\n".join(needed).replace(" ", "")
    for there, here in CONDA_NAMES.items():
        text = text.replace(f"{there}>", f"{here}>")
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    assert text.splitlines() == project["dependencies"]
    assert recipe["context"]["version"] == project["version"]
    assert python == "python >=${{ python_min }}"


def test_every_check_of_the_repository_that_is_not_met_has_a_reason(root):
    tools = tomllib.loads((root / "pyproject.toml").read_text())["tool"]
    unmet = tools["repo-review"]["ignore"]
    assert unmet.keys() == {"PY004", "PY006", "PY007", "MY100", "PP006", "SEC001"}
    assert all(reason.endswith(".") for reason in unmet.values())
    hooks = yaml.safe_load((root / ".ci" / "pre-commit.yaml").read_text())["repos"][0]["hooks"]
    assert [hook["id"] for hook in hooks] == ["ruff-format", "ruff-check", "zizmor"]
