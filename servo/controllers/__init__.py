"""Controllers, one a file: `Config.build(rng)` gives a function from an `Estimator` to a
`Controller`.
"""
