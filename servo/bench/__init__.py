"""Trackers against each other: on sequences, and in the closed loop."""
