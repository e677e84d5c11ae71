"""A software renderer that gives the same pictures on every machine."""
