"""A folder is a registry: a file's name is a kind, its `Config` holds the settings and builds the thing.

Dropping a file into one of the folders is all it takes to add a motion, a tracker, an estimator, ...
"""

from __future__ import annotations

import ast
import dataclasses
import importlib
import inspect
import pkgutil
from typing import Any


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
    assert spec is not None and spec.origin is not None
    with open(spec.origin, encoding="utf-8") as file:
        text = ast.get_docstring(ast.parse(file.read())) or ""
    return " ".join(text.split("\n\n")[0].split())


def field_docs(config: type[Any]) -> dict[str, str]:
    """The docstring under each field of a dataclass, by field name."""
    body = ast.parse(inspect.getsource(config)).body[0]
    assert isinstance(body, ast.ClassDef)
    docs: dict[str, str] = {}
    for node, after in zip(body.body, body.body[1:], strict=False):
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            match after:
                case ast.Expr(ast.Constant(str() as text)):
                    docs[node.target.id] = " ".join(text.split())
                case _:
                    pass
    return {f.name: docs.get(f.name, "") for f in dataclasses.fields(config)}
