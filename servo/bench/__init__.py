"""Comparisons of trackers, on sequences and in the closed loop."""
