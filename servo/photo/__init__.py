"""Perspective correction of a photograph of a plane on which a printed sheet of AprilTags lies: the
result shows the plane from straight above.
"""
