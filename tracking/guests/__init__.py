"""Trackers of other authors behind the protocol `tracking.types.Tracker`: OpenCV, GOT-10k, TraX."""
