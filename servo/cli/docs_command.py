"""The command `servobench docs`: build the documentation's pages from a checkout."""

import webbrowser
from importlib.util import find_spec
from pathlib import Path

from rich.console import Console

import servo
from servo.cli.terminal import plain, waiting
from servo.mistake import Mistake

ROOT = Path(servo.__file__).parents[1]


def run(out: Path | None, no_open: bool, still: bool, run: bool) -> None:
    """Build the documentation's pages, print the path of the first one, and open it in a browser.

    Args:
        out: The folder to write; None: runs/docs.
        no_open: Whether the browser stays closed.
        still: Whether the gallery shows still pictures, not animations; this saves a minute.
        run: Whether to run the tutorials, so that their notebooks have outputs.

    Raises:
        Mistake: This is no checkout, a package is missing, or a page or tutorial has a mistake.
    """
    with waiting(Console(stderr=True), "Building the pages; the first time takes two minutes"):
        page = build(out or Path("runs/docs"), still=still, run=run).resolve()
    plain(Console(), str(page))
    if not no_open:
        webbrowser.open(page.as_uri())


def build(out: Path, *, still: bool = False, run: bool = False) -> Path:
    """Build the documentation's HTML pages that are missing or have changed, and return the path of
    the first page.

    Args:
        out: The folder to write.
        still: Whether the gallery shows still pictures, not animations; this saves a minute.
        run: Whether to run the tutorials, so that their notebooks have outputs.

    Raises:
        Mistake: There are no manuals here, Sphinx or a kernel for notebooks is missing, a page has
            a wrong link, or a tutorial that runs ends with an error.
    """
    if not (ROOT / "CONTRIBUTING.md").is_file():
        raise Mistake(
            "docs needs a checkout of servobench: this installed package has no manuals: clone the "
            "repository, and run docs from it"
        )
    try:
        from sphinx.cmd.build import build_main
    except ImportError:
        raise Mistake("docs needs the extra 'docs': pip install 'servobench[docs]'") from None
    if run and not all(find_spec(name) for name in ("nbclient", "ipykernel")):
        raise Mistake(
            "docs --run needs the extra 'test', for all that the tutorials import: "
            "pip install 'servobench[test]'"
        )
    options = ["-q", "--fail-on-warning", "--keep-going", "-c", str(ROOT / "servo" / "docs")]
    options += ["-D", "gallery_seconds=0"] * still
    options += ["-D", "run_tutorials=1"] * run
    if build_main([*options, str(ROOT), str(out)]):
        raise Mistake("the documentation has mistakes: correct those that Sphinx names above")
    return out / "index.html"
