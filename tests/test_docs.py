"""The documentation site: it builds without a warning, and its links lead somewhere."""

import json
import re
import runpy
import subprocess
import sys
import webbrowser
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import unquote, urlsplit

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from nbclient.exceptions import CellExecutionError

import servo
from servo.cli import docs_command
from servo.cli.main import app
from servo.mistake import Mistake
from servo.scenario.catalogue import PLUGINS, shipped

LINK = re.compile(r'(?:href|src)="([^"]+)"')
ROOT = Path(__file__).parents[1]
TOO_WIDE = """
    const scrolls = (element) => element && element.tagName != 'ARTICLE' &&
        (getComputedStyle(element).overflowX != 'visible' || scrolls(element.parentElement));
    return [...document.querySelectorAll('article *')]
        .filter((e) => e.getBoundingClientRect().right > arguments[0] && !scrolls(e))
        .map((e) => e.outerHTML.slice(0, 80));
"""
"""What is beyond the right border of the screen, and not in a box that scrolls."""
CUT = """
    return [...document.querySelectorAll('article pre:not(.highlight-text pre)')]
        .filter((e) => e.scrollWidth > e.clientWidth)
        .map((e) => e.textContent.slice(0, 80));
"""
"""Code of which a line ends out of sight; diagrams are wider than a phone."""
ANCHOR = re.compile(r'\bid="([^"]+)"')
DRAWN = {"depth_plate", "line", "mesh_circle", "plate_circle", "recording", "tag_line"}
"""The scenarios whose pictures the tested site draws; `servobench check` runs all of them."""


@pytest.fixture(scope="module")
def site(made_once):
    """The built site; a process of its own, because Sphinx changes the one that it runs in."""

    def build(folder):
        gallery = folder / "gallery"
        gallery.mkdir()
        for name in set(shipped()) - DRAWN:
            (gallery / f"{name}.webp").touch()  # those that are there are not drawn
        words = ["-m", "servo", "docs", "--no-open", "--still", "--out", str(folder)]
        done = subprocess.run([sys.executable, *words], capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout.splitlines() == [str(folder.resolve() / "index.html")]

    return made_once("site", build)


@pytest.mark.wide
@pytest.mark.processes
def test_every_link_and_picture_of_the_site_is_there(site):
    texts = {page: page.read_text() for page in site.rglob("*.html") if "_static" not in page.parts}
    anchors = {page: set(ANCHOR.findall(text)) for page, text in texts.items()}
    wrong = []
    for page, text in texts.items():
        for link in map(urlsplit, LINK.findall(text)):
            if link.scheme:
                continue
            target = (page.parent / unquote(link.path)).resolve() if link.path else page
            there = target.is_file() and (not link.fragment or target not in anchors)
            if not there and unquote(link.fragment) not in anchors.get(target, ()):
                wrong.append((page.name, link.geturl()))
    assert len(texts) > 30
    assert wrong == []


@pytest.mark.wide
@pytest.mark.processes
def test_the_site_shows_every_setting_and_scenario(site):
    settings = (site / "servo" / "docs" / "settings.html").read_text()
    kinds = [f"&quot;{kind}&quot;" for folder, _ in PLUGINS.values() for kind in folder.names()]
    assert [kind for kind in kinds if kind not in settings] == []
    assert "tracker.particles" in settings
    gallery = site / "gallery"
    assert sorted(picture.stem for picture in gallery.glob("*.webp")) == shipped()
    assert all(cv2.imread(str(gallery / f"{name}.webp")).std() > 10 for name in DRAWN)
    page = (site / "servo" / "docs" / "gallery.html").read_text()
    assert re.findall(r'src="../../gallery/(\w+).webp"', page) == shipped()


@pytest.mark.wide
@pytest.mark.newest
def test_the_gallery_moves(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(ROOT / "servo" / "docs")
    pages = runpy.run_path(str(ROOT / "servo" / "docs" / "pages.py"))
    picture = tmp_path / "line.webp"
    pages["_draw"]("line", picture, 1.0)
    found, film = cv2.imreadanimation(str(picture))
    assert found
    assert film.frames[0].shape[:2] == (180, 240)
    assert set(film.durations) == {133}  # every fourth picture of 30 Hz
    first, *_, last = film.frames
    assert len(film.frames) == 8
    assert np.abs(last.astype(int) - first).max() > 50


@pytest.mark.wide
@pytest.mark.processes
def test_the_site_has_every_example_and_what_it_says_of_attributes(site):
    page = (site / "servo" / "docs" / "examples.html").read_text()
    scripts = {path.stem for path in (ROOT / "servo" / "examples").glob("[a-z]*.py")}
    assert set(re.findall(r"<h2>(\w+)<", page)) == scripts
    python = (site / "servo" / "docs" / "api.html").read_text()
    said = "Distortion of the lens; None: a lens without distortion (pinhole)."
    assert said in python  # not "Distortion of the lens; None" as a type


@pytest.mark.processes
def test_an_example_that_is_run_shows_what_it_prints(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "servo" / "docs")
    example = runpy.run_path(str(ROOT / "servo" / "docs" / "pages.py"))["_example"]
    text = example(ROOT / "servo" / "examples" / "own_tracker.py", is_run=True)
    assert text.startswith("\n## own_tracker\n\nExample of a custom tracker in the closed loop: ")
    assert re.search(r"\nIt prints:\n\n```text\n.* from the goal: [\d.]+ px\n```\n$", text)


@pytest.mark.wide
@pytest.mark.processes
def test_pages_are_as_wide_as_the_screen(site, browser):
    wrong = []
    for page in sorted((site / "servo").rglob("*.html")):
        browser.get(page.as_uri())
        for width in (1600, 390):
            screen = {"width": width, "height": 844, "deviceScaleFactor": 1, "mobile": width < 500}
            browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)
            found = browser.execute_script(TOO_WIDE, width) + browser.execute_script(CUT)
            wrong += [(page.name, width, text) for text in found]
    assert wrong == []


@pytest.mark.wide
@pytest.mark.processes
def test_the_first_page_begins_as_the_readme_does(site):
    page = (site / "servo" / "docs" / "index.html").read_text()
    first = (ROOT / "README.md").read_text().split("**")[1]
    assert 0 < page.index(f"<strong>{first}</strong>") < page.index("<h2>Run it<")
    assert "From Python</h2>" not in page


@pytest.mark.wide
@pytest.mark.processes
def test_the_overview_of_tutorials_shows_their_pictures(site):
    pictures = {path.name for path in (ROOT / "servo" / "tutorials" / "pictures").iterdir()}
    page = (site / "servo" / "tutorials" / "README.html").read_text()
    assert set(re.findall(r'src="../../_images/([^"]+)"', page)) == pictures


@pytest.mark.wide
@pytest.mark.processes
def test_formulas_of_the_manuals_are_rendered(site):
    pages = {name: (site / name / "README.html").read_text() for name in ("servo", "tracking")}
    counts = {
        name: text.count('<math xmlns="http://www.w3.org/1998/Math/MathML" display="block">')
        for name, text in pages.items()
    }
    assert counts == {"servo": 4, "tracking": 1}
    assert "<mi>&#x003BB;</mi><msup><mi>L</mi>" in pages["servo"]  # lambda L#


@pytest.mark.wide
@pytest.mark.processes
def test_a_tutorial_leads_to_its_notebook(site):
    tutorials = {path.stem for path in (ROOT / "servo" / "tutorials").glob("*.md")} - {"README"}
    assert {path.stem for path in (site / "notebooks").glob("*.ipynb")} == tutorials
    page = (site / "servo" / "tutorials" / "your_tracker.html").read_text()
    assert '<a href="../../notebooks/your_tracker.ipynb" download>' in page


def test_a_notebook_has_a_cell_for_each_block():
    page = (
        "# Title\n\nText with a [link](other.md).\n\n```toml\nshown = 1\n```\n\nSave as\n`sub/a.py`:\n\n"
        "```python\nx = 1\n```\n\nThen:\n\n```sh\necho 2\n```\n\n```python\nprint(3)\n```\n\n"
        "![Drawn](pictures/a.png)\n\nThe [end](https://a.b).\n"
    )
    notebook = runpy.run_path(str(ROOT / "servo" / "docs" / "notebooks.py"))["notebook"]
    cells = json.loads(notebook(page))["cells"]
    first, *others = [cell["source"] for cell in cells]
    assert first.startswith("# Title\n\nRun this in an empty folder, or in Colab; the first cell")
    assert others == [
        "import os\nimport sys\nfrom importlib.util import find_spec\n\n"
        'if find_spec("servo") is None:  # as in Colab\n'
        "    %pip install -q 'servobench[notebook]'\n"
        'os.environ["PYTHON"] = sys.executable  # the commands below run with this kernel\'s Python',
        "Text with a link.\n\n```toml\nshown = 1\n```\n\nSave as\n`sub/a.py`:",
        "%mkdir -p sub",
        "%%writefile sub/a.py\nx = 1",
        "Then:",
        "%%bash -e\necho 2",
        "print(3)",
        "The [end](https://a.b).",
    ]
    kinds = [cell["cell_type"] for cell in cells]
    assert kinds == [
        *("markdown", "code", "markdown", "code", "code"),
        *("markdown", "code", "code", "markdown"),
    ]


@pytest.mark.processes
def test_a_notebook_that_was_run_has_what_its_cells_print(tmp_path):
    page = "# Title\n\n```sh\nservobench --version\n```\n\n```python\nprint(1 + 1)\n```\n\nEnd.\n"
    made = runpy.run_path(str(ROOT / "servo" / "docs" / "notebooks.py"))
    cells = json.loads(made["with_outputs"](made["notebook"](page)))["cells"]
    printed = ["".join(o["text"]) for c in cells if "outputs" in c for o in c["outputs"]]
    assert printed == [f"servobench {servo.__version__}\n", "2\n"]
    with pytest.raises(CellExecutionError, match="ZeroDivisionError"):
        made["with_outputs"](made["notebook"]("# Title\n\n```python\n1 / 0\n```\n"))


@pytest.mark.processes
def test_a_notebook_installs_servobench_where_it_is_missing(tmp_path):
    """Runs the first cell in a kernel that does not find servobench, with a pip that only speaks."""
    made = runpy.run_path(str(ROOT / "servo" / "docs" / "notebooks.py"))
    without = (
        "```python\nimport importlib.util\nfrom IPython import get_ipython\n\n"
        "importlib.util.find_spec = lambda name: None\n"
        "get_ipython().register_magic_function(lambda line: print('pip', line), magic_name='pip')\n```\n"
    )
    whole = json.loads(made["notebook"](f"# Title\n\n{without}\nEnd.\n"))
    whole["cells"].insert(0, whole["cells"].pop(2))
    cells = json.loads(made["with_outputs"](json.dumps(whole)))["cells"]
    printed = ["".join(o["text"]) for c in cells if "outputs" in c for o in c["outputs"]]
    assert printed == ["pip install -q 'servobench[notebook]'\n"]


@pytest.mark.processes
def test_the_notebook_of_a_tutorial_runs():
    made = runpy.run_path(str(ROOT / "servo" / "docs" / "notebooks.py"))
    page = (ROOT / "servo" / "tutorials" / "your_control_law.md").read_text()
    cells = json.loads(made["with_outputs"](made["notebook"](page)))["cells"]
    (printed,) = ("".join(o["text"]) for c in cells for o in c.get("outputs", []) if "text" in o)
    assert re.search(r"^line, proportional: 1[3-6]\.\d+ px", printed, re.MULTILINE), printed


def test_in_a_workflow_a_tutorial_leads_to_colab(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(ROOT / "servo" / "docs")
    monkeypatch.setenv("GITHUB_REPOSITORY", "owner/name")
    pages = runpy.run_path(str(ROOT / "servo" / "docs" / "pages.py"))
    built = SimpleNamespace(outdir=tmp_path, config=SimpleNamespace(run_tutorials=False))
    page = pages["_with_notebook"](built, "# Title\n\nText.\n", "mine")
    assert (
        '<a href="https://colab.research.google.com/github/owner/name/blob/notebooks/mine.ipynb">'
        in page
    )
    assert (tmp_path / "notebooks" / "mine.ipynb").is_file()


def test_a_script_writes_the_notebooks_of_pages(tmp_path):
    pages = [ROOT / "servo" / "tutorials" / name for name in ("exercises.md", "your_tracker.md")]
    words = [sys.executable, str(ROOT / "servo" / "docs" / "notebooks.py"), *map(str, pages)]
    subprocess.run(words, cwd=tmp_path, check=True)
    made = {path.name: json.loads(path.read_text()) for path in tmp_path.iterdir()}
    assert sorted(made) == ["exercises.ipynb", "your_tracker.ipynb"]
    assert made["exercises.ipynb"]["cells"][1]["source"].startswith("import os")


def test_the_commands_of_a_notebook_need_no_path():
    page = "# Title\n\nThen:\n\n```sh\nservobench --version\npython -c 'print(1)'\n```\n\nEnd.\n"
    notebook = runpy.run_path(str(ROOT / "servo" / "docs" / "notebooks.py"))["notebook"]
    (command,) = (
        cell["source"].removeprefix("%%bash -e\n")
        for cell in json.loads(notebook(page))["cells"]
        if cell["source"].startswith("%%bash")
    )
    where = {"PATH": "/bin:/usr/bin", "PYTHON": sys.executable}
    ran = subprocess.run(
        ["/bin/bash", "-ec", command], env=where, text=True, capture_output=True, check=False
    )
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.startswith("servobench ")
    assert ran.stdout.endswith("\n1\n")


def test_the_missing_extra_is_named(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "sphinx.cmd.build", None)
    with pytest.raises(
        Mistake, match=r"^docs needs the extra 'docs': pip install 'servobench\[docs\]'$"
    ):
        docs_command.build(tmp_path)


@pytest.mark.wide
def test_the_missing_kernel_of_the_tutorials_is_named(monkeypatch, tmp_path):
    monkeypatch.setattr(docs_command, "find_spec", lambda name: None)
    with pytest.raises(
        Mistake,
        match=r"^docs --run needs the extra 'test', .*: pip install 'servobench\[test\]'$",
    ):
        docs_command.build(tmp_path, run=True)


def test_an_installed_package_has_no_manuals(monkeypatch, tmp_path):
    monkeypatch.setattr(docs_command, "ROOT", tmp_path)
    with pytest.raises(Mistake, match=r"^docs needs a checkout of servobench"):
        docs_command.build(tmp_path)


@pytest.mark.parametrize(
    ("options", "opened"), [([], ["file:///a/index.html"]), (["--no-open"], [])]
)
def test_the_page_is_opened_unless_that_is_not_wanted(monkeypatch, options, opened):
    shown, given = [], []
    monkeypatch.setattr(
        docs_command, "build", lambda out, still, run: given.append(out) or Path("/a/index.html")
    )
    monkeypatch.setattr(webbrowser, "open", shown.append)
    assert CliRunner().invoke(app, ["docs", *options]).output == "/a/index.html\n"
    assert shown == opened
    assert given == [Path("runs/docs")]
