"""Tracks (a tracker's estimates for all pictures of a source), and their measures against truth."""
