"""Controllers, one module each: `Config.build(rng)` returns a `Controller`, which commands a camera
twist after each picture.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sim.kinds import Kinds, PartConfig

if TYPE_CHECKING:
    from servo.parts import Controller


def _adapted(found: Any) -> type[Any] | None:
    """Return a `Config` class for a user's control law or policy that has none; None for an object
    that is neither.
    """
    from servo.controllers._plain_law import adapted  # `servobench list` only looks at files

    return adapted(found)


KINDS: Kinds[PartConfig[Controller]] = Kinds(
    __name__,
    "servobench.controllers",
    _adapted,
    "a method command or act, and it is no function",
)
