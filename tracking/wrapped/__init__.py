"""Trackers of others as ours: conventions of calls, boxes as states, judges, the TraX protocol."""

OF_THE_USER = frozenset({"opencv", "tag", "trax"})
"""Kinds that need what the user has, a tracker or a tag on the target: "all trackers" leaves them
out."""
