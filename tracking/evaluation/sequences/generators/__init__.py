"""Painted sequences with exact truth, one family a file."""
