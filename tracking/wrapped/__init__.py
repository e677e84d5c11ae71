"""Trackers of other authors with our interface: OpenCV, GOT-10k, TraX."""

OF_THE_USER = frozenset({"opencv", "tag", "trax", "truth"})
"""Kinds of trackers that "all trackers" leaves out: they need a tracker of the user, a tag on the
target, or the truth of a simulation."""
