"""The command `servobench new`: write the files of a small package with a new part (a tracker, law,
...), which can be installed and run, or of a repository of scenarios.
"""

import keyword
import re
from importlib import resources
from importlib.util import find_spec
from pathlib import Path

import click
from jinja2 import Environment, StrictUndefined

import servo
from servo.mistake import Mistake, writing
from servo.scenario.catalogue import PLUGINS
from tracking.files import atomic

NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
PART = {
    "pyproject.toml.jinja": "pyproject.toml",
    "README.md.jinja": "README.md",
    "test_part.py.jinja": "tests/test_{kind}.py",
}
"""Templates of a package with a part, and the files that are made of them."""
SCENES = {
    "scenarios.md.jinja": "README.md",
    "requirements.txt.jinja": "requirements.txt",
    "gitignore.jinja": ".gitignore",
    "scenes.yml.jinja": ".github/workflows/scenes.yml",
    "scenario.toml.jinja": "scenarios/{kind}.toml",
}
"""Templates of a repository of scenarios, and the files that are made of them."""
DOORS = {
    "class": {"class_tracker.py.jinja": "{kind}/tracker.py"},
    "program": {
        "class_tracker.py.jinja": "{kind}/tracker.py",
        "program_tracker.py.jinja": "{kind}/program.py",
    },
    "trax": {
        "class_tracker.py.jinja": "{kind}/tracker.py",
        "trax_tracker.py.jinja": "{kind}/server.py",
    },
}
"""Templates of a tracker that knows nothing of servobench, by the way in which it is connected."""
WORDS = {
    "class": "{kind}.tracker:{name}",
    "program": "'program:python {kind}/program.py'",
    "trax": "'trax:python {kind}/server.py'",
}
"""The value of the option --tracker for a tracker that is connected in each of these ways."""
OF_DOORS = {"door_readme.md.jinja": "README.md", "test_door.py.jinja": "tests/test_{kind}.py"}
"""Templates that are used for each of these ways, and the files that are made of them."""
SECTIONS = {
    "tracker": "tracker",
    "law": "controller",
    "features": "features",
    "estimator": "estimator",
    "motion": "motion",
    "robot": "robot",
}
"""The section of a scenario in which each part has its kind."""


def run(part: str, name: str, out: Path | None, door: str | None) -> None:
    """Write a package with a new part (a tracker, law, ...), or a repository of scenarios, and
    print the paths of its files.

    Args:
        part: What to begin, such as "tracker", "law" or "scenarios".
        name: Name of the part and of its package, or of the first scenario.
        out: The folder to write; None: a folder of that name.
        door: How a tracker that knows nothing of servobench is connected: as a "class", a "program"
            that speaks lines of JSON, or a "trax" server; None: the part is a package of servobench
            with settings of its own.

    Raises:
        Mistake: The name is not valid for a package or is taken, the folder is not empty or cannot
            be written, or `door` is given for a part other than a tracker.
        Refused: The disk is full or fails.
    """
    for path in new(part, name, out, door):
        click.echo(path)


def new(part: str, kind: str, folder: Path | None, door: str | None = None) -> list[Path]:
    """Write the files of a package with a new part (a tracker, law, ...), or of a repository of
    scenarios, from templates.

    Args:
        part: What to begin: "tracker", "law", "features", "estimator", "motion", "robot" or
            "scenarios".
        kind: Name of the part and of its package, or of the first scenario.
        folder: The folder to write; None: a folder of that name.
        door: How a tracker that knows nothing of servobench is connected: as a "class", a "program"
            that speaks lines of JSON, or a "trax" server; None: the part is a package of servobench
            with settings of its own.

    Returns:
        The paths of the files.

    Raises:
        Mistake: The name is not valid for a package or is taken, the folder is not empty or cannot
            be written, or `door` is given for a part other than a tracker.
        Refused: The disk is full or fails.
    """
    _check_name(part, kind)
    if door is not None and part != "tracker":
        raise Mistake(
            f"--door {door} has no effect on {part}: leave it out, or write "
            "`servobench new tracker`"
        )
    folder = folder or Path(kind)
    with writing(folder):
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise Mistake(f"{folder}: something is there already; choose another folder with --out")
        return [atomic.write(folder, name, text) for name, text in _files(part, kind, door).items()]


def _files(part: str, kind: str, door: str | None) -> dict[str, str]:
    """Return the texts of the files to write, by their paths inside the new folder."""
    section = SECTIONS.get(part, "")
    name = "".join(word.capitalize() for word in kind.split("_"))
    words = {
        "part": part,
        "noun": f"{'an' if part[0] in 'aeiou' else 'a'} {part}".replace("a features", "features"),
        "section": section,
        "group": PLUGINS[section][0].group if section else "",
        "kind": kind,
        "module": kind,
        "package": kind.replace("_", "-"),
        "name": name,
        "words": WORDS[door].format(kind=kind, name=name) if door else "",
        "version": servo.__version__,
        "scenario": {"law": "still", "motion": "circle"}.get(part, "line"),
    }
    environment = Environment(undefined=StrictUndefined, keep_trailing_newline=True)
    templates = resources.files("servo.cli") / "templates"
    chosen = PART | {f"{part}.py.jinja": "{kind}/__init__.py"} if section else SCENES
    if door is not None:
        chosen = OF_DOORS | DOORS[door]
    found = {
        name.format(kind=kind): environment.from_string(
            (templates / template).read_text("utf-8")
        ).render(words)
        for template, name in chosen.items()
    }
    if part == "robot":
        model = resources.files("scenes") / "robots" / "arm.xml"
        found[f"{kind}/robot.xml"] = model.read_text("utf-8")
    return found


def _check_name(part: str, kind: str) -> None:
    asked = f"new {part} {kind}"
    if not NAME.fullmatch(kind) or keyword.iskeyword(kind):
        raise Mistake(
            f"{asked}: '{kind}' cannot be the name of a package: use small letters, digits and "
            f"single underscores, such as my_{part}"
        )
    if part == "scenarios":
        return
    section = SECTIONS[part]
    if kind in PLUGINS[section][0].names():
        raise Mistake(f"{asked}: the {part} '{kind}' exists already; choose another name")
    if find_spec(kind) is not None:
        raise Mistake(
            f"{asked}: the new package would hide the module '{kind}', which is installed here; "
            "choose another name"
        )
