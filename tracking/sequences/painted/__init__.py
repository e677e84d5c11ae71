"""Painted sequences with exact truth; each file is one family."""
