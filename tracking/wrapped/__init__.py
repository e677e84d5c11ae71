"""Trackers of other authors with our interface: OpenCV, GOT-10k, TraX."""
