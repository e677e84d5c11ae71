"""Comparison of trackers: sequences with truth, measures, statistics and drawings."""
