"""Promises the project makes about itself."""

import ast
import re
import subprocess

import pytest

TOP = {
    "pyproject.toml",
    "sim",
    "tracking",
    "servo",
    "scenes",
    "tests",
    "README.md",
    ".ci",
    ".gitignore",
    "LICENSE",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
}
MOST_LINES, MOST_FUNCTION = 250, 40


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


def test_files_and_functions_stay_short(files):
    for path in (f for f in files if f.suffix == ".py"):
        text = path.read_text()
        assert text.count("\n") <= MOST_LINES, path
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef):
                doc = ast.get_docstring(node, clean=False) or ""
                length = node.end_lineno - node.lineno + 1 - (doc.count("\n") + 1 if doc else 0)
                assert length <= MOST_FUNCTION, f"{path}: {node.name}"


def test_every_module_opens_with_a_sentence(root, files):
    for path in (f for f in files if f.suffix == ".py" and "tests" not in f.parts):
        assert ast.get_docstring(ast.parse(path.read_text())), path


def test_nothing_names_a_package_index_or_a_home(files):
    pattern = re.compile(r"index[-_]url|https?://(pypi|files\.pythonhosted)|/home/|/root/")
    for path in (f for f in files if f.suffix in {".py", ".toml", ".md", ".xml"}):
        if path.name != "test_project.py":
            assert not pattern.search(path.read_text()), path


def test_ci_runs_the_readmes_test_command(root):
    readme, ci = (root / "README.md").read_text(), (root / ".ci" / "run").read_text()
    command = next(line for line in readme.splitlines() if "pytest" in line and "uv run" in line)
    assert command.split("&& ")[-1].strip() in ci
