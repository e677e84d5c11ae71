"""Conversion of a tracker's estimate, which is in pixels, to the target as a control law needs it:
its moments, corners, plane and pose in the camera frame (`Sight`).
"""
