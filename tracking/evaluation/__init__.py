"""Tracks of trackers, and their measures against the truth."""
