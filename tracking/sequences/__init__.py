"""Pictures from folders, videos, bags, streams and cameras, painted sequences, and the target's
true place in the pictures.
"""
