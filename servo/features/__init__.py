"""Feature sets, one a file."""
