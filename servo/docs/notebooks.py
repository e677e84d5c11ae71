"""Converts tutorials in Markdown to Jupyter notebooks, with a cell for each block of code.

As a script, `python servo/docs/notebooks.py PAGE.md ...` writes PAGE.ipynb into the working
directory for each page.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

BLOCK = re.compile(r"^```(\w+)\n(.*?)^```\n", re.MULTILINE | re.DOTALL)
SAVED = re.compile(r"Save\s+as\s+`([\w./]+)`:\s*$")
DRAWN = re.compile(r"^!\[.*?\]\(pictures/.*?\)\n", re.MULTILINE)
"""Matches a picture of the page that running its code draws too."""
LINK = re.compile(r"\[([^\]]*)\]\((?!http)[^)]*\)")
"""Matches a link to another page, which a notebook cannot follow."""
MAGIC = {"python": "", "sh": "%%bash -e\n"}
COMMAND = re.compile(r"^(servobench|python)(?= )", re.MULTILINE)
RUN_AS = {"servobench": '"$PYTHON" -m servo', "python": '"$PYTHON"'}
SETUP = """import os
import sys
from importlib.util import find_spec

if find_spec("servo") is None:  # as in Colab
    %pip install -q 'servobench[notebook]'
os.environ["PYTHON"] = sys.executable  # the commands below run with this kernel's Python"""
"""First cell: installs servobench where it is missing; commands run with the kernel's Python, which
may not be on PATH.
"""
BEGIN = (
    "Run this in an empty folder, or in Colab; the first cell installs servobench where it is "
    "missing (in a checkout, before: `pip install '.[notebook]'`). Packages that the page names "
    "have to be installed as well."
)
LONGEST = 1800
"""Longest time of a cell [s]; the longest cell of the tutorials trains for some minutes."""
KERNEL = {"name": "python3", "display_name": "Python 3", "language": "python"}
Cell = dict[str, object]


def notebook(page: str) -> str:
    """Return the Jupyter notebook (JSON, nbformat 4) of a tutorial. Blocks of Python and shell
    become cells of code, and one after "Save as `FILE`:" becomes a cell that writes the file.

    Args:
        page: The tutorial in Markdown.
    """
    title, _, rest = page.partition("\n\n")
    cells = [_text(f"{title}\n\n{BEGIN}"), _code(SETUP), *_cells(rest)]
    numbered = [cell | {"id": f"cell-{number}"} for number, cell in enumerate(cells)]
    whole = {
        "nbformat": 4,
        "nbformat_minor": 5,
        "metadata": {"kernelspec": KERNEL},
        "cells": numbered,
    }
    return json.dumps(whole, indent=1)


def with_outputs(text: str) -> str:
    """Run all cells of a Jupyter notebook (JSON) in a new empty folder, and return the notebook
    (JSON) with the outputs of its cells.

    Raises:
        nbclient.exceptions.CellExecutionError: A cell ended with an error.
        nbclient.exceptions.CellTimeoutError: A cell ran for more than half an hour.
    """
    import nbformat
    from nbclient import NotebookClient

    whole = nbformat.reads(text, as_version=4)
    with TemporaryDirectory() as folder:
        place = {"metadata": {"path": folder}}
        NotebookClient(whole, timeout=LONGEST, resources=place).execute()
    return nbformat.writes(whole)


def _cells(page: str) -> Iterator[Cell]:
    """Yield the notebook cells of a page in Markdown. Blocks of Python and shell become code cells;
    other blocks, such as TOML, stay in text cells.
    """
    pieces = BLOCK.split(page)
    *texts, end = pieces[0::3]
    shown = ""
    for text, language, code in zip(texts, pieces[1::3], pieces[2::3], strict=True):
        saved = SAVED.search(text)
        shown += text
        if saved is None and language not in MAGIC:
            shown += f"```{language}\n{code}```\n"
            continue
        if shown.strip():
            yield _text(shown)
        shown = ""
        if saved is None:
            runs = COMMAND.sub(lambda found: RUN_AS[found[1]], code) if language == "sh" else code
            yield _code(MAGIC[language] + runs)
            continue
        folder, _, _ = saved[1].rpartition("/")
        if folder:
            yield _code(f"%mkdir -p {folder}")
        yield _code(f"%%writefile {saved[1]}\n{code}")
    yield _text(shown + end)


def _text(text: str) -> Cell:
    """Return a cell of Markdown, without pictures that code draws, and with the texts of links to
    other pages in place of the links.
    """
    source = LINK.sub(r"\1", DRAWN.sub("", text)).strip()
    return {"cell_type": "markdown", "metadata": {}, "source": source}


def _code(source: str) -> Cell:
    """Return a cell of code that has not been run."""
    cell: Cell = {"cell_type": "code", "metadata": {}, "source": source.rstrip("\n")}
    return cell | {"execution_count": None, "outputs": []}


if __name__ == "__main__":
    for name in sys.argv[1:]:
        page = Path(name)
        made = notebook(page.read_text(encoding="utf-8"))
        Path(f"{page.stem}.ipynb").write_text(made, encoding="utf-8")
