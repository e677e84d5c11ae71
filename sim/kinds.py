"""A folder is a registry: a file's name is a kind, its `Config` holds the settings and builds the
thing.

Dropping a file into one of the folders is all it takes to add a motion, a tracker, an estimator,
... Installed packages add kinds by entry points; see `sim.installed`.
"""

import ast
import dataclasses
import importlib
import importlib.util
import inspect
import itertools
import pkgutil
from collections import Counter
from contextlib import suppress
from pathlib import Path
from textwrap import dedent
from typing import Any, cast

from sim.installed import FOLDERS, BrokenPart, Installed, Trusted, imported, installed

OWN = ("sim", "tracking", "servo")
"""The packages whose folders of plugins name a kind by its file."""


class UnknownKind(ValueError):
    """No kind of that name; the message lists what there is."""


def names(folder: str) -> list[str]:
    """The kinds a folder (a package such as 'tracking.trackers') has, sorted.

    An installed package's kind that has the name of another one is called package:kind.
    """
    return sorted([*_own(folder), *_added(folder)])


def package_of(folder: str, kind: str) -> str:
    """The package and version that a kind comes from; nothing for ours."""
    found = _added(folder).get(kind)
    return "" if found is None else f"{found.package} {found.version}"


def config_of(folder: str, kind: str) -> type[Any]:
    """The `Config` class of one kind.

    Raises:
        UnknownKind: The folder has no such kind, it cannot be imported, or it is no `Config`.
    """
    if kind in _own(folder):
        return importlib.import_module(f"{folder}.{kind}").Config
    try:
        return as_config(folder, imported(_path_of(folder, kind)), kind)
    except BrokenPart as error:
        package = package_of(folder, kind)
        of = f"the kind '{kind}' of {package}: " if package else ""
        raise UnknownKind(f"{of}{error}") from error


def as_config(folder: str, found: Any, name: str) -> type[Any]:
    """A `Config` class for an object that is given as a part.

    A folder may adapt other things: its function `adapted` makes a `Config` class of them, or
    gives None.

    Raises:
        UnknownKind: It is no `Config`, and the folder cannot adapt it.
    """
    if isinstance(found, type) and callable(getattr(found, "build", None)):
        _check_config(found, name)
        return found
    adapt = getattr(importlib.import_module(folder), "adapted", None)
    if adapt is not None and (adapted := adapt(found)) is not None:
        return adapted
    raise UnknownKind(f"'{name}' is no Config: that is a dataclass with a method build(rng)")


def _check_config(config: type[Any], name: str) -> None:
    if not dataclasses.is_dataclass(config):
        raise UnknownKind(f"'{name}' has a method build(rng), but is no dataclass of settings")
    missing = dataclasses.MISSING
    bare = [
        f.name
        for f in dataclasses.fields(config)
        if f.init and f.default is missing and f.default_factory is missing
    ]
    if bare:
        raise UnknownKind(f"'{name}': its settings {', '.join(bare)} have no defaults")


def kind_of(config: Any) -> str:
    """The kind of a `Config`: the attribute `kind` of its class where it has one that is not a
    setting, the name of its file in one of our folders, that of its entry point, or module:Class.
    """
    of = type(config)
    is_setting = dataclasses.is_dataclass(of) and "kind" in {f.name for f in dataclasses.fields(of)}
    own = None if is_setting else getattr(of, "kind", None)
    if not isinstance(own, str):
        package, _, kind = of.__module__.rpartition(".")
        if package.partition(".")[0] in OWN and of.__qualname__ == "Config":
            return kind
        own = f"{of.__module__}:{of.__qualname__}"
    if ":" not in own:
        return own
    added = (item for folder in FOLDERS for item in _added(folder).items())
    return next((name for name, found in added if found.path == own), own)


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


def named(folder: str, text: str) -> dict[str, Any]:
    """The table that "kind" or "kind:preset" stands for; a kind of another package may be
    "package:kind", and a class to import "module:Name".
    """
    kind, *rest = text.split(":")
    if kind and rest and kind not in names(folder):
        kind = f"{kind}:{rest.pop(0)}"
    return {"kind": Trusted(kind)} | ({"preset": ":".join(rest)} if rest else {})


def presets(folder: str, kind: str) -> dict[str, dict[str, Any]]:
    """All presets of a kind by name: the `PRESETS` of its file, or of another's `Config`."""
    config = config_of(folder, kind)
    own = kind in _own(folder)
    return getattr(importlib.import_module(config.__module__) if own else config, "PRESETS", {})


def summary(folder: str, kind: str) -> str:
    """The first sentence of the kind's file, read without importing what it needs; of another
    package's kind, that of its class.
    """
    if kind in _own(folder):
        return _first_sentence(_tree_of(f"{folder}.{kind}"))
    module, _, name = _path_of(folder, kind).partition(":")
    tree = _tree_of(module)
    classes = [n for n in ast.walk(tree) if isinstance(n, ast.ClassDef) and n.name == name]
    return next(filter(None, map(_first_sentence, [*classes, tree])), "")


def _own(folder: str) -> list[str]:
    spec = importlib.util.find_spec(folder)
    paths = spec.submodule_search_locations if spec else None
    return sorted(m.name for m in pkgutil.iter_modules(paths) if not m.name.startswith("_"))


def _added(folder: str) -> dict[str, Installed]:
    """Kinds of installed packages by the names they go by."""
    found = installed(folder)
    taken = Counter([*_own(folder), *(k.kind for k in found)]) if found else Counter[str]()
    return {k.kind if taken[k.kind] == 1 else f"{k.package}:{k.kind}": k for k in found}


def _path_of(folder: str, kind: str) -> str:
    """module:Class of a kind that is not ours.

    Raises:
        UnknownKind: There is no such kind, several packages have it, or a file names code.
    """
    for found in installed(folder):
        if kind == f"{found.package}:{found.kind}":
            return found.path
    if (added := _added(folder).get(kind)) is not None:
        return added.path
    if ":" not in kind:
        several = [n for n in _added(folder) if n.endswith(f":{kind}")]
        which = f"several packages have a kind '{kind}': write {' or '.join(several)}"
        raise UnknownKind(
            which if several else f"there is no kind '{kind}'; there is {', '.join(names(folder))}"
        )
    if not isinstance(kind, Trusted):
        raise UnknownKind(
            f"'{kind}' is no kind of an installed package, and a file may not name code to "
            "import: give it with --set, or from Python"
        )
    return kind


def _tree_of(module: str) -> ast.Module:
    """The parsed source of a module; empty where there is none."""
    with suppress(Exception, SystemExit):  # finding a module imports the package around it
        spec = importlib.util.find_spec(module)
        if spec is not None and spec.origin is not None:
            return ast.parse(Path(spec.origin).read_text("utf-8"))
    return ast.parse("")


def _first_sentence(node: ast.Module | ast.ClassDef) -> str:
    return " ".join((ast.get_docstring(node) or "").split("\n\n")[0].split())


def field_docs(config: type[Any]) -> dict[str, str]:
    """The docstring under each field of a dataclass, by field name."""
    docs: dict[str, str] = {}
    for base in reversed(config.__mro__[:-1]):
        try:
            source = dedent(inspect.getsource(base))
            body = cast(ast.ClassDef, ast.parse(source).body[0]).body
        except (OSError, TypeError, SyntaxError):  # a class made by a function
            continue
        for node, after in itertools.pairwise(body):
            match node, after:
                case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(ast.Constant(str() as text)):
                    docs[name] = " ".join(text.split())
                case _:
                    pass
    return {f.name: docs.get(f.name, "") for f in dataclasses.fields(config)}
