"""An extension of Sphinx: pages that are made from the code, so that they cannot be out of date."""

from __future__ import annotations

from importlib import resources
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

import cv2
from notebooks import notebook

import servo
from servo.cli.list_command import FOLDERS, settings_rows
from servo.loop.run_measures import MEANINGS
from servo.scenario.catalogue import sentence, shipped, studies
from servo.scenario.fill import form
from servo.scenario.tables import SECTIONS

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from sphinx.application import Sphinx

PAGES = ["servo/docs/gallery", "servo/docs/measures", "servo/docs/settings"]
WIDTH = 240
"""Of a thumbnail in the gallery [px]."""


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the pages with Sphinx."""
    app.connect("env-get-outdated", lambda *_: PAGES)  # the code may have changed
    app.connect("source-read", _complete)
    app.connect("build-finished", _finish)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _complete(app: Sphinx, page: str, source: list[str]) -> None:
    """Add to a page's own text what is made from the code."""
    if page == "servo/docs/settings":
        source[0] += _settings()
    if page == "servo/docs/measures":
        rows = [(f"`{name}`", unit, about) for name, (unit, about) in MEANINGS.items()]
        source[0] += _table(("measure", "unit", "meaning"), rows)
    if page == "servo/docs/gallery":
        source[0] += _gallery(app.outdir / "gallery")
    path = PurePosixPath(page)
    if path.parent.name == "tutorials" and path.name != "README":
        source[0] = _with_notebook(source[0], path.name, app.outdir / "notebooks")


def _settings() -> str:
    text = "\n## Sections\n"
    for name, config in SECTIONS.items():
        rows = settings_rows(name, form(config, described=True))
        text += f"\n### `[{name}]`\n\n{config.__doc__ or ''}\n\n{_settings_table(rows)}"
    for part, folder in FOLDERS.items():
        text += f"\n## Kinds of {part}\n"
        for kind in folder.names():
            rows = settings_rows(part, form(folder.config_of(kind), described=True))
            text += f'\n### {part} `"{kind}"`\n\n{folder.summary(kind)}\n\n{_settings_table(rows)}'
    return text


def _settings_table(rows: list[tuple[str, str, str]]) -> str:
    code = [(f"`{name}`", f"`{default}`" * bool(default), about) for name, default, about in rows]
    return _table(("setting", "default", "meaning"), code) if rows else ""


def _table(header: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """Return a table in Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    cells = [[" ".join(cell.replace("|", "\\|").split()) for cell in line] for line in lines]
    return "\n" + "".join(f"| {' | '.join(line)} |\n" for line in cells)


def _gallery(folder: Path) -> str:
    """Draw the first picture of every scenario; return the gallery."""
    folder.mkdir(parents=True, exist_ok=True)
    text = '\n<div class="gallery">\n'
    for name in shipped():
        picture = folder / f"{name}.webp"
        if not picture.exists():
            _draw(name, picture)
        about = sentence((resources.files("scenes") / f"{name}.toml").read_text(encoding="utf-8"))
        text += (
            f'<figure><img src="../../gallery/{name}.webp" alt="{name}" width="{WIDTH}">'
            f"<figcaption><code>{name}</code> {about}</figcaption></figure>\n"
        )
    rows = [
        (
            f"`{name}`",
            sentence((resources.files("scenes") / "studies" / f"{name}.toml").read_text()),
        )
        for name in studies()
    ]
    return text + "</div>\n\n## Studies\n" + _table(("study", "question"), rows)


def _with_notebook(page: str, name: str, folder: Path) -> str:
    """Write a tutorial's notebook; return the page with a link to it below its title."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.ipynb").write_text(notebook(page), encoding="utf-8")
    title, _, rest = page.partition("\n\n")
    link = f'<a href="../../notebooks/{name}.ipynb" download>Download this page as a notebook</a>'
    return f"{title}\n\n{link}\n\n{rest}"


def _draw(name: str, picture: Path) -> None:
    with servo.Episode(servo.load(name)) as episode:
        image = next(iter(episode)).frame.image
    height = round(WIDTH * image.shape[0] / image.shape[1])
    cv2.imwrite(
        str(picture), cv2.resize(image[..., ::-1], (WIDTH, height), interpolation=cv2.INTER_AREA)
    )


def _finish(app: Sphinx, error: Exception | None) -> None:
    """Write the page that leads from the site's root to its first page."""
    if error is None and app.builder.format == "html":
        first = f"{app.config.root_doc}.html"
        page = f'<!doctype html><meta http-equiv="refresh" content="0; url={first}">\n'
        (app.outdir / "index.html").write_text(page, encoding="utf-8")
