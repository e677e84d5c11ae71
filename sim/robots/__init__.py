"""Robots that carry the camera, one per file: `Config.build(rng)` gives a `Design`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim.kinds import Kinds, PartConfig

if TYPE_CHECKING:
    from sim.kinematics.robot import Design

KINDS: Kinds[PartConfig[Design]] = Kinds(__name__, "servobench.robots")
