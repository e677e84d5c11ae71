"""Trackers of other authors by one contract: classes, programs, servers of TraX, networks."""
