"""What disturbs the world, one a file: `Config.build(rng)` gives an object with `at(time) ->
Effect`, and `props`: the models that it needs in the scene.
"""

from typing import Any

from sim.kinds import Kinds

KINDS = Kinds[Any](__name__, "servobench.disturbances")
