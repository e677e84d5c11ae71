"""The command `servobench docs`: build the documentation's pages from a checkout."""

from importlib.util import find_spec
from pathlib import Path

import servo
from servo.mistake import Mistake

ROOT = Path(servo.__file__).parents[1]


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
        raise Mistake("docs needs a checkout of servobench: this installed package has no manuals")
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
