"""What disturbs the world, one a file: `Config.build(rng)` gives an object with `at(time) ->
Effect`.
"""
