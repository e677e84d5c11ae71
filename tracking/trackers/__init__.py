"""Trackers, one a file, named as in the literature: `Config.build(rng)` gives a `Tracker`."""
