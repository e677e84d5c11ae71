"""Pictures from folders, videos, bags (recorded ROS messages), streams and cameras, painted
sequences, and the target's true corners in the pictures.
"""
