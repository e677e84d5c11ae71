"""Photographs of a plane, straightened by a printed sheet of tags that lies on it."""
