"""The command `servobench list`: print all scenarios, studies and kinds of components (trackers,
robots, ...); or, for one name, its kinds, its settings or its description.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from enum import Enum
from importlib import resources
from itertools import chain
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markdown import Markdown
from rich.table import Table

from servo.cli.terminal import escape, print_table
from servo.mistake import Mistake, unknown
from servo.report import words
from servo.scenario.catalogue import LISTS, PLUGINS, sentence, shipped, studies
from tracking.sequences import painted

if TYPE_CHECKING:
    from pydantic import BaseModel

FOLDERS = {
    **{name: folder for name, (folder, _) in PLUGINS.items()},
    **LISTS,
    "sequences": painted.KINDS,
}
FILES = {"scenario": resources.files("scenes"), "study": resources.files("scenes") / "studies"}
PARTS = (*FILES, *FOLDERS)
ADVICE = "**Which one?**"
"""Beginning of the manual's paragraph that says which tracker to take."""


def run(what: str | None) -> None:
    """Print a list of what servobench has.

    Args:
        what: Name of a part (such as "tracker"): print its kinds; of a section or a kind: print its
            settings; of a scenario or study: print its first sentence. None: print all scenarios,
            studies and kinds of components.

    Raises:
        Mistake: Nothing of that name exists.
    """
    if what is None:
        show_all()
    else:
        show(what)


def show_all() -> None:
    """Print the name and the first sentence of every scenario, every study and every kind of
    component.
    """
    _show_names((part, name) for part in PARTS for name in _names(part))


def show(name: str) -> None:
    """Print what a name stands for: the kinds of a part (such as all trackers), the settings of a
    section or of a kind, or the first sentence of a scenario or study.

    Args:
        name: The name, such as "tracker", "camera", "kams" or "reversal".

    Raises:
        Mistake: Nothing of that name exists.
    """
    from servo.scenario.tables import SECTIONS  # it takes time to import

    found = [(part, each) for part in PARTS for each in _names(part) if name in (part, each)]
    with_settings = [part for part, each in found if each == name and part in FOLDERS]
    if not found or name in SECTIONS:
        _show_section(name)
    for part in with_settings:
        _show_kind(part, name)
    if found and not with_settings:
        _show_names(found)
    if name == "tracker":
        _show_advice()


def _show_names(found: Iterable[tuple[str, str]]) -> None:
    table = Table(box=None, show_header=False, pad_edge=False)
    for part, name in found:
        table.add_row(part, f"[bold]{escape(name)}[/]", escape(_about(part, name)))
    Console().print(table)


def _show_advice() -> None:
    """Print the paragraph and the table of the manual that say which tracker to take."""
    manual = (resources.files("tracking") / "README.md").read_text(encoding="utf-8")
    advice = manual[manual.index(ADVICE) :]
    end = advice.index("\n\n", advice.index("|"))
    Console().print()
    Console().print(Markdown(advice[:end], hyperlinks=False))


def _about(part: str, name: str) -> str:
    """Return the first sentence of the description of a kind, a scenario or a study; for a kind of
    another package, that package's name comes first, in brackets.
    """
    if part in FILES:
        return sentence((FILES[part] / f"{name}.toml").read_text(encoding="utf-8"))
    package = FOLDERS[part].package_of(name)
    return f"({package}) " * bool(package) + FOLDERS[part].summary(name)


def _names(part: str) -> list[str]:
    """Return the names of the kinds of a part, of the scenarios or of the studies."""
    files = {"scenario": shipped, "study": studies}
    return files[part]() if part in files else FOLDERS[part].names()


def _show_kind(part: str, kind: str) -> None:
    from servo.scenario.fill import form  # it takes time to import

    folder = FOLDERS[part]
    settings = settings_rows(part, form(folder.config_of(kind), described=True))
    _show_settings(f'{part}.kind = "{kind}"', folder.summary(kind), settings)
    for name, changed in folder.presets(kind).items():
        changes = ", ".join(f"{key} = {value}" for key, value in changed.items())
        Console().print(f'[bold]preset = "{name}"[/]  {escape(changes)}', highlight=False)


def _show_section(name: str) -> None:
    from servo.cli import schema_command as schemas  # it takes time to import
    from servo.scenario.fill import form
    from servo.scenario.tables import KEYS, SECTIONS

    tables = {
        "expect": schemas.expect_schema,
        "sweep": schemas.sweep_schema,
        "vary": schemas.vary_schema,
    }
    if name in SECTIONS:
        config = SECTIONS[name]
        _show_settings(
            f"[{name}]",
            (config.__doc__ or "").partition("\n\n")[0],
            settings_rows(name, form(config, described=True)),
        )
    elif name in tables:
        table = tables[name]()
        rows = [
            (f"{name}.{key}", str(item.get("default", "")), item["description"])
            for key, item in table.get("properties", {}).items()
        ]
        _show_settings(f"[{name}]", table["description"], rows)
    else:
        near = get_close_matches(name, {*KEYS, *PARTS, *chain(*map(_names, PARTS))}, n=1)
        known = near or dict.fromkeys((*PARTS, *KEYS))
        more = "" if near else ", and the kinds that servobench list shows"
        raise Mistake(unknown(name, known, "part, section or kind") + more)


def _show_settings(title: str, about: str, rows: list[tuple[str, str, str]]) -> None:
    console = Console()
    console.print(f"[bold]{escape(title)}[/]  {escape(about)}")
    print_table(console, words.Table(("setting", "default", "meaning"), rows, words=range(3)))


def settings_rows(prefix: str, settings: type[BaseModel]) -> list[tuple[str, str, str]]:
    """Return a row (name, default, meaning), as texts, for every setting of a table of a scenario,
    with those of the tables inside it.

    Args:
        prefix: Name of the table, such as "camera", which begins the names of its settings.
        settings: The pydantic model of the table.
    """
    rows = list[tuple[str, str, str]]()
    for name, field in settings.model_fields.items():
        default = field.default
        if hasattr(default, "model_fields_set"):  # a table inside the table
            rows += settings_rows(f"{prefix}.{name}", type(default))
        else:
            shown = str(default.value if isinstance(default, Enum) else default)
            rows.append((f"{prefix}.{name}", shown, field.description or ""))
    return rows
