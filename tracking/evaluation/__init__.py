"""Tracks (a tracker's estimates for all pictures of a source), their CSV files and their measures
against truth, and the warm-up of trackers.
"""
