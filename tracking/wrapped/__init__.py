"""Trackers of others as ours: conventions of calls, boxes as states, judges, the TraX protocol."""
