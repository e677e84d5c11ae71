"""Estimators of the target's own motion, one a file: `Config.build(rng)` gives an `Estimator`."""
