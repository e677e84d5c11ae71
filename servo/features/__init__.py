"""Feature sets, one a file."""

from typing import Any

from sim.kinds import Kinds

KINDS = Kinds[Any](__name__, "servobench.features")
