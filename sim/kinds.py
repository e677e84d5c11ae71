"""Registries of kinds: a kind is a named component, such as the tracker "kams". Each file in a
folder such as `tracking/trackers` is a kind, unless its name begins with "_"; its `Config` holds
the settings and builds the component.

A folder owns a value `KINDS = Kinds(__name__, ...)`, and a file dropped into it adds a motion, a
tracker, an estimator, ... A kind may be a preset of another kind: its `Config` then inherits from
the other one and changes nothing but defaults. Installed packages add kinds by entry points; see
`sim.installed`.
"""

from __future__ import annotations

import ast
import dataclasses
import functools
import importlib
import importlib.util
import inspect
import itertools
import pkgutil
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from textwrap import dedent
from typing import (
    TYPE_CHECKING,
    Any,
    Generic,
    Protocol,
    Self,
    TypeVar,
    cast,
    runtime_checkable,
)

from sim.installed import BrokenPart, Installed, Trusted, imported, installed, plain

if TYPE_CHECKING:
    import numpy as np  # `servobench list` only looks at files

Thing = TypeVar("Thing", covariant=True)
"""Type of a part, such as `Tracker`."""
Config = TypeVar("Config", covariant=True)
"""The settings of a folder's kinds, such as `PartConfig[Tracker]`."""
Settings = Mapping[str, object]
ConfigClass = type[Any]
"""A dataclass of settings; only its own file knows its fields."""


class PartConfig(Protocol[Thing]):
    """The settings of a component such as a tracker: a frozen dataclass with a default for every
    field, which builds the component.
    """

    def build(self, rng: np.random.Generator) -> Thing:
        """Return a new component, such as a tracker, with these settings; called before a run
        begins.

        Args:
            rng: Source of all random numbers of the component: the same seed gives the same run.
        """
        ...


@runtime_checkable
class KeptOutOfFiles(Protocol):
    """Settings of a component of which some may be given only on the command line or in Python, not
    by a scenario's file, such as a command to start.
    """

    @property
    def not_from_file(self) -> tuple[str, ...]:
        """Names of the settings that only the command line or Python may give: a scenario's file
        that gives one of them is refused.
        """
        ...


def not_from_file(config: object) -> tuple[str, ...]:
    """Return the names of the settings that only the command line or Python may give, not a
    scenario's file. `config` is a component's settings or their class; the result is () if a file
    may give all.
    """
    return config.not_from_file if isinstance(config, KeptOutOfFiles) else ()


@runtime_checkable
class SaysWhatIsIdle(Protocol):
    """Settings of a component of which some have no effect because of others."""

    @property
    def idle(self) -> Mapping[str, str]:
        """The reasons, each a clause, by the names of the settings that have no effect now."""
        ...


def idle_in(config: object) -> Mapping[str, str]:
    """Return the reasons, by name, why settings of a component have no effect beside its other
    settings; none if its settings do not say so.
    """
    return config.idle if isinstance(config, SaysWhatIsIdle) else {}


@dataclasses.dataclass(frozen=True, slots=True)
class BuildsItself:
    """Base class of settings that are themselves the component, such as the motion of a target:
    their `build` returns the settings object.
    """

    def build(self, rng: np.random.Generator) -> Self:
        """Return this settings object, which is the component; `rng` is not used."""
        return self


class UnknownKind(ValueError):
    """Error: a kind (a named component, such as the tracker "kams") or a preset of it is unknown,
    or the kind cannot be imported; the message says why.
    """


@functools.cache  # parsing a scenario asks 40 times, 0.25 ms each
def _modules_in(paths: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of the modules in folders, without those that begin with "_", sorted."""
    return tuple(sorted(m.name for m in pkgutil.iter_modules(paths) if m.name[0] != "_"))


class Kinds(Generic[Config]):
    """The registry of the components of one sort, such as all trackers: each module in the package
    `folder` whose name does not begin with "_" is a kind (a named component), and installed
    packages add further kinds by entry points in the group `group`.

    `adapt` returns a `Config` class for an object that is not one, or None; `plain` describes such
    objects in messages.

    >>> from sim import motions
    >>> motions.KINDS.config("line", speed=0.2).speed
    0.2
    """

    def __init__(
        self,
        folder: str,
        group: str = "",
        adapt: Callable[[object], ConfigClass | None] = lambda _: None,
        plain: str = "",
    ) -> None:
        """Register a folder.

        Args:
            folder: Its package, such as "tracking.trackers".
            group: Group of entry points by which other packages add kinds, such as
                "servobench.trackers"; empty: they cannot add any.
            adapt: Returns a `Config` class for an object that is not one; None if it cannot.
            plain: Description of such objects for messages, such as "a method at(time)".
        """
        self.folder = folder
        self.group = group
        self._adapt = adapt
        self._plain = plain
        _REGISTERED[folder] = self

    def names(self) -> list[str]:
        """Return the names of all kinds (components) of this registry, those in its folder and
        those of installed packages, sorted.

        An installed package's kind that has the name of another one is called package:kind.
        """
        return sorted([*self._own(), *self._added()])

    def package_of(self, kind: str) -> str:
        """Return the name and version of the installed package that adds a kind, such as
        "my-package 1.2", given a name from `names`; an empty text for servobench's own kinds and
        for all other names.
        """
        found = self._added().get(kind)
        return "" if found is None else f"{found.package} {found.version}"

    def config(self, kind: str, preset: str | None = None, /, **settings: object) -> Config:
        """Return the settings of a kind (a component by its name). They begin with the kind's
        defaults; the values of the preset, if one is named, replace some of them; and the given
        settings replace both.

        Raises:
            UnknownKind: There is no such kind or preset.
            TypeError: There is no such setting.
            ValueError: The `Config` refuses the settings.
        """
        begin = {} if preset is None else self.preset(kind, preset)
        return self.config_of(kind)(**{**begin, **settings})

    def config_of(self, kind: str) -> ConfigClass:
        """Return the class `Config` of a kind, the dataclass of its settings. The kind may also be
        the path of a `Config` or another object to import, "module:Name", if the text is `Trusted`
        (from the command line or from Python, not from a file).

        Raises:
            UnknownKind: The kind is unknown, cannot be imported, or is not a `Config` nor an object
                for which `adapt` makes one.
        """
        if kind in self._own():
            return importlib.import_module(f"{self.folder}.{kind}").Config
        try:
            return self.as_config(imported(self._path_of(kind)), kind)
        except BrokenPart as error:
            package = self.package_of(kind)
            of = f"the kind '{kind}' of {package}: " if package else ""
            raise UnknownKind(f"{of}{error}") from error

    def as_config(self, found: object, name: str) -> ConfigClass:
        """Return the `Config` class for an object that a user gives as a component: the object
        itself if it is such a class, else a class that the registry's `adapt` makes for it. `name`
        is used in messages.

        Raises:
            UnknownKind: The object is a class with a method `build` that is no dataclass, has a
                field without a default, or has `PRESETS` that are no dictionary of dictionaries; or
                it is no such class, and `adapt` returns None.
        """
        if isinstance(found, type) and callable(getattr(found, "build", None)):
            _check_config(found, name)
            return found
        if (adapted := self._adapt(found)) is not None:
            return adapted
        what = f"'{name}' is no Config: a Config is a dataclass with a method build(rng)"
        raise UnknownKind(f"{what}; it also lacks {self._plain}" if self._plain else what)

    def preset(self, kind: str, name: str) -> Settings:
        """Return the values that a preset of a kind gives to its settings, as a mapping by the
        settings' names. The preset "paper" has the values of the publication.

        Raises:
            UnknownKind: There is no such kind, or it has no such preset.
        """
        known = self.presets(kind)
        if name not in known:
            there = f"there is {', '.join(known)}" if known else f"'{kind}' has none"
            raise UnknownKind(f"there is no preset '{name}'; {there}")
        return known[name]

    def presets(self, kind: str) -> dict[str, Settings]:
        """Return all presets of a kind by name, each a mapping from settings to values: `PRESETS`
        of the kind's module, or, for another package's kind, of its `Config`; {} without presets.

        Raises:
            UnknownKind: There is no such kind.
        """
        config = self.config_of(kind)
        own = kind in self._own()
        return getattr(importlib.import_module(config.__module__) if own else config, "PRESETS", {})

    def named(self, text: str) -> dict[str, str]:
        """Return the table of a scenario that a short text stands for: {"kind": "kams"} for "kams",
        and {"kind": "kams", "preset": "paper"} for "kams:paper". The kind may also be
        "package:kind" for an installed package's, or "module:Name" for a class to import; it is
        returned as `Trusted`.
        """
        kind, *rest = text.split(":")
        if kind and rest and kind not in self.names():
            kind = f"{kind}:{rest.pop(0)}"
        return {"kind": Trusted(kind)} | ({"preset": ":".join(rest)} if rest else {})

    def summary(self, kind: str) -> str:
        """Return the first paragraph of the docstring of a kind's module, on one line, without
        importing the module. For another package's kind it is that of the class, or else of the
        module; an empty text if there is none.

        Raises:
            UnknownKind: There is no such kind.
        """
        if kind in self._own():
            return _first_sentence(_tree_of(f"{self.folder}.{kind}"))
        module, _, name = self._path_of(kind).partition(":")
        tree = _tree_of(module)
        classes = [n for n in ast.walk(tree) if isinstance(n, ast.ClassDef) and n.name == name]
        return next(filter(None, map(_first_sentence, [*classes, tree])), "")

    def kind_at(self, path: str) -> str | None:
        """Return the name in this registry of the kind that an installed package adds with the
        import path "module:Class"; None if no entry point has this path.
        """
        return next((name for name, found in self._added().items() if found.path == path), None)

    def _own(self) -> Sequence[str]:
        return _modules_in(tuple(importlib.import_module(self.folder).__path__))

    def _added(self) -> dict[str, Installed]:
        """Return the kinds that installed packages add to this folder, by the names that they have
        here.
        """
        found = installed(self.group) if self.group else ()
        count = Counter([*self._own(), *(k.kind for k in found)]) if found else Counter[str]()
        return {k.kind if count[k.kind] == 1 else f"{k.package}:{k.kind}": k for k in found}

    def _path_of(self, kind: str) -> str:
        """Return the path to import, "module:Class", of a kind outside servobench.

        Raises:
            UnknownKind: There is no such kind, several packages have it, or a file names code.
        """
        added = self._added()
        each = {f"{found.package}:{found.kind}": found for found in added.values()}
        if (found := added.get(kind) or each.get(kind)) is not None:
            return found.path
        if ":" not in kind:
            several = [n for n in added if n.endswith(f":{kind}")]
            which = f"several packages have a kind '{kind}': write {' or '.join(several)}"
            there = f"there is no kind '{kind}'; there is {', '.join(self.names())}"
            raise UnknownKind(which if several else there)
        if not isinstance(kind, Trusted):
            raise UnknownKind(
                f"'{kind}' is no kind of an installed package, and a TOML file may not name code "
                "to import: give the kind with --set, or from Python"
            )
        return kind


_REGISTERED: dict[str, Kinds[object]] = {}
"""The registries of all folders of kinds that have been imported, by the folders' packages."""


def kind_of(config: object) -> str:
    """Return the name of the kind to which a component's settings (a `Config`) belong: the name of
    their module in the folder of a registry, or of their entry point, or else "module:Class".

    A `Config` class that was made for another object has the "module:Class" of this object in a
    class attribute `kind`, which is no field.
    """
    of = type(config)
    package, _, name = of.__module__.rpartition(".")
    if package in _REGISTERED and of.__qualname__ == "Config":
        return name
    path = f"{of.__module__}:{of.__qualname__}"
    if not dataclasses.is_dataclass(of) or "kind" not in (f.name for f in dataclasses.fields(of)):
        path = str(getattr(of, "kind", path))
    return next(filter(None, (each.kind_at(path) for each in _REGISTERED.values())), path)


def checked(config: Config, place: str) -> Config:
    """Check the types and ranges of settings that were made in Python against the annotations of
    their dataclass, and return them. Settings whose annotations cannot be checked are returned
    unchecked.

    Args:
        config: The settings, an object of a dataclass.
        place: Name of the settings' table in the message, such as "tracker".

    Raises:
        ValueError: A setting has a wrong type, or is out of range.
    """
    from pydantic import PydanticUserError, TypeAdapter, ValidationError  # takes a while

    of: Any = config
    given = {f.name: getattr(of, f.name) for f in dataclasses.fields(of) if f.init}
    try:
        return TypeAdapter(type(config)).validate_python(given)
    except ValidationError as error:
        first = error.errors()[0]
        name = str(first["loc"][0])
        raise ValueError(f"{place}.{name} = {given[name]!r}: {first['msg']}") from None
    except (PydanticUserError, NameError):  # a part of one's own, with types of its own
        return config


def _check_config(config: ConfigClass, name: str) -> None:
    if not dataclasses.is_dataclass(config):
        raise UnknownKind(
            f"'{name}' has a method build(rng), but is no dataclass of settings: make it one"
        )
    missing = dataclasses.MISSING
    bare = [
        f.name
        for f in dataclasses.fields(config)
        if f.init and f.default is missing and f.default_factory is missing
    ]
    if bare:
        raise UnknownKind(
            f"'{name}': the settings {', '.join(bare)} have no defaults: give each a default"
        )
    presets = getattr(config, "PRESETS", {})
    if not isinstance(presets, dict) or not all(isinstance(p, dict) for p in presets.values()):
        raise UnknownKind(
            f"'{name}': PRESETS should be a dictionary of presets by name, each a dictionary of "
            "settings"
        )


def _tree_of(module: str) -> ast.Module:
    """Return the parsed source of a module; an empty tree if its source cannot be found."""
    with suppress(Exception, SystemExit):  # finding a module imports the package around it
        spec = importlib.util.find_spec(module)
        if spec is not None and spec.origin is not None:
            return ast.parse(Path(spec.origin).read_text("utf-8"))
    return ast.parse("")


def _first_sentence(node: ast.Module | ast.ClassDef) -> str:
    return plain((ast.get_docstring(node) or "").split("\n\n")[0])


def field_docs(config: ConfigClass) -> dict[str, str]:
    """Return the docstring that stands below each field of a dataclass, on one line, by the field's
    name; an empty text for a field without one.
    """
    docs: dict[str, str] = {}
    for base in reversed(config.__mro__[:-1]):
        try:
            body = cast(ast.ClassDef, ast.parse(dedent(inspect.getsource(base))).body[0]).body
        except (OSError, TypeError, SyntaxError):  # a class made by a function
            continue
        for node, after in itertools.pairwise(body):
            match node, after:
                case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(ast.Constant(str() as text)):
                    docs[name] = plain(text)
                case _:
                    pass
    return {f.name: docs.get(f.name, "") for f in dataclasses.fields(config)}
