"""Package of the trackers, one module each, named as in the literature: `Config.build(rng)` returns
a `Tracker`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sim.kinds import Kinds, PartConfig
from sim.plain_part import plain_config

if TYPE_CHECKING:
    from tracking.types import Tracker


def _adapted(found: object) -> type[Any] | None:
    """Return a `Config` class for a tracker of the user: a class or object with `start` and
    `update`, or with `init` and `update`, or a function that returns the latter; None for other
    objects.
    """
    # Imported only now: `servobench list` only looks at files.
    from tracking.guests.wrap import is_foreign, wrap

    own = plain_config(found, "start", "update")
    is_function = callable(found) and not isinstance(found, type)
    if is_foreign(found) or (is_function and own is None):
        return wrap(found)
    return own


def general_kinds() -> list[str]:
    """Return the kinds (names) of the trackers meant by "all trackers": those that can follow any
    target by pictures and the camera's motion alone, and need no program or model file of the user.
    """
    from tracking.types import Trait, follows_any_target, traits_of

    configs = {kind: KINDS.config(kind) for kind in KINDS.names()}
    return [
        kind
        for kind, config in configs.items()
        if follows_any_target(config) and Trait.FOREIGN not in (traits_of(config) or ())
    ]


KINDS: Kinds[PartConfig[Tracker]] = Kinds(
    __name__,
    "servobench.trackers",
    _adapted,
    "the two methods init(image, box) and update(image)",
)
