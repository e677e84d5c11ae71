"""Every setting of every kind of part, with the ends of its range."""

import dataclasses
import enum
import inspect
import math
import types
from typing import Annotated, Literal, Union, get_args, get_origin, get_type_hints

from annotated_types import Ge, Gt, Le, Lt

from servo.scenario.catalogue import LISTS, PLUGINS
from servo.scenario.tables import SECTIONS

KINDS = [(place, None, config) for place, config in SECTIONS.items()]
KINDS += [
    (place, kind, folder.config_of(kind))
    for place, folder in [*((p, f) for p, (f, _) in PLUGINS.items()), *LISTS.items()]
    for kind in folder.names()
]
"""Place, kind and settings of everything that a scenario may name."""


def ends(hint):
    """The smallest and the largest value of a number, or all choices, as TOML has them."""
    origin, parts = get_origin(hint), get_args(hint)
    if origin is Annotated:
        kind, *limits = parts
        if get_origin(kind) is tuple:
            (length,) = [v.min_length for v in limits]
            return [[value] * length for value in ends(get_args(kind)[0])]
        if kind is str:  # the name of a file has no ends
            return []
        low = [
            v.ge if isinstance(v, Ge) else math.nextafter(v.gt, math.inf)
            for v in limits
            if isinstance(v, Ge | Gt)
        ]
        high = [
            v.le if isinstance(v, Le) else math.nextafter(v.lt, -math.inf)
            for v in limits
            if isinstance(v, Le | Lt)
        ]
        return [kind(low[0]), kind(high[0])]
    if origin is Literal:
        return list(parts)
    if origin in (Union, types.UnionType):
        return [v for part in parts if part is not type(None) for v in ends(part)]
    if origin is tuple and parts[-1] is Ellipsis:
        return [*([choice] for choice in ends(parts[0])), ends(parts[0])]
    if origin is tuple:
        return [list(values) for values in zip(*map(ends, parts), strict=True)]
    if hint is str:
        return ["xn"]  # a feature of the default set
    return [False, True] if hint is bool else [member.value for member in hint]


def settings_of(config, begin=""):
    """Class, name, and ends of every setting, those of tables inside included."""
    for name, hint in get_type_hints(config, include_extras=True).items():
        if dataclasses.is_dataclass(hint):
            yield from settings_of(hint, f"{begin}{name}.")
        elif hint is bool or get_origin(hint) or issubclass(hint, enum.Enum):
            owner = next(c for c in config.__mro__ if name in inspect.get_annotations(c))
            yield owner, f"{begin}{name}", ends(hint)
