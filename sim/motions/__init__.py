"""Target motions, one a file: `Config.build(rng)` gives an object with `at(time) -> Pose`."""
