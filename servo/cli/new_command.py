"""What `servobench new` does: write a small package with a tracker, which installs and runs."""

import keyword
import re
import sys
from importlib import resources
from importlib.util import find_spec
from pathlib import Path

from jinja2 import Environment, StrictUndefined

from servo.mistake import Mistake, unwritable
from tracking.files import atomic
from tracking.trackers import KINDS as TRACKERS

NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
FILES = {
    "pyproject.toml.jinja": "pyproject.toml",
    "README.md.jinja": "README.md",
    "tracker.py.jinja": "{module}/__init__.py",
    "test_tracker.py.jinja": "tests/test_{module}.py",
}
"""Templates, and the files that are made of them."""
TAKEN = {
    "servobench's package '{}'": {"sim", "tracking", "servo", "scenes"},
    "Python's module '{}'": sys.stdlib_module_names,
}


def new_tracker(kind: str, folder: Path | None) -> list[Path]:
    """Write the package of a new tracker, by default into a folder of its kind's name; the paths of
    its files.

    Raises:
        Mistake: The name is no name of a package, is taken, or there is such a folder.
    """
    _check_name(kind)
    folder = folder or Path(kind)
    words = {
        "kind": kind,
        "module": kind,
        "package": kind.replace("_", "-"),
        "name": "".join(word.capitalize() for word in kind.split("_")),
    }
    environment = Environment(undefined=StrictUndefined, keep_trailing_newline=True)
    templates = resources.files("servo.cli") / "templates"
    try:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise Mistake(f"{folder}: there is something of this name; choose another with --out")
        return [
            atomic.write(
                folder,
                name.format(**words),
                environment.from_string((templates / template).read_text("utf-8")).render(words),
            )
            for template, name in FILES.items()
        ]
    except OSError as error:
        raise unwritable(folder, error) from None


def _check_name(kind: str) -> None:
    if not NAME.fullmatch(kind) or keyword.iskeyword(kind):
        raise Mistake(
            f"new tracker {kind}: a name has small letters, digits and single underscores, such as "
            "my_tracker"
        )
    if kind in TRACKERS.names():
        raise Mistake(f"new tracker {kind}: there is a tracker '{kind}' already")
    owner = next((owner for owner, taken in TAKEN.items() if kind in taken), "")
    if owner or find_spec(kind) is not None:
        what = owner or "the module '{}', which is installed here"
        raise Mistake(f"new tracker {kind}: this would hide {what.format(kind)}")
