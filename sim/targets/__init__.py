"""Objects to be followed, one a file: `Config.build(rng)` gives a `Target`."""
