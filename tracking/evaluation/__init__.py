"""Tracks (a tracker's estimates for all pictures of a source), their CSV files, their measures
against the target's true outlines, and the warm-up of trackers.
"""
