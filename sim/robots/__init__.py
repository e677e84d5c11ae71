"""Robots that carry the camera, one a file: `Config.build(rng)` gives a `Design`."""

from typing import Any

from sim.kinds import Kinds

KINDS = Kinds[Any](__name__, "servobench.robots")
