"""Every constant and every default in the source is the one that was approved, module by module.

They lie in tests/data/approved/constants.json and defaults.json, as text; conftest.py says how they
are changed on purpose.
"""

import ast
import dataclasses
import enum
import importlib
import inspect
import re
from pathlib import Path

import numpy as np
import pytest

PACKAGES = ("servo", "sim", "tracking")
OF_THE_SYSTEM = {"FULL", "MISPLACED", "NEW"}
"""Numbers of errors and flags, which are others elsewhere."""
SENTENCE = re.compile(r"\S+\s+\S+\s+\S+\s")
"""What people read is compared where it is printed."""


def text(value):
    """A plain value as text, its numbers to nine digits; None for functions, types, sentences."""
    if isinstance(value, np.ndarray | np.generic):
        return text(value.tolist())
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return text({f.name: getattr(value, f.name) for f in dataclasses.fields(value)})
    match value:
        case enum.Enum():
            shown = "" if isinstance(value.value, str) else f" {text(value.value)}"
            return f"{type(value).__name__}.{value.name}{shown}"
        case bool() | int() | bytes():
            return repr(value)
        case float():
            return f"{value:.9g}"
        case complex():
            return text([round(x, 9) + 0.0 for x in (value.real, value.imag)])
        case str():
            return None if SENTENCE.search(value) else repr(value)
        case range() | slice() | re.Pattern():
            return str(value)
        case dict():
            return ", ".join(f"{part(k)}: {part(v)}" for k, v in value.items()).join("{}")
        case list() | tuple():
            return ", ".join(map(part, value)).join("[]")
        case set() | frozenset():
            return ", ".join(sorted(map(part, value))).join("{}")
        case _:
            return None


def part(value):
    return "None" if value is None else text(value) or "..."


def plain(values):
    return {name: found for name, value in values if (found := text(value)) is not None}


def defaults_of(function, name):
    function = getattr(function, "py_func", getattr(function, "__func__", function))
    function = getattr(function, "func", inspect.unwrap(function))
    if inspect.isfunction(function):
        for parameter in inspect.signature(function).parameters.values():
            if parameter.default is not parameter.empty:
                yield f"{name}({parameter.name})", parameter.default


def settings_of(cls, name):
    """Defaults of a dataclass, the members of an enum, and what else a class body assigns."""
    if dataclasses.is_dataclass(cls):
        own = inspect.get_annotations(cls)
        for field in dataclasses.fields(cls):
            if field.name not in own:
                continue
            if not field.repr:
                yield f"{name}.{field.name} in its repr", False
            if field.default is not dataclasses.MISSING:
                yield f"{name}.{field.name}", field.default
            elif field.default_factory is not dataclasses.MISSING:
                yield f"{name}.{field.name}", field.default_factory()
    members = cls.__members__ if issubclass(cls, enum.Enum) else {}
    yield from ((f"{name}.{key}", member.value) for key, member in members.items())
    for key, value in vars(cls).items():
        if inspect.isroutine(value) or isinstance(value, staticmethod | classmethod):
            if not (dataclasses.is_dataclass(cls) and key == "__init__"):
                yield from defaults_of(value, f"{name}.{key}")
        elif not (key.startswith("_") or dataclasses.is_dataclass(cls) or key in members):
            yield f"{name}.{key}", value


def constants_of(tree):
    """Names that a module gives to its constants."""
    for statement in tree.body:
        if isinstance(statement, ast.Assign | ast.AnnAssign):
            names = [
                node.id
                for node in ast.walk(statement)
                if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
            ]
            yield from (name for name in names if name.isupper() and name not in OF_THE_SYSTEM)


def modules(root):
    for path in sorted(path for package in PACKAGES for path in (root / package).rglob("*.py")):
        name = ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")
        yield name, importlib.import_module(name), ast.parse(path.read_text())


@pytest.fixture(scope="module")
def found(root: Path):
    constants, defaults = {}, {}
    for name, module, tree in modules(root):
        constants[name] = plain((n, getattr(module, n)) for n in constants_of(tree))
        own = [n.name for n in tree.body if isinstance(n, ast.FunctionDef | ast.ClassDef)]
        defaults[name] = {}
        for one in own:
            value = getattr(module, one)
            walk = settings_of if isinstance(value, type) else defaults_of
            defaults[name] |= plain(walk(value, one))
    return {
        kind: {name: values for name, values in table.items() if values}
        for kind, table in (("constants", constants), ("defaults", defaults))
    }


@pytest.mark.parametrize("kind", ["constants", "defaults"])
def test_every_value_is_the_approved_one(found, approved, kind):
    approved(kind, found[kind])


def test_the_walk_finds_values_of_every_sort(found):
    constants, defaults = found["constants"], found["defaults"]
    assert constants["servo.features._interaction"]["ROUND"] == "1e-09"
    assert constants["servo.sight.planes"]["FACING"] == "[0, 0, 1]"
    assert constants["sim.start_pose"]["STEPS"] == "200"
    assert defaults["servo.scenario.sections"]["RunConfig.latency"] == "1"
    assert defaults["tracking.settings"]["DiscSettings.lock"].startswith(
        "{'floor': 0.5, 'cap': 0.75,"
    )
    assert defaults["servo.study.parse"]["load(changes)"] == "[]"
    assert len(constants) > 60
    assert len(defaults) > 60
