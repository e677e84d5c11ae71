"""Trackers of others as ours: conventions of calls, boxes as states, judges, the TraX protocol."""

OF_THE_USER = frozenset({"opencv", "tag", "trax", "truth"})
"""Kinds that need what the user has, a tracker, a tag on the target or a simulation that knows the
truth: "all trackers" leaves them out."""
