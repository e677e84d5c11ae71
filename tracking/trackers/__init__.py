"""Trackers, one a file, named as the literature names them: `Config.build(rng)` gives a `Tracker`."""
