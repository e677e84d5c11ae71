"""Search for the target's state: particle filter, annealing, velocity, Newton descent, and
detection of AprilTags.
"""
