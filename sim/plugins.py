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
import pkgutil
from pathlib import Path
from typing import Any, cast


class UnknownKind(ValueError):
    """No file of that name in the folder; the message lists what there is."""


def kinds(folder: str) -> list[str]:
    """The kinds a folder (a package such as 'tracking.trackers') has, sorted."""
    paths = importlib.import_module(folder).__path__
    return sorted(m.name for m in pkgutil.iter_modules(paths) if not m.name.startswith("_"))


def config_of(folder: str, kind: str) -> type[Any]:
    """The `Config` class of one kind.

    Raises:
        UnknownKind: The folder has no such file.
    """
    if kind not in kinds(folder):
        raise UnknownKind(f"there is no kind '{kind}'; there is {', '.join(kinds(folder))}")
    return importlib.import_module(f"{folder}.{kind}").Config


def summary(folder: str, kind: str) -> str:
    """The first sentence of the kind's file, read without importing what it needs."""
    spec = importlib.util.find_spec(f"{folder}.{kind}")
    if spec is None or spec.origin is None:
        raise UnknownKind(f"there is no kind '{kind}' in {folder}")
    text = ast.get_docstring(ast.parse(Path(spec.origin).read_text(encoding="utf-8"))) or ""
    return " ".join(text.split("\n\n")[0].split())


def field_docs(config: type[Any]) -> dict[str, str]:
    """The docstring under each field of a dataclass, by field name."""
    body = cast(ast.ClassDef, ast.parse(inspect.getsource(config)).body[0])
    docs: dict[str, str] = {}
    for node, after in zip(body.body, body.body[1:], strict=False):
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            match after:
                case ast.Expr(ast.Constant(str() as text)):
                    docs[node.target.id] = " ".join(text.split())
                case _:
                    pass
    return {f.name: docs.get(f.name, "") for f in dataclasses.fields(config)}
