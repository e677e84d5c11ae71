"""Robots that carry the camera, one a file: `Config.build(rng)` gives a `Design`."""
