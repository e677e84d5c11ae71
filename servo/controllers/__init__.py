"""Controllers, one a file: `Config.build(rng)` gives a function from an `Estimator` to a
`Controller`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from sim.kinds import Kinds, PartConfig

if TYPE_CHECKING:
    from servo.parts import Controller, Estimator

KINDS: Kinds[PartConfig[Callable[[Estimator], Controller]]] = Kinds(
    __name__, "servobench.controllers"
)
