"""Sequences of pictures from folders, videos, bags, streams and cameras, and their truth."""
