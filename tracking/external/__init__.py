"""Trackers of others as ours: conventions of calls, boxes as states, judges, the TraX protocol."""

OF_THE_USER = frozenset({"opencv", "trax"})
"""Kinds that stand for a tracker which the user has: "all trackers" leaves them out."""
