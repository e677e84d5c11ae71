"""A Sphinx extension that makes pages from the code: settings, measures, gallery, examples, results
of the benchmarks, and tutorials as notebooks.
"""

from __future__ import annotations

import os
import subprocess
import sys
from importlib import resources
from inspect import getdoc
from itertools import islice
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, cast

import cv2
from notebooks import notebook, with_outputs
from sphinx.util.display import status_iterator
from sphinx.util.logging import getLogger

import servo
from servo.bench.names import NAMES
from servo.cli.list_command import FOLDERS, settings_rows
from servo.loop.measure import MEASURES
from servo.report.benchmark_section import published_section
from servo.report.page import render
from servo.scenario.catalogue import sentence, shipped, studies
from servo.scenario.fill import form
from servo.scenario.tables import SECTIONS
from tracking.drawing import colours
from tracking.drawing.film_page import panel

if TYPE_CHECKING:
    from collections.abc import Iterable

    from sphinx.application import Sphinx

    from sim.types import Image

logger = getLogger(__name__)
PAGES = [f"servo/docs/{name}" for name in ("examples", "gallery", "measures", "settings")]
"""Pages that are made anew in each build."""
WIDTH = 240
"""Width of a picture in the gallery [px]."""
SECONDS = 5
"""Simulated time of an animation in the gallery [s]."""
RATE = 8.0
"""Approximate frame rate of an animation [Hz]."""
QUALITY = 55
"""Quality of the frames of an animation, from 0 to 100."""
COLAB = "https://colab.research.google.com/github/{}/blob/notebooks/{}.ipynb"
"""Address at which Colab opens a notebook of a public repository's branch `notebooks`."""


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the extension to a Sphinx application; return that Sphinx may read and write its
    pages in parallel. Sphinx calls it.
    """
    app.add_config_value("gallery_seconds", SECONDS, "", int)
    app.add_config_value("run_tutorials", False, "env", bool)
    app.connect("env-get-outdated", lambda *_: PAGES)  # the code may have changed
    app.connect("source-read", _complete)
    app.connect("autodoc-process-docstring", _begin_with_comment, priority=400)  # before napoleon
    app.connect("build-finished", _finish)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _complete(app: Sphinx, page: str, source: list[str]) -> None:
    """Add to a page's source the part that is made from the code; a tutorial gets a link to its
    notebook, which is written too.

    Args:
        app: The Sphinx application.
        page: Name of the page: its path in the repository, without ending.
        source: A list with one item, the page in Markdown, which is replaced.
    """
    if page == "servo/docs/settings":
        source[0] += _settings()
    if page == "servo/docs/measures":
        rows = [(f"`{m.name}`", m.unit, m.meaning) for m in MEASURES.values()]
        source[0] += _table(("measure", "unit", "meaning"), rows)
    if page == "servo/docs/gallery":
        source[0] += _gallery(app.outdir / "gallery", app.config.gallery_seconds)
    if page == "servo/docs/examples":
        scripts = sorted((Path(servo.__file__).parent / "examples").glob("[a-z]*.py"))
        source[0] += "".join(_example(s, is_run=app.config.run_tutorials) for s in scripts)
    if page == "scenes/benchmarks/README":
        links = [f'- <a href="../../{n}.html">{n}: rows, conditions, curves</a>\n' for n in NAMES]
        rows = f"\n## All of the published rows\n\n{''.join(links)}"
        source[0] = source[0].replace("\n## ", f"{rows}\n## ", 1)
    path = PurePosixPath(page)
    if path.parent.name == "tutorials" and path.name != "README":
        source[0] = _with_notebook(app, source[0], path.name)


def _begin_with_comment(_: Sphinx, what: str, *rest: object) -> None:
    """Insert an empty comment before the docstring of an attribute or property, the last argument:
    napoleon takes what is before a colon in the first line as the type.
    """
    if what in ("attribute", "property"):
        lines = cast("list[str]", rest[-1])
        lines[:0] = ["..", ""]


def _example(path: Path, *, is_run: bool) -> str:
    """Return an example script in Markdown, with what it prints if it is run."""
    _, about, program = path.read_text(encoding="utf-8").split('"""', 2)
    text = f"\n## {path.stem}\n\n{about.strip()}\n\n```python\n{program.strip()}\n```\n"
    if is_run:
        with TemporaryDirectory() as folder:
            words = [sys.executable, "-m", f"servo.examples.{path.stem}"]
            done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=True)
        text += f"\nIt prints:\n\n```text\n{done.stdout.strip()}\n```\n"
    return text


def _settings() -> str:
    """Return tables of all settings of a scenario in Markdown, by section and kind."""
    text = "\n## Sections\n"
    for name, config in SECTIONS.items():
        rows = settings_rows(name, form(config, described=True))
        text += f"\n### `[{name}]`\n\n{getdoc(config)}\n\n{_settings_table(rows)}"
    for part, folder in FOLDERS.items():
        text += f"\n## Kinds of {part}\n"
        for kind in folder.names():
            rows = settings_rows(part, form(folder.config_of(kind), described=True))
            text += f'\n### {part} `"{kind}"`\n\n{folder.summary(kind)}\n\n{_settings_table(rows)}'
    return text


def _settings_table(rows: list[tuple[str, str, str]]) -> str:
    """Return a table in Markdown of settings: (name, default, meaning); "" without settings."""
    code = [(f"`{name}`", f"`{default}`" * bool(default), about) for name, default, about in rows]
    return _table(("setting", "default", "meaning"), code) if rows else ""


def _table(header: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """Return a table in Markdown with a header and rows of cells."""
    lines = [header, ["---"] * len(header), *rows]
    cells = [[" ".join(cell.replace("|", "\\|").split()) for cell in line] for line in lines]
    return "\n" + "".join(f"| {' | '.join(line)} |\n" for line in cells)


def _gallery(folder: Path, seconds: float) -> str:
    """Return a gallery of all scenarios and a table of all studies, in Markdown.

    Args:
        folder: Folder of the animations; those that are missing are rendered.
        seconds: Simulated time that an animation shows [s].
    """
    folder.mkdir(parents=True, exist_ok=True)
    text = '\n<div class="gallery">\n'
    for name in status_iterator(shipped(), "drawing scenarios... ", length=len(shipped())):
        picture = folder / f"{name}.webp"
        if not picture.exists():
            _draw(name, picture, seconds)
        about = sentence((resources.files("scenes") / f"{name}.toml").read_text(encoding="utf-8"))
        text += (
            f'<figure><img src="../../gallery/{name}.webp" alt="{name}" width="{WIDTH}" '
            f'loading="lazy">'
            f"<figcaption><code>{name}</code> {about}</figcaption></figure>\n"
        )
    scenes = resources.files("scenes") / "studies"
    rows = [(f"`{name}`", sentence((scenes / f"{name}.toml").read_text())) for name in studies()]
    return text + "</div>\n\n## Studies\n" + _table(("study", "question"), rows)


def _with_notebook(app: Sphinx, page: str, name: str) -> str:
    """Write the notebook of a tutorial, and return the tutorial's page with a link to it.

    Args:
        app: The Sphinx application.
        page: The tutorial in Markdown; the link is added below its title.
        name: Name of the tutorial.
    """
    folder = app.outdir / "notebooks"
    folder.mkdir(parents=True, exist_ok=True)
    text = notebook(page)
    if app.config.run_tutorials:
        try:
            text = with_outputs(text)
        except Exception as error:  # whatever a cell does; a warning ends the build
            logger.warning("the notebook of %s: %s", name, error)
    (folder / f"{name}.ipynb").write_text(text, encoding="utf-8")
    title, _, rest = page.partition("\n\n")
    link = f'<a href="../../notebooks/{name}.ipynb" download>Download this page as a notebook</a>'
    repository = os.environ.get("GITHUB_REPOSITORY")  # set in GitHub's workflows only
    if repository:
        link += f' or <a href="{COLAB.format(repository, name)}">open it in Colab</a>'
    return f"{title}\n\n{link}\n\n{rest}"


def _draw(name: str, picture: Path, seconds: float) -> None:
    """Render a scenario, and write an animation (WebP) with the goal and the tracker's estimate.

    Args:
        name: Name of the scenario.
        picture: Path of the animation.
        seconds: Simulated time that the animation shows [s].
    """
    film = cv2.Animation()
    frames: list[Image] = []
    with servo.Episode(servo.load(name, ["run.latency=0"])) as episode:
        every = max(1, round(1 / (RATE * episode.world.period)))
        camera = episode.world.camera
        height = round(WIDTH * camera.height / camera.width)
        for step in islice(episode, 0, max(1, round(seconds / episode.world.period)), every):
            marks = (
                (step.goal.corners, colours.GOAL),
                (step.estimate.outline(step.region), colours.ESTIMATE),
            )
            shown = panel(step.frame.image, WIDTH, height, marks, step.estimate.particles)
            frames.append(shown[..., ::-1])
        film.durations = [round(1e3 * every * episode.world.period)] * len(frames)
    film.frames = frames
    cv2.imwriteanimation(str(picture), film, [cv2.IMWRITE_WEBP_QUALITY, QUALITY])


def _finish(app: Sphinx, error: Exception | None) -> None:
    """After a build without error, write the pages of the benchmarks, and an index.html that
    redirects to the first page.
    """
    if error is None and app.builder.format == "html":
        first = f"{app.config.root_doc}.html"
        page = f'<!doctype html><meta http-equiv="refresh" content="0; url={first}">\n'
        (app.outdir / "index.html").write_text(page, encoding="utf-8")
        for name in NAMES:
            text = render([published_section(name)])
            (app.outdir / f"{name}.html").write_text(text, encoding="utf-8")
