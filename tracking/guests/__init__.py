"""Trackers of other authors, all used through one interface (`guest.Guest`): Python classes,
OpenCV's own trackers, programs, and servers of TraX.
"""
