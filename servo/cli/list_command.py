"""What there is to choose from: kinds by folder, scenarios, and the settings of one kind."""

from __future__ import annotations

import dataclasses
from importlib import resources
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from servo.mistake import Mistake
from servo.scenario.catalogue import LISTS, PLUGINS, sentence, shipped, studies
from sim import kinds

FOLDERS = {
    **{name: folder for name, (folder, _) in PLUGINS.items()},
    **LISTS,
    "sequences": "tracking.evaluation.sequences.generators",
}


def show_all() -> None:
    """Print every scenario and kind with its sentence."""
    console = Console()
    table = Table(box=None, show_header=False, pad_edge=False)
    for name in shipped():
        table.add_row("scenario", f"[bold]{name}[/]", _sentence(name))
    for name in studies():
        table.add_row("study", f"[bold]{name}[/]", _sentence(f"studies/{name}"))
    for section, folder in FOLDERS.items():
        for kind in kinds.names(folder):
            table.add_row(section, f"[bold]{kind}[/]", escape(kinds.summary(folder, kind)))
    console.print(table)


def show_kind(kind: str) -> None:
    """Print the settings of a kind.

    Raises:
        Mistake: There is no such kind anywhere.
    """
    found = [(s, f) for s, f in FOLDERS.items() if kind in kinds.names(f)]
    if not found:
        everything = ", ".join(k for f in FOLDERS.values() for k in kinds.names(f))
        raise Mistake(f"there is no kind '{kind}'; there is {everything}")
    console = Console()
    for section, folder in found:
        config = kinds.config_of(folder, kind)
        console.print(f'[bold]{section}.kind = "{kind}"[/]  {escape(kinds.summary(folder, kind))}')
        table = Table(box=None, pad_edge=False)
        for title in ("setting", "default", "meaning"):
            table.add_column(title)
        _add_settings(table, section, config())
        console.print(table)
        for name, settings in kinds.presets(folder, kind).items():
            changes = ", ".join(f"{key} = {value}" for key, value in settings.items())
            console.print(f'[bold]preset = "{name}"[/]  {escape(changes)}', highlight=False)


def _add_settings(table: Table, prefix: str, settings: Any) -> None:
    docs = kinds.field_docs(type(settings))
    for f in dataclasses.fields(settings):
        value = getattr(settings, f.name)
        if dataclasses.is_dataclass(value):
            _add_settings(table, f"{prefix}.{f.name}", value)
        else:
            shown = escape(str(getattr(value, "value", value)))
            table.add_row(f"{prefix}.{f.name}", shown, escape(docs[f.name]))


def _sentence(name: str) -> str:
    """What a scenario or a study shows."""
    return sentence((resources.files("scenes") / f"{name}.toml").read_text(encoding="utf-8"))
