"""A folder is a registry: a file's name is a kind, its `Config` holds the settings and builds the
thing.

Dropping a file into one of the folders is all it takes to add a motion, a tracker, an estimator,
...
"""

from __future__ import annotations

import ast
import dataclasses
import importlib
import importlib.util
import inspect
import itertools
import pkgutil
from pathlib import Path
from typing import Any, cast


class UnknownKind(ValueError):
    """No file of that name in the folder; the message lists what there is."""


def names(folder: str) -> list[str]:
    """The kinds a folder (a package such as 'tracking.trackers') has, sorted."""
    spec = importlib.util.find_spec(folder)
    paths = spec.submodule_search_locations if spec else None
    return sorted(m.name for m in pkgutil.iter_modules(paths) if not m.name.startswith("_"))


def config_of(folder: str, kind: str) -> type[Any]:
    """The `Config` class of one kind.

    Raises:
        UnknownKind: The folder has no such file.
    """
    _check(folder, kind)
    return importlib.import_module(f"{folder}.{kind}").Config


OWN = ("sim", "tracking", "servo")
"""The packages whose folders of plugins name a kind by its file."""


def kind_of(config: Any) -> str:
    """The kind of a `Config`: its own attribute `kind` where it has one, the name of its file in
    one of our folders, and module:Class from elsewhere.
    """
    own, of = getattr(config, "kind", None), type(config)
    if isinstance(own, str):
        return own
    package, _, kind = of.__module__.rpartition(".")
    ours = package.partition(".")[0] in OWN and of.__qualname__ == "Config"
    return kind if ours else f"{of.__module__}:{of.__qualname__}"


def preset(folder: str, kind: str, name: str) -> dict[str, Any]:
    """The settings that a kind has under a name, such as the "paper" it comes from.

    Raises:
        UnknownKind: There is no such kind, or it has no such preset.
    """
    known: dict[str, dict[str, Any]] = presets(folder, kind)
    if name not in known:
        there = f"there is {', '.join(known)}" if known else f"'{kind}' has none"
        raise UnknownKind(f"there is no preset '{name}'; {there}")
    return known[name]


def presets(folder: str, kind: str) -> dict[str, dict[str, Any]]:
    """All presets of a kind by name: the `PRESETS` of its file."""
    _check(folder, kind)
    return getattr(importlib.import_module(f"{folder}.{kind}"), "PRESETS", {})


def _check(folder: str, kind: str) -> None:
    """Refuse what is no file of the folder, before anything is imported by that name."""
    if kind not in names(folder):
        raise UnknownKind(f"there is no kind '{kind}'; there is {', '.join(names(folder))}")


def summary(folder: str, kind: str) -> str:
    """The first sentence of the kind's file, read without importing what it needs."""
    _check(folder, kind)
    spec = importlib.util.find_spec(f"{folder}.{kind}")
    source = "" if spec is None or spec.origin is None else Path(spec.origin).read_text("utf-8")
    text = ast.get_docstring(ast.parse(source)) or ""
    return " ".join(text.split("\n\n")[0].split())


def field_docs(config: type[Any]) -> dict[str, str]:
    """The docstring under each field of a dataclass, by field name."""
    docs: dict[str, str] = {}
    for base in reversed(config.__mro__[:-1]):
        body = cast(ast.ClassDef, ast.parse(inspect.getsource(base)).body[0]).body
        for node, after in itertools.pairwise(body):
            match node, after:
                case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(ast.Constant(str() as text)):
                    docs[name] = " ".join(text.split())
                case _:
                    pass
    return {f.name: docs.get(f.name, "") for f in dataclasses.fields(config)}
