"""Disturbances of the world, one a file: `Config.build(rng)` gives an object with `at(time) ->
Effect`, and `props`: the models that it needs in the scene.
"""
