"""Comparing trackers honestly."""
